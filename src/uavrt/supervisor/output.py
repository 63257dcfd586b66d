"""Everything the children print is kept, each line with its time.

During a flight the files stand in the flight directory, in the thesis's layout: the radio
program's own words in ``airspy_csdr_netcat_log/``, the receiver's in ``channelizer_log/``, the
detectors' in ``detector_log/``. Otherwise they stand in ``system_log/`` beside the flights.
"""

import json
import time
from pathlib import Path
from typing import BinaryIO

from uavrt.log import get_logger
from uavrt.messages import StatusText

log = get_logger()

ROTATE_BYTES = 5_000_000
"""A file that has grown to this starts anew; the one before it is kept as ``.1``."""

_SEVERITY = {"warning": 4, "error": 3, "critical": 2}
"""Log level to MAVLink severity."""
_PLAIN_KEYS = {"event", "level", "timestamp", "process"}


def warning_text(process: str, line: bytes) -> StatusText | None:
    """Make an operator's text of a printed line, when it is a warning or worse."""
    try:
        event = json.loads(line)
        severity = _SEVERITY[event["level"]]
    except (ValueError, KeyError, TypeError):
        return None
    details = " ".join(f"{k}={v}" for k, v in event.items() if k not in _PLAIN_KEYS)
    return StatusText(
        severity=severity, text=f"{process}: {event.get('event', '')} {details}"[:200]
    )


class OutputLog:
    """Files for the lines that the processes print.

    A file that cannot be written (full disk) loses lines and counts them; it never stops a
    process.
    """

    def __init__(self, directory: Path) -> None:
        self._system = directory / "system_log"
        self._flight: Path | None = None
        self._files: dict[Path, BinaryIO] = {}
        self.lines_lost = 0

    def open_flight(self, directory: Path) -> None:
        """Write to a flight's directory from now on."""
        self.close()
        self._flight = directory

    def close_flight(self) -> None:
        """Write beside the flights again."""
        self.close()
        self._flight = None

    def write(self, process: str, line: bytes) -> None:
        """Keep a line with the time it was printed."""
        path = self._path(process, line)
        stamp = time.strftime("%Y-%m-%dT%H:%M:%SZ ", time.gmtime()).encode()
        try:
            self._open(path).write(stamp + line + b"\n")
        except OSError as error:
            if self.lines_lost == 0:
                log.error("process output cannot be kept", path=str(path), error=str(error))
            self.lines_lost += 1
            self._files.pop(path, None)

    def close(self) -> None:
        """Close all files."""
        for file in self._files.values():
            file.close()
        self._files.clear()

    def _path(self, process: str, line: bytes) -> Path:
        if self._flight is None:
            return self._system / f"{process}.log"
        if process == "receiver":
            if b'"event": "radio says"' in line:
                return self._flight / "airspy_csdr_netcat_log" / "radio.log"
            return self._flight / "channelizer_log" / "receiver.log"
        folder = "detector_log" if process.startswith("detector") else "process_log"
        return self._flight / folder / f"{process}.log"

    def _open(self, path: Path) -> BinaryIO:
        file = self._files.get(path)
        if file is not None and file.tell() > ROTATE_BYTES:
            file.close()
            path.replace(path.with_suffix(".log.1"))
            file = None
        if file is None:
            path.parent.mkdir(parents=True, exist_ok=True)
            # Unbuffered: a line must be on disk when the process that printed it dies.
            file = self._files[path] = path.open("ab", buffering=0)
        return file
