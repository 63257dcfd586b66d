"""Detect, by the supervisor's files, whether the drone side on this computer records flights in
the page's directory. The page's copy then has the drone's name, and stars and removal apply to
both.
"""

from pathlib import Path

from uavrt.core.commands import SystemState
from uavrt.core.errors import FormatError
from uavrt.core.foreign import read_record
from uavrt.drone.supervisor.mission.saved_state import LOCK_NAME, STATE_NAME, SavedState

_FLYING = (SystemState.DETECTING, SystemState.CAPTURING)


def is_drone_directory(directory: Path) -> bool:
    """True if the drone side of this computer records its flights in this directory."""
    return (directory / LOCK_NAME).exists()


def flight_under_way(directory: Path) -> Path | None:
    """Path of the flight that this computer's drone side records; None if there is none."""
    try:
        saved = read_record(directory / STATE_NAME, SavedState)
    except (OSError, FormatError):
        return None
    if saved.flight is None or saved.state not in _FLYING:
        return None
    flight = directory / Path(saved.flight.directory).name
    return flight if flight.is_dir() else None
