"""The order in which flights were flown, also where the clock was wrong.

A flight is named after the clock, and a computer without a battery for its clock may begin in
1970: its newest flight would be taken for the oldest, and removed first. So each flight is
noted in a file beside them as it begins, one name a line. Flights that are not noted are older
than the file; among them the names decide.
"""

import os
from collections.abc import Iterable
from pathlib import Path

FLIGHT_ORDER = "flights_in_order.txt"
FLIGHT_PREFIX = "flight_log_"


def note_flight(flight: Path) -> None:
    """Note that a flight begins now.

    Raises
    ------
    OSError
        The disk cannot be written; to be tried again, nothing else need stop.
    """
    path = flight.parent / FLIGHT_ORDER
    names = _noted(path)
    if names and names[-1] == flight.name:
        return  # it goes on, after a restart
    with open(path, "a", encoding="utf-8") as file:
        # What a power cut left half-written becomes a name that no flight has.
        file.write("\n" * _is_torn(path) + f"{flight.name}\n")
        file.flush()
        os.fsync(file.fileno())


def flights_in_order(directory: Path) -> list[Path]:
    """List the flights below a directory, the oldest first."""
    found = {path.name: path for path in directory.glob(f"{FLIGHT_PREFIX}*") if path.is_dir()}
    return [found[name] for name in names_in_order(found, _noted(directory / FLIGHT_ORDER))]


def flown_before(flight: Path) -> list[Path] | None:
    """List the flights beside one that were flown before it, the oldest first.

    None where nobody has noted when it was flown: then there is only its clock to go by.
    """
    if flight.name not in _noted(flight.parent / FLIGHT_ORDER):
        return None
    flights = flights_in_order(flight.parent)
    return flights[: [path.name for path in flights].index(flight.name)]


def names_in_order(names: Iterable[str], noted: Iterable[str]) -> list[str]:
    """Sort the names of flights, the oldest first, by what is noted of their order."""
    place = {name: number for number, name in enumerate(noted)}
    return sorted(names, key=lambda name: (place.get(name, -1), name))


def _noted(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []


def _is_torn(path: Path) -> bool:
    try:
        with open(path, "rb") as file:
            file.seek(-1, os.SEEK_END)
            return file.read(1) != b"\n"
    except OSError:  # none yet, or empty
        return False
