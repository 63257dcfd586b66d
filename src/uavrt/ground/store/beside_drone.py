"""Detect a drone side on this computer whose flights are in the page's directory.

The supervisor's files identify the directory. The page's copy of a flight is named after the
drone's recording, so that a star on either keeps both and the drone's disk guard removes both.
"""

from pathlib import Path

from uavrt.commands import SystemState
from uavrt.errors import FormatError
from uavrt.foreign import read_record
from uavrt.supervisor.mission.saved_state import LOCK_NAME, STATE_NAME, SavedState

_FLYING = (SystemState.DETECTING, SystemState.CAPTURING)


def is_the_drones(directory: Path) -> bool:
    """True if the drone side of this computer records its flights in this directory."""
    return (directory / LOCK_NAME).exists()


def flight_under_way(directory: Path) -> Path | None:
    """Get the flight that this computer's drone side is recording in this directory."""
    try:
        saved = read_record(directory / STATE_NAME, SavedState)
    except (OSError, FormatError):
        return None
    if saved.flight is None or saved.state not in _FLYING:
        return None
    flight = directory / Path(saved.flight.directory).name
    return flight if flight.is_dir() else None
