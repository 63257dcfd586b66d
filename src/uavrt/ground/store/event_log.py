"""The operator's log: status texts, acknowledgements and messages of the ground station."""

import json
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec

from uavrt.core.errors import FormatError
from uavrt.core.foreign import decode_record, size_of
from uavrt.core.runtime.disk_thread import Disk, DiskBatches, at_once

LINES = 1000
"""Maximum number of log lines kept in memory and sent to a page; the file holds all lines."""
LOG_TAIL_BYTES = 400_000
"""Bytes read from the end of the log file when the ground station starts."""
MAX_TEXT = 400


class _Line(msgspec.Struct, frozen=True):
    """One line of the log file; used to check lines, so that invalid ones are not shown."""

    time_ns: int
    severity: int
    text: str
    source: str


class EventLog:
    """Log lines, kept in memory and in a file of JSON lines; lines of earlier runs are read."""

    def __init__(self, path: Path, disk: Disk = at_once) -> None:
        self._path = path
        self._unwritten: DiskBatches[str, None] = DiskBatches(disk, self._write)
        self._lines: deque[dict[str, Any]] = deque(maxlen=LINES)
        self._number = 0
        self._read()

    def add(self, time_ns: int, severity: int, text: str, source: str) -> dict[str, Any]:
        """Add and return a line with a MAVLink severity and a source, cut at 400 characters."""
        self._number += 1
        line = {
            "number": self._number,
            "time_ns": time_ns,
            "severity": severity,
            "text": text[:MAX_TEXT],
            "source": source,
        }
        self._lines.append(line)
        if len(self._unwritten.waiting) < LINES:
            self._unwritten.add(json.dumps(line) + "\n")
        return line

    def _write(self, lines: list[str]) -> None:
        # A disk that is full or hangs shows in the flight's fault; lines are on the screen.
        with suppress(OSError), self._path.open("a", encoding="utf-8") as file:
            file.write("".join(lines))

    def lines(self) -> list[dict[str, Any]]:
        """Return the last log lines, oldest first."""
        return list(self._lines)

    def _read(self) -> None:
        try:
            size_of(self._path)
            with self._path.open("rb") as file:
                size = file.seek(0, 2)
                file.seek(max(0, size - LOG_TAIL_BYTES))
                data = file.read()
        except (OSError, FormatError):
            return
        for text in data.decode("utf-8", "replace").splitlines():
            try:
                line = decode_record(text, _Line)
            except FormatError:
                continue  # the first line is cut by the tail, the last by a power cut
            self._number += 1
            self._lines.append(msgspec.to_builtins(line) | {"number": self._number})
