"""Write each line that a process prints to a file, with its time.

During a flight, the files are in the flight's directory, in the layout of the thesis
(`uavrt.flight.flight_layout`); the radio program's output has its own file. At other times, the
files are in ``system_log/`` of the flights' directory.
"""

import json
import time
from pathlib import Path

from uavrt.core.log import in_words
from uavrt.core.messages import StatusText
from uavrt.flight.flight_layout import FlightLayout

MAX_BYTES = 2_000_000
KEPT_FILES = 3
"""Number of full logs preserved for each process, 8 MB in all; ``name.log.1`` is newest."""
RADIO_EVENTS = (b'"event": "radio says"', b'"event": "starting radio"')
"""Log events of the receiver that contain the radio program's output or its command line."""

_SEVERITY = {"warning": 4, "error": 3, "critical": 2}
_PLAIN_KEYS = {"event", "level", "timestamp", "process"}


def warning_text(process: str, line: bytes) -> StatusText | None:
    """Convert a log line to a text for the operator; None if it is less than a warning."""
    try:
        event = json.loads(line)
        severity = _SEVERITY[event["level"]]
    except (ValueError, KeyError, TypeError):
        return None
    facts = {name: value for name, value in event.items() if name not in _PLAIN_KEYS}
    text = f"{process}: {in_words(str(event.get('event', '')), facts)}"
    return StatusText(severity=severity, text=text[:200])


class OutputLog:
    """Writes the lines that processes print to files.

    Lines that do not fit on the disk are dropped and counted.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._flight: FlightLayout | None = None
        self._logs: dict[Path, ProcessLog] = {}

    def open_flight(self, directory: Path) -> None:
        """From now on, write to files in the directory of this flight."""
        self._flight = FlightLayout(directory)

    def close_flight(self) -> None:
        """From now on, write to files in ``system_log/`` of the flights' directory."""
        self._flight = None
        self._logs.clear()

    @property
    def lost_lines(self) -> int:
        """Number of lines that could not be written since the files were opened."""
        return sum(log.lost_lines for log in self._logs.values())

    def write(self, process: str, line: bytes) -> None:
        """Write a line of a process to its file, with the present time."""
        path = self._path("radio" if any(e in line for e in RADIO_EVENTS) else process)
        log = self._logs.setdefault(path, ProcessLog(path))
        stamp = time.strftime("%Y-%m-%dT%H:%M:%SZ ", time.gmtime())
        log.write(stamp + line.decode("utf-8", "replace"))

    def _path(self, process: str) -> Path:
        if self._flight is None:
            return self._directory / "system_log" / f"{process}.log"
        return self._flight.process_log(process)


class ProcessLog:
    """Text log of a process that is rotated by size; lines that cannot be written are counted.

    At `max_bytes` the file is renamed, and `kept_files` older files are preserved. The
    directory of `path` is created if it is missing.
    """

    def __init__(
        self, path: Path, *, max_bytes: int = MAX_BYTES, kept_files: int = KEPT_FILES
    ) -> None:
        self._path = path
        self._max_bytes = max_bytes
        self._kept_files = kept_files
        self.lost_lines = 0
        """Number of log lines that could not be written."""

    def write(self, text: str) -> None:
        """Append a text; a newline is added if the text does not end with one."""
        content = text.encode("utf-8", "replace")
        if not content.endswith(b"\n"):
            content += b"\n"
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            if self._size() + len(content) > self._max_bytes and self._size() > 0:
                self._rotate()
            # Opened for each line: a rotated or deleted file is never written on unseen, and a
            # line every second costs nothing.
            with self._path.open("ab", buffering=0) as file:
                file.write(content)
        except OSError:
            self.lost_lines += content.count(b"\n")

    def _size(self) -> int:
        return self._path.stat().st_size if self._path.exists() else 0

    def _rotate(self) -> None:
        for number in range(self._kept_files, 0, -1):
            newer = self._numbered(number - 1) if number > 1 else self._path
            if newer.exists():
                newer.replace(self._numbered(number))

    def _numbered(self, number: int) -> Path:
        return self._path.with_name(f"{self._path.name}.{number}")
