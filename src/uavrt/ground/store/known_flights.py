"""Cache of flight summaries on the disk, since reading thousands of databases takes seconds.

The cache file can be deleted at any time.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import msgspec

from uavrt.core.atomic_file import write_atomically
from uavrt.core.errors import FormatError
from uavrt.core.foreign import read_record
from uavrt.core.messages import Tag
from uavrt.flight.flight_layout import Stamp

_VERSION = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightSummary:
    """Summary of a flight, one line in the list of flights."""

    flight_id: str
    start_time_ns: int
    end_time_ns: int
    pulses: int
    tags: tuple[Tag, ...]
    source: str
    """``"ground"``: recorded by this ground station; ``"drone"``: copied from a drone."""
    starred: bool = False
    """True for a flight that is never removed automatically."""
    vehicle: str | None = None
    """Number and name of the vehicle; None unless the ground station recorded the flight."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightChoice:
    """Criteria that select flights for a list."""

    tag_id: int | None = None
    """Only flights that searched for this tag; None: all."""
    since_ns: int | None = None
    """Only flights that ended at or after this time [ns since 1970]; None: all."""
    before_ns: int | None = None
    """Only flights that began before this time [ns since 1970]; None: all."""

    def holds(self, flight: FlightSummary) -> bool:
        """True if a flight meets all criteria of the choice."""
        return (
            (self.since_ns is None or flight.end_time_ns >= self.since_ns)
            and (self.before_ns is None or flight.start_time_ns < self.before_ns)
            and (self.tag_id is None or any(tag.tag_id == self.tag_id for tag in flight.tags))
        )


class _Kept(msgspec.Struct, frozen=True):
    version: int
    flights: list[tuple[Stamp, FlightSummary]]


def kept_flights(path: Path) -> dict[str, tuple[Stamp, FlightSummary]]:
    """Read the cached summaries from a file, by flight directory."""
    try:
        kept = read_record(path, _Kept)
    except (OSError, FormatError):
        return {}
    flights = kept.flights if kept.version == _VERSION else []
    return {f"{path.parent}/{one[1].flight_id}": one for one in flights}


def keep_flights(path: Path, flights: Iterable[tuple[Stamp, FlightSummary]]) -> None:
    """Write the cache of summaries; raises `OSError`."""
    content = msgspec.json.encode(_Kept(_VERSION, list(flights)))
    write_atomically(path, content, sync=False)
