"""What is known of each flight on this computer, kept over a restart.

To read thousands of databases takes seconds; this file can be thrown away at any time.
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
    """``"ground"`` when this ground station recorded it, ``"drone"`` when it was copied."""
    starred: bool = False
    """It is never removed from the computer that it is on."""
    vehicle: str | None = None
    """Number and name of its vehicle, where the ground station wrote them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightChoice:
    """Which flights are wanted."""

    tag_id: int | None = None
    """Those that listened for this tag."""
    since_ns: int | None = None
    """Those that ended at or after this time [ns since 1970]."""
    before_ns: int | None = None
    """Those that began before this time [ns since 1970]."""

    def holds(self, flight: FlightSummary) -> bool:
        """Return whether a flight is one of them."""
        return (
            (self.since_ns is None or flight.end_time_ns >= self.since_ns)
            and (self.before_ns is None or flight.start_time_ns < self.before_ns)
            and (self.tag_id is None or any(tag.tag_id == self.tag_id for tag in flight.tags))
        )


class _Kept(msgspec.Struct, frozen=True):
    version: int
    flights: list[tuple[Stamp, FlightSummary]]


class KnownFlights:
    """Summaries with the state of the files that they are of."""

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
        """Get what is known of a flight; None unless it is of its files as they are."""
        found = self._flights.get(flight_id)
        return found[1] if found is not None and found[0] == stamp else None

    def put(self, summary: FlightSummary, stamp: Stamp) -> None:
        """Know a flight."""
        self._flights[summary.flight_id] = (stamp, summary)
        self._changed = True

    def write(self, flight_ids: set[str]) -> None:
        """Keep what is known of these flights, if it has changed, and forget others."""
        gone = self._flights.keys() - flight_ids
        if not self._changed and not gone:
            return
        for flight_id in gone:
            self._flights.pop(flight_id, None)
        self._changed = False
        content = msgspec.json.encode(_Kept(_VERSION, list(self._flights.values())))
        write_atomically(self._path, content, sync=False)
