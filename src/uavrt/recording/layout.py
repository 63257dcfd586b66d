"""Where things lie in a flight directory: the thesis's layout, and a database beside it.

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
from uavrt.errors import RecordingError

Stamp: TypeAlias = tuple[int, int]
"""Size of a flight's database and its log, and when they were last changed [ns since 1970]."""
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
        """What SQLite has committed and not yet folded into the database."""
        return self.root / "flight.sqlite-wal"

    @property
    def star(self) -> Path:
        """A file, empty perhaps, that keeps the flight from being removed."""
        return self.root / "starred"

    @property
    def pulse_pose_log(self) -> Path:
        """All pulses with poses as text."""
        return self.root / "pulse_pose_log.txt"

    @property
    def iq_directory(self) -> Path:
        """Where samples are recorded."""
        return self.root / "iq"

    @property
    def channels_directory(self) -> Path:
        """Where the samples of the tags' channels are kept."""
        return self.iq_directory / "channels"

    @property
    def integrated_directory(self) -> Path:
        """What was found in hindsight, over the whole flight."""
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
        """Where the output of a process goes."""
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
        """Make the directories.

        Raises `RecordingError`: the disk is full, read-only, or forbidden.
        """
        directories = [self.root / "airspy_csdr_netcat_log", self.root / "channelizer_log"]
        directories.append(self.root / "process_log")
        for tag_id in tag_ids:
            directories.append(self.tag_config(tag_id).parent)
            directories.append(self.tag_pulse_pose_log(tag_id).parent)
        try:
            for directory in directories:
                directory.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordingError(
                f"cannot make the flight directory {self.root}: {error.strerror}",
                remedy="Free space, or set [recording] directory to a writable place",
            ) from error


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
    """Refuse at once what would fail at the first flight; the directory is made if need be.

    Raises `RecordingError`: nothing can be written there.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        probe = directory / ".writable"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise RecordingError(
            f"flights cannot be saved in {directory}: {error.strerror}",
            remedy="Set recording.directory, or --flight-dir, to a writable place",
        ) from error


def stamp_of(flight: str) -> Stamp:
    """When and how large the database of a flight's directory and its log were last.

    Paths are text: thousands of flights are looked at each time the list is shown.
    """
    size, changed = 0, 0
    for path in (f"{flight}/flight.sqlite", f"{flight}/flight.sqlite-wal"):
        try:
            stat = os.stat(path)
        except OSError:
            continue
        if stat.st_size:  # to read a database leaves an empty log beside it
            size, changed = size + stat.st_size, max(changed, stat.st_mtime_ns)
    return size, changed
