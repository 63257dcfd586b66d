"""Record the order of flights in a file, so that it stays correct if the clock was wrong.

A flight's name contains the time of the clock, which may start in 1970 if it has no battery. By
name, the newest flight would then count as the oldest and be removed first. So a file in the
flights' folder lists each flight when it begins, one name per line. Unlisted flights count as
older than the list and are sorted by name. Copies are stored next to a flight: NAME_ground as
received by the page on the drone's own computer, NAME_drone as downloaded. A copy counts as
being as old as its flight.
"""

import itertools
import os
import re
from collections.abc import Callable, Iterable
from pathlib import Path

from uavrt.core.errors import FormatError
from uavrt.core.foreign import NOTES, read_file

FLIGHT_ORDER = "flights_in_order.txt"
FLIGHT_PREFIX = "flight_log_"
GROUND_COPY = "_ground"
FETCHED_COPY = "_drone"
_COPY = re.compile(rf"(.+?)(?:{GROUND_COPY}|{FETCHED_COPY})(?:_\d+)?", re.DOTALL)


def note_flight(flight: Path) -> None:
    """Add the name of a new flight to the list in its folder; raises `OSError` on failure."""
    path = flight.parent / FLIGHT_ORDER
    names = _noted(path)
    if names and names[-1] == flight.name:
        return  # it goes on, after a restart
    with open(path, "a", encoding="utf-8") as file:
        # A half-written line after a power cut then names no flight.
        file.write("\n" * _is_torn(path) + f"{flight.name}\n")
        file.flush()
        os.fsync(file.fileno())


def flown_name(name: str) -> str:
    """Name of the flight that a directory copies; the directory's own name if it is not a copy.

    >>> flown_name("flight_log_2026-05-01_08-15-00_ground_2")
    'flight_log_2026-05-01_08-15-00'
    """
    copy = _COPY.fullmatch(name)
    return copy[1] if copy else name


def new_copy_directory(flight: Path, is_taken: Callable[[Path], bool] = Path.exists) -> Path:
    """Unused directory name next to a flight for the copy that the web page creates."""
    path, number = flight.with_name(f"{flight.name}{GROUND_COPY}"), 2
    while is_taken(path):
        path = flight.with_name(f"{flight.name}{GROUND_COPY}_{number}")
        number += 1
    return path


def with_copies(flights: Iterable[Path]) -> list[list[Path]]:
    """Group flights with their copies; the flight itself is first in each group."""
    together: dict[str, list[Path]] = {}
    for flight in flights:
        together.setdefault(flown_name(flight.name), []).append(flight)
    return list(together.values())


def flights_in_order(directory: Path) -> list[Path]:
    """Directories of all flights in a directory, the oldest first."""
    found = {path.name: path for path in directory.glob(f"{FLIGHT_PREFIX}*") if path.is_dir()}
    return [found[name] for name in names_in_order(found, _noted(directory / FLIGHT_ORDER))]


def order_noted(directory: Path) -> dict[str, int]:
    """Position of each listed flight by its name; 0 is the oldest."""
    return {name: number for number, name in enumerate(_noted(directory / FLIGHT_ORDER))}


def flown_before(flight: Path) -> list[Path] | None:
    """Flights of the same folder flown before this one, oldest first; None if not listed."""
    name = flown_name(flight.name)
    if name not in order_noted(flight.parent):
        return None
    names_before = itertools.takewhile(
        lambda one: flown_name(one.name) != name, flights_in_order(flight.parent)
    )
    return list(names_before)


def names_in_order(names: Iterable[str], noted: Iterable[str]) -> list[str]:
    """Sort names of flights, oldest first, by `noted`, the names in the folder's list."""
    place = {name: number for number, name in enumerate(noted)}

    def key(name: str) -> tuple[int, str, str]:
        flown = flown_name(name)
        return place.get(name, place.get(flown, -1)), flown, name

    return sorted(names, key=key)


def _noted(path: Path) -> list[str]:
    try:
        return read_file(path, NOTES).decode("utf-8", "replace").splitlines()
    except (OSError, FormatError):
        return []


def _is_torn(path: Path) -> bool:
    try:
        with open(path, "rb") as file:
            file.seek(-1, os.SEEK_END)
            return file.read(1) != b"\n"
    except OSError:  # none yet, or empty
        return False
