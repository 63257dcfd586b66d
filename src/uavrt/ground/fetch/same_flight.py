"""Decide whether a file from the drone may replace a local one.

Names prove nothing: a simulated flight has the name of its second, a drone's clock may be
wrong, and who answers may be somebody else. Two things do: a log only grows, so the new one
begins with all of the old one; and a flight's database keeps its pulses, so the new one has the
same flight and all pulses of the old one.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from uavrt.recording import open_plain

CHUNK = 1 << 20
OTHER_SUFFIX = ".other-"
MOST_OTHERS = 100

_FLIGHT = "SELECT start_time_ns, clock_offset_ns, center_frequency_hz FROM {}.flight"
_LACKING = (
    "SELECT count(*) FROM (SELECT tag_id, start_time_ns FROM here.pulses "
    "EXCEPT SELECT tag_id, start_time_ns FROM main.pulses)"
)


def place_for(new: Path, place: Path) -> Path:
    """Get where a new file goes: to its place, or beside what is there and is another."""
    if not place.exists() and not place.is_symlink():
        return place
    if place.is_file() and (begins_with(new, place) or same_database(new, place)):
        return place
    for number in range(1, MOST_OTHERS):
        other = place.with_name(f"{place.name}{OTHER_SUFFIX}{number}")
        if not other.exists():
            return other
    return other


def others(place: Path) -> list[Path]:
    """Get the files that came by the same name and were put beside."""
    return [p for p in place.parent.glob("*") if p.name.startswith(place.name + OTHER_SUFFIX)]


def begins_with(new: Path, old: Path) -> bool:
    """Whether a file begins with the whole content of another."""
    with new.open("rb") as longer, old.open("rb") as shorter:
        while part := shorter.read(CHUNK):
            if longer.read(len(part)) != part:
                return False
    return True


def same_database(new: Path, old: Path) -> bool:
    """Whether a flight's database is a later state of another."""
    try:
        with _both(new, old) as database:
            flights = [database.execute(_FLIGHT.format(n)).fetchone() for n in ("main", "here")]
            return (
                flights[0] is not None
                and flights[0] == flights[1]
                and database.execute(_LACKING).fetchone() == (0,)
            )
    except (sqlite3.Error, ValueError, TypeError):
        return False


@contextmanager
def _both(new: Path, old: Path) -> Iterator[sqlite3.Connection]:
    with closing(open_plain(old)):  # refuses what is no plain database
        pass
    with closing(open_plain(new)) as database:
        database.execute("ATTACH ? AS here", (f"{old.absolute().as_uri()}?mode=ro",))
        yield database
