"""Keeps everything the children print, each line with its time.

During a flight the files are in the flight directory, in the thesis's layout
(`uavrt.recording.layout`), with the radio program's output apart from the receiver's. Otherwise
they are in ``system_log/`` in the flights' folder.
"""

import json
import time
from pathlib import Path

from uavrt.log import in_words
from uavrt.messages import StatusText
from uavrt.recording.layout import FlightLayout
from uavrt.recording.process_log import ProcessLog

RADIO_EVENTS = (b'"event": "radio says"', b'"event": "starting radio"')
"""Log events of the receiver for a line of the radio program, and for its command."""

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
    facts = {name: value for name, value in event.items() if name not in _PLAIN_KEYS}
    text = f"{process}: {in_words(str(event.get('event', '')), facts)}"
    return StatusText(severity=severity, text=text[:200])


class OutputLog:
    """Files for the lines that the processes print.

    A file that cannot be written (full disk) loses lines and counts them; it never stops a
    process.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._flight: FlightLayout | None = None
        self._logs: dict[Path, ProcessLog] = {}

    def open_flight(self, directory: Path) -> None:
        """Write to a flight's directory."""
        self._flight = FlightLayout(directory)

    def close_flight(self) -> None:
        """Write to the flights' folder again."""
        self._flight = None
        self._logs.clear()

    @property
    def lost_lines(self) -> int:
        """Lines that could not be written to the files now open."""
        return sum(log.lost_lines for log in self._logs.values())

    def write(self, process: str, line: bytes) -> None:
        """Write a line with the time it was printed."""
        path = self._path("radio" if any(e in line for e in RADIO_EVENTS) else process)
        log = self._logs.setdefault(path, ProcessLog(path))
        stamp = time.strftime("%Y-%m-%dT%H:%M:%SZ ", time.gmtime())
        log.write(stamp + line.decode("utf-8", "replace"))

    def _path(self, process: str) -> Path:
        if self._flight is None:
            return self._directory / "system_log" / f"{process}.log"
        return self._flight.process_log(process)
