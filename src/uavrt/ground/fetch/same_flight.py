"""Decide by the content whether a file from the drone may replace a local one, as equal names
are no evidence.

A log only grows, so a new one begins with all of the old one. A database keeps its pulses, so
the new one has the same flight and all pulses of the old one. A recording's description keeps
its time spans; their times are corrected at most once.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from uavrt.core.clock import parse_iso_utc
from uavrt.core.foreign import NOTES, read_file, read_json
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.flight.database.plain_database import open_plain

CHUNK = 1 << 20
OTHER_SUFFIX = ".other-"
MOST_RECORDS = 100
_CORRECTED_S = 2.0
"""Largest correction of a recorded span's start time once the drone's clock is set [s]."""

_FLIGHT = "SELECT start_time_ns, clock_offset_ns, center_frequency_hz FROM {}.flight"
_LACKING = (
    "SELECT count(*) FROM (SELECT tag_id, start_time_ns FROM here.pulses "
    "EXCEPT SELECT tag_id, start_time_ns FROM main.pulses)"
)


def place_for(new: Path, place: Path) -> Path:
    """Path at which to store a new file: `place`, or a new name if another flight has it."""
    if not place.exists() and not place.is_symlink():
        return place
    if place.is_file():
        later = same_recording if place.suffix == ".sigmf-meta" else same_database
        if begins_with(new, place) or later(new, place):
            return place
    for number in range(1, MOST_RECORDS):
        other = place.with_name(f"{place.name}{OTHER_SUFFIX}{number}")
        if not other.exists():
            return other
    return other


def others(place: Path) -> list[Path]:
    """List a local file's copies that come from other flights: ``NAME.other-1`` etc."""
    return [p for p in place.parent.glob("*") if p.name.startswith(place.name + OTHER_SUFFIX)]


def begins_with(new: Path, old: Path) -> bool:
    """True if a file begins with the whole content of another."""
    with new.open("rb") as longer, old.open("rb") as shorter:
        while part := shorter.read(CHUNK):
            if longer.read(len(part)) != part:
                return False
    return True


def same_database(new: Path, old: Path) -> bool:
    """True if a flight's database is a later state of the other database."""
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


def same_recording(new: Path, old: Path) -> bool:
    """True if one SigMF description of a recording is a later state of the other."""
    try:
        formats, stretches = zip(*(_described(path) for path in (new, old)), strict=True)
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return False
    later, before = stretches
    # The last may have got no samples, as on a full disk: another takes its place.
    sure = before[:-1] or before
    return (
        formats[0] == formats[1]
        and len(sure) <= len(later)
        and all(
            one[:-1] == other[:-1]
            and abs(one[-1] - other[-1]) <= _CORRECTED_S * NANOSECONDS_PER_SECOND
            for one, other in zip(later, sure, strict=False)
        )
    )


def _described(path: Path) -> tuple[tuple[Any, ...], list[tuple[Any, Any, int]]]:
    """Kind of a recording, and first sample, frequency and time [ns] of each of its spans."""
    described = read_json(read_file(path, NOTES), NOTES)
    about = described["global"]
    kind = (about["core:datatype"], about["core:sample_rate"], about.get("core:description"))
    return kind, [
        (
            one["core:sample_start"],
            one.get("core:frequency"),
            parse_iso_utc(one["core:datetime"]),
        )
        for one in described["captures"]
    ]


@contextmanager
def _both(new: Path, old: Path) -> Iterator[sqlite3.Connection]:
    with closing(open_plain(old)):  # refuses what is no plain database
        pass
    with closing(open_plain(new)) as database:
        database.execute("ATTACH ? AS here", (f"{old.absolute().as_uri()}?mode=ro",))
        yield database
