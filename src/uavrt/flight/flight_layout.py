"""Define the paths of all files of a flight: the thesis's layout (§4.5) and a database.

docs/reference/flight-directory.md lists all files. ``flight.sqlite`` contains all records.
"""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from uavrt.config.radios import RADIOS
from uavrt.core.clock import flight_stamp
from uavrt.core.errors import RecordingError, os_errors_as

Stamp: TypeAlias = tuple[int, int]
"""Size and modification time [ns since 1970] of a flight's database and its write-ahead log."""
_RADIO_PROCESSES = {"radio", *(row.receive for row in RADIOS.values())}


@dataclass(frozen=True, slots=True)
class FlightLayout:
    """Paths of the files inside one flight directory."""

    root: Path

    @property
    def database(self) -> Path:
        """SQLite database of the flight."""
        return self.root / "flight.sqlite"

    @property
    def write_ahead_log(self) -> Path:
        """Log of committed records that SQLite has not yet copied into the database file."""
        return self.root / "flight.sqlite-wal"

    @property
    def star(self) -> Path:
        """File that marks the flight as protected from removal; may be empty."""
        return self.root / "starred"

    @property
    def pulse_pose_log(self) -> Path:
        """Text log of all pulses with poses."""
        return self.root / "pulse_pose_log.txt"

    @property
    def iq_directory(self) -> Path:
        """Directory of recorded samples of the whole band."""
        return self.root / "iq"

    @property
    def channels_directory(self) -> Path:
        """Directory of recorded samples of the tags' channels."""
        return self.iq_directory / "channels"

    @property
    def integrated_directory(self) -> Path:
        """Directory of the results of ``uavrt integrate``."""
        return self.root / "integrated"

    def tag_directory(self, tag_id: int) -> Path:
        """Directory of one tag's files."""
        return self.root / "detector_log" / f"tag_id_{tag_id}"

    def tag_config(self, tag_id: int) -> Path:
        """File ``detectorConfig.txt`` of one tag."""
        return self.tag_directory(tag_id) / "config" / "detectorConfig.txt"

    def tag_pulse_pose_log(self, tag_id: int) -> Path:
        """File ``pulse_pose_log.txt`` of one tag."""
        return self.tag_directory(tag_id) / "output" / "pulse_pose_log.txt"

    def process_log(self, process: str) -> Path:
        """Log file of a process's output."""
        name = re.sub(r"[^\w.-]", "_", process).strip(".") or "unnamed"
        if process in _RADIO_PROCESSES:
            directory = "airspy_csdr_netcat_log"
        elif process.startswith(("receiver", "channelizer")):
            directory = "channelizer_log"
        elif process.startswith("detector"):
            directory = "detector_log"
        else:
            directory = "process_log"
        return self.root / directory / f"{name}.log"

    def make(self, tag_ids: list[int]) -> None:
        """Create all directories of the flight; raises `RecordingError` if the disk is full."""
        directories = [self.root / "airspy_csdr_netcat_log", self.root / "channelizer_log"]
        directories.append(self.root / "process_log")
        for tag_id in tag_ids:
            directories.append(self.tag_config(tag_id).parent)
            directories.append(self.tag_pulse_pose_log(tag_id).parent)
        with os_errors_as(
            RecordingError,
            f"cannot make the flight directory {self.root}",
            "Free space, or set [recording] directory to a writable path",
        ):
            for directory in directories:
                directory.mkdir(parents=True, exist_ok=True)


def new_flight_directory(
    directory: Path, start_time_ns: int, is_taken: Callable[[Path], bool] = Path.exists
) -> Path:
    """Unused path for a new flight: ``flight_log_<UTC>``, with ``_2``, ``_3`` … if taken."""
    path = directory / f"flight_log_{flight_stamp(start_time_ns)}"
    number = 2
    while is_taken(path):
        path = directory / f"flight_log_{flight_stamp(start_time_ns)}_{number}"
        number += 1
    return path


def require_writable(directory: Path) -> None:
    """Create a directory for flights; raises `RecordingError` if it cannot be written to."""
    with os_errors_as(
        RecordingError,
        f"flights cannot be saved in {directory}",
        "Set recording.directory, or --flight-dir, to a writable path",
    ):
        directory.mkdir(parents=True, exist_ok=True)
        probe = directory / ".writable"
        probe.touch()
        probe.unlink()


def stamp_of(flight: str) -> Stamp:
    """Size and modification time of a flight's database and its write-ahead log.

    `flight` is a text because a `Path` would be slower: each display of the list checks
    thousands.
    """
    size, changed = 0, 0
    for path in (f"{flight}/flight.sqlite", f"{flight}/flight.sqlite-wal"):
        try:
            stat = os.stat(path)
        except OSError:
            continue
        if stat.st_size:  # reading a database leaves an empty log
            size, changed = size + stat.st_size, max(changed, stat.st_mtime_ns)
    return size, changed
