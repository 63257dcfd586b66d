"""Where things lie in a flight directory: the thesis's layout, and a database.

::

    flight_log_2026-05-01_08-15-00/           UTC
    ├── flight.sqlite                         everything; the single source of truth
    ├── starred                               if it is there, the flight is never removed
    ├── pulse_pose_log.txt                    all pulses with poses, the thesis's 23 columns
    ├── airspy_csdr_netcat_log/               what the radio's program said
    ├── channelizer_log/                      what the receiver said
    ├── detector_log/
    │   ├── detector_1.log                    what each detector process said
    │   └── tag_id_2/
    │       ├── config/detectorConfig.txt     the tag as the original detector reads it
    │       └── output/pulse_pose_log.txt     this tag's pulses
    ├── process_log/                          what the other processes said
    ├── integrated/                           what ``uavrt integrate`` found in hindsight
    └── iq/                                   SigMF recordings, when asked for

As in the thesis, §4.5.
"""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from uavrt.clock import flight_stamp
from uavrt.config.radios import RADIOS
from uavrt.errors import RecordingError, os_errors_as

Stamp: TypeAlias = tuple[int, int]
"""Size and last change [ns since 1970] of a flight's database and its log."""
_RADIO_PROCESSES = {"radio", *(row.receive for row in RADIOS.values())}


@dataclass(frozen=True, slots=True)
class FlightLayout:
    """Paths inside one flight directory."""

    root: Path

    @property
    def database(self) -> Path:
        """The flight's database."""
        return self.root / "flight.sqlite"

    @property
    def write_ahead_log(self) -> Path:
        """Committed records that SQLite has not yet folded into the database."""
        return self.root / "flight.sqlite-wal"

    @property
    def star(self) -> Path:
        """A file that keeps the flight from being removed; may be empty."""
        return self.root / "starred"

    @property
    def pulse_pose_log(self) -> Path:
        """All pulses with poses as text."""
        return self.root / "pulse_pose_log.txt"

    @property
    def iq_directory(self) -> Path:
        """Directory of recorded samples."""
        return self.root / "iq"

    @property
    def channels_directory(self) -> Path:
        """Directory of the samples of the tags' channels."""
        return self.iq_directory / "channels"

    @property
    def integrated_directory(self) -> Path:
        """Results of ``uavrt integrate``."""
        return self.root / "integrated"

    def tag_directory(self, tag_id: int) -> Path:
        """Directory of one tag."""
        return self.root / "detector_log" / f"tag_id_{tag_id}"

    def tag_config(self, tag_id: int) -> Path:
        """The tag's ``detectorConfig.txt``."""
        return self.tag_directory(tag_id) / "config" / "detectorConfig.txt"

    def tag_pulse_pose_log(self, tag_id: int) -> Path:
        """The tag's own ``pulse_pose_log.txt``."""
        return self.tag_directory(tag_id) / "output" / "pulse_pose_log.txt"

    def process_log(self, process: str) -> Path:
        """Output of a process."""
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
        """Make the directories; raises `RecordingError` if the disk is full or not writable."""
        directories = [self.root / "airspy_csdr_netcat_log", self.root / "channelizer_log"]
        directories.append(self.root / "process_log")
        for tag_id in tag_ids:
            directories.append(self.tag_config(tag_id).parent)
            directories.append(self.tag_pulse_pose_log(tag_id).parent)
        with os_errors_as(
            RecordingError,
            f"cannot make the flight directory {self.root}",
            "Free space, or set [recording] directory to a writable place",
        ):
            for directory in directories:
                directory.mkdir(parents=True, exist_ok=True)


def new_flight_directory(
    directory: Path, start_time_ns: int, is_taken: Callable[[Path], bool] = Path.exists
) -> Path:
    """Name a flight directory that does not exist yet: ``flight_log_<UTC>``.

    Two flights of the same second (or after the clock was set back) get ``_2``, ``_3`` …
    """
    path = directory / f"flight_log_{flight_stamp(start_time_ns)}"
    number = 2
    while is_taken(path):
        path = directory / f"flight_log_{flight_stamp(start_time_ns)}_{number}"
        number += 1
    return path


def require_writable(directory: Path) -> None:
    """Make a directory for flights, or raise `RecordingError` if it cannot be written."""
    with os_errors_as(
        RecordingError,
        f"flights cannot be saved in {directory}",
        "Set recording.directory, or --flight-dir, to a writable place",
    ):
        directory.mkdir(parents=True, exist_ok=True)
        probe = directory / ".writable"
        probe.touch()
        probe.unlink()


def stamp_of(flight: str) -> Stamp:
    """Size and last change of a flight's database and its log.

    Paths are text because each display of the list checks thousands of flights.
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
