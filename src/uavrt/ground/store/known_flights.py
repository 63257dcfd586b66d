"""Cache of flight summaries, kept over a restart.

Reading thousands of databases takes seconds; this file can be deleted at any time.
"""

from dataclasses import dataclass
from pathlib import Path

import msgspec

from uavrt.atomic_file import write_atomically
from uavrt.errors import FormatError
from uavrt.foreign import read_record
from uavrt.messages import Tag
from uavrt.recording.layout import Stamp

_VERSION = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightSummary:
    """One line of the list of flights."""

    flight_id: str
    start_time_ns: int
    end_time_ns: int
    pulses: int
    tags: tuple[Tag, ...]
    source: str
    """``"ground"`` if this ground station recorded it, ``"drone"`` if it was copied."""
    starred: bool = False
    """True if it is never removed automatically from its computer."""
    vehicle: str | None = None
    """Number and name of its vehicle, if the ground station recorded them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightChoice:
    """Criteria by which flights are listed."""

    tag_id: int | None = None
    """Flights that searched for this tag."""
    since_ns: int | None = None
    """Flights that ended at or after this time [ns since 1970]."""
    before_ns: int | None = None
    """Flights that began before this time [ns since 1970]."""

    def holds(self, flight: FlightSummary) -> bool:
        """True if a flight meets all criteria."""
        return (
            (self.since_ns is None or flight.end_time_ns >= self.since_ns)
            and (self.before_ns is None or flight.start_time_ns < self.before_ns)
            and (self.tag_id is None or any(tag.tag_id == self.tag_id for tag in flight.tags))
        )


class _Kept(msgspec.Struct, frozen=True):
    version: int
    flights: list[tuple[Stamp, FlightSummary]]


class KnownFlights:
    """Summaries, each with the state of its flight's files when it was made."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._flights: dict[str, tuple[Stamp, FlightSummary]] = {}
        self._changed = False
        try:
            kept = read_record(path, _Kept)
        except (OSError, FormatError):
            return
        if kept.version == _VERSION:
            self._flights = {one[1].flight_id: one for one in kept.flights}

    def get(self, flight_id: str, stamp: Stamp) -> FlightSummary | None:
        """Get the cached summary of a flight; None if its files have changed."""
        found = self._flights.get(flight_id)
        return found[1] if found is not None and found[0] == stamp else None

    def put(self, summary: FlightSummary, stamp: Stamp) -> None:
        """Store the summary of a flight."""
        self._flights[summary.flight_id] = (stamp, summary)
        self._changed = True

    def write(self, flight_ids: set[str]) -> None:
        """Write the summaries of these flights if any has changed; drop all others."""
        gone = self._flights.keys() - flight_ids
        if not self._changed and not gone:
            return
        for flight_id in gone:
            self._flights.pop(flight_id, None)
        self._changed = False
        content = msgspec.json.encode(_Kept(_VERSION, list(self._flights.values())))
        write_atomically(self._path, content, sync=False)
