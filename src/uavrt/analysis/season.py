"""Compute statistics of a season: flights, minutes, effort for each animal, batteries.

They cover all flights in a folder. A flight that both ground station and drone recorded counts
once, as do its batteries.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from uavrt.analysis.inputs.flight_copies import (
    CopiesOfFlight,
    may_be_one_vehicle,
    without_copies,
)
from uavrt.core.errors import FormatError
from uavrt.core.messages import Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.flight.reading.outline import FlightOutline, read_outline

CHANGED_PERCENT = 10
"""Minimum rise of a battery's charge that indicates a changed battery [percentage points]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AnimalOfSeason:
    """Number of flights and effort for one animal in a season."""

    tag_id: int
    name: str | None
    frequency_hz: float
    flights: int
    flights_heard: int
    minutes: float
    minutes_to_hear: float | None
    """Mean time from the start of a flight to the animal's first received pulse [min]."""
    pulses: int
    last_heard_ns: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Season:
    """Statistics over all flights of a folder."""

    flights: int
    minutes: float
    first_ns: int | None
    last_ns: int | None
    animals_heard: int
    minutes_per_animal: float | None
    """Flight minutes per detected animal, with one detection counted per animal and flight;
    None if no animal was detected."""
    batteries: int
    """Number of batteries used, without flights counted in `flights_without_battery`."""
    batteries_used: float
    """Total battery charge used by all flights, as a number of full batteries."""
    flights_without_battery: int
    """Number of flights without battery data, because no ground station recorded them."""
    copies: int
    """Number of directories that contain a second copy of a flight."""
    unreadable: tuple[str, ...]
    animals: tuple[AnimalOfSeason, ...]


def read_season(directory: Path) -> Season:
    """Read and summarise all flights below a folder; raises `FormatError` if there are none."""
    outlines, unreadable = [], []
    for database in sorted(directory.rglob("flight.sqlite")):
        try:
            outlines.append(read_outline(database.parent))
        except FormatError:
            unreadable.append(str(database.parent.relative_to(directory)))
    if not outlines:
        raise FormatError(
            f"there is no readable flight in {directory} or its subfolders",
            remedy="Name the folder that contains flights",
        )
    flights = without_copies(outlines)
    minutes = sum(_minutes(one) for one in flights)
    hearings = sum(len(one[0].heard) for one in flights)
    batteries, used = _batteries(flights)
    return Season(
        flights=len(flights),
        minutes=minutes,
        first_ns=flights[0][0].info.start_time_ns,
        last_ns=flights[-1][0].info.start_time_ns,
        animals_heard=len({key for one in flights for key in _heard(one)}),
        minutes_per_animal=minutes / hearings if hearings else None,
        batteries=batteries,
        batteries_used=used,
        flights_without_battery=sum(
            not any(copy.battery_percent for copy in one) for one in flights
        ),
        copies=len(outlines) - len(flights),
        unreadable=tuple(unreadable),
        animals=_animals(flights),
    )


_Animal = tuple[int, int]
"""Tag id and frequency [kHz], which identify an animal, since ids are reused."""


def _minutes(flight: CopiesOfFlight) -> float:
    longest = max(one.end_time_ns - one.info.start_time_ns for one in flight)
    return longest / NANOSECONDS_PER_SECOND / 60.0


def _key(tag: Tag) -> _Animal:
    return tag.tag_id, round(tag.frequency_hz / 1e3)


def _heard(flight: CopiesOfFlight) -> list[_Animal]:
    return [_key(tag) for tag in flight[0].info.tags if tag.tag_id in flight[0].heard]


def _animals(flights: Sequence[CopiesOfFlight]) -> tuple[AnimalOfSeason, ...]:
    searched: dict[_Animal, list[tuple[Tag, CopiesOfFlight]]] = {}
    for flight in flights:
        for tag in flight[0].info.tags:
            searched.setdefault(_key(tag), []).append((tag, flight))
    return tuple(_animal(searched[key]) for key in sorted(searched))


def _animal(searched: Sequence[tuple[Tag, CopiesOfFlight]]) -> AnimalOfSeason:
    tag = searched[-1][0]
    heard = [flight[0] for _, flight in searched if tag.tag_id in flight[0].heard]
    firsts = ((one.heard[tag.tag_id].first_ns, one.info.start_time_ns) for one in heard)
    waited_s = sum(max(0, first - start) for first, start in firsts) / NANOSECONDS_PER_SECOND
    return AnimalOfSeason(
        tag_id=tag.tag_id,
        name=next((one.name for one, _ in reversed(searched) if one.name), None),
        frequency_hz=tag.frequency_hz,
        flights=len(searched),
        flights_heard=len(heard),
        minutes=sum(_minutes(flight) for _, flight in searched),
        minutes_to_hear=waited_s / len(heard) / 60.0 if heard else None,
        pulses=sum(one.heard[tag.tag_id].pulses for one in heard),
        last_heard_ns=max((one.heard[tag.tag_id].last_ns for one in heard), default=None),
    )


def _batteries(flights: Sequence[CopiesOfFlight]) -> tuple[int, float]:
    """Return the number of batteries and the charge used, over all vehicles; of several copies
    of a flight, the one with the most battery reports counts.
    """
    before: dict[str | None, int] = {}
    put_in, used = 0, 0.0
    for flight in flights:
        copy = max(flight, key=_discharges)
        known = [one for one in before if (one is None) == (copy.vehicle is None)]
        same = [one for one in known if may_be_one_vehicle(one, copy.vehicle)]
        last = before.pop(same[-1]) if same else None
        for percent in copy.battery_percent:
            put_in += last is None or percent >= last + CHANGED_PERCENT
            used += 0.0 if last is None else max(0, last - percent) / 100.0
            last = percent
        if last is not None:
            before[copy.vehicle] = last  # the one flown last comes last
    return put_in, used


def _discharges(copy: FlightOutline) -> tuple[int, int]:
    """Total drop of the charge [%] in a record's battery reports, and their number."""
    falls = (max(0, one - other) for one, other in pairwise(copy.battery_percent))
    return sum(falls), len(copy.battery_percent)
