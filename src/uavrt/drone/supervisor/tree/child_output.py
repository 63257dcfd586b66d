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
from uavrt.flight.logs.process_log import ProcessLog

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
    """Writes printed lines to files; those that do not fit on the disk are counted."""

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
