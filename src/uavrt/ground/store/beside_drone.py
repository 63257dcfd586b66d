"""The drone side on the same computer, where the page has its flights.

Its directory is known by what the supervisor keeps there. What the page receives of a flight
is a copy of one that lies there already, and is named after it: so a star on either keeps both,
and the drone's disk guard removes both.
"""

from pathlib import Path

from uavrt.commands import SystemState
from uavrt.errors import FormatError
from uavrt.foreign import read_record
from uavrt.supervisor.mission.saved_state import LOCK_NAME, STATE_NAME, SavedState

_FLYING = (SystemState.DETECTING, SystemState.CAPTURING)


def is_the_drones(directory: Path) -> bool:
    """Whether the drone side of this computer makes its flights in this directory."""
    return (directory / LOCK_NAME).exists()


def flight_under_way(directory: Path) -> Path | None:
    """Get the flight that the drone side of this computer is at, if it is in this directory."""
    try:
        saved = read_record(directory / STATE_NAME, SavedState)
    except (OSError, FormatError):
        return None
    if saved.flight is None or saved.state not in _FLYING:
        return None
    flight = directory / Path(saved.flight.directory).name
    return flight if flight.is_dir() else None
