"""A season in numbers: flights, minutes, what each animal took, batteries.

Made of the flights in a folder. A flight that lies there twice, as the ground station received
it and as the drone recorded it, counts once, as do the batteries that it flew with.
"""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from uavrt.errors import FormatError
from uavrt.messages import Tag
from uavrt.recording import FlightOutline, read_outline, read_pulse_levels
from uavrt.units import NANOSECONDS_PER_SECOND

SAME_PULSES = 0.5
"""Share of the pulses of the shorter copy that the other has, too: the ground station may have
come late."""
_SAME_NS = 500_000
"""A start that came over the link keeps no nanoseconds."""
SAME_LEVEL_DB = 0.1
"""Of a pulse in two copies of a flight, at most; two drones differ by some 5 dB."""
SAME_SPAN = 0.9
"""Of two flights without pulses, of the longer: they are the same, if they can be."""
CHANGED_PERCENT = 10
"""A battery that holds so much more than before is another one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AnimalOfSeason:
    """What one animal took."""

    tag_id: int
    name: str | None
    frequency_hz: float
    flights: int
    """In which it was searched for."""
    flights_heard: int
    minutes: float
    """Of these flights."""
    minutes_to_hear: float | None
    """From the start to its first pulse, mean of the flights that heard it."""
    pulses: int
    last_heard_ns: int | None
    """Start of the last flight that heard it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Season:
    """A folder of flights in numbers."""

    flights: int
    minutes: float
    first_ns: int | None
    last_ns: int | None
    animals_heard: int
    minutes_per_animal: float | None
    """Minutes of flight for each time that a flight heard an animal; None: none was heard."""
    batteries: int
    """That were put in, of flights that tell; see `flights_without_battery`."""
    batteries_used: float
    """What was taken out of them, in full ones."""
    flights_without_battery: int
    """Nobody noted what was left: flights without a ground station."""
    copies: int
    """Directories that are a second copy of a flight."""
    unreadable: tuple[str, ...]
    """Names of directories that hold no readable flight."""
    animals: tuple[AnimalOfSeason, ...]


def read_season(directory: Path) -> Season:
    """Summarize the flights below a folder, at any depth.

    Raises
    ------
    FormatError
        There is no flight.
    """
    outlines, unreadable = [], []
    for database in sorted(directory.rglob("flight.sqlite")):
        try:
            outlines.append(read_outline(database.parent))
        except FormatError:
            unreadable.append(str(database.parent.relative_to(directory)))
    if not outlines:
        raise FormatError(
            f"there is no flight that can be read below {directory}",
            remedy="Name the folder that holds them",
        )
    flights = without_copies(sorted(outlines, key=lambda one: one.info.start_time_ns))
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


_Flight = tuple[FlightOutline, ...]
"""A flight's copies, the one with the most pulses first."""
_Animal = tuple[int, int]
"""Id and frequency [kHz]: numbers are given again to other animals."""


def without_copies(outlines: Sequence[FlightOutline]) -> list[_Flight]:
    """Put copies of one flight together, in the order in which they were noted."""
    flights: list[list[FlightOutline]] = []
    for one in outlines:
        for flight in reversed(flights):
            if _is_same(flight[0], one) and not any(_are_two(each, one) for each in flight):
                flight.append(one)
                break
        else:
            flights.append([one])
    return [tuple(sorted(one, key=lambda one: one.pulses, reverse=True)) for one in flights]


def _is_same(one: FlightOutline, other: FlightOutline) -> bool:
    """Whether two are copies of one flight: by their pulses, else by their times."""
    begin = max(one.info.start_time_ns, other.info.start_time_ns)
    overlap = min(one.end_time_ns, other.end_time_ns) - begin
    if overlap < 0 or not _may_be_one_vehicle(one.vehicle, other.vehicle):
        return False
    if one.pulses and other.pulses:
        try:
            levels = [read_pulse_levels(each.directory) for each in (one, other)]
        except FormatError:  # damaged: nobody can say
            return False
        common = _common(*levels)
        # Drones side by side hear the same pulses, each as strong as at its own place.
        same = sum(abs(first - second) <= SAME_LEVEL_DB for first, second in common)
        return len(common) >= SAME_PULSES * min(map(len, levels)) and same >= SAME_PULSES * len(
            common
        )
    longest = max(each.end_time_ns - each.info.start_time_ns for each in (one, other))
    return not _are_two(one, other) and overlap >= SAME_SPAN * longest


def _common(
    one: dict[tuple[int, int], float], other: dict[tuple[int, int], float]
) -> list[tuple[float, float]]:
    """Levels of the pulses that two records share: those of a tag within half a millisecond.

    Not by rounded times: pulses an exact interval apart all lie on a rounding's edge together.
    """
    theirs, pairs = sorted(other), []
    for (tag_id, start_ns), level in one.items():
        at = bisect_left(theirs, (tag_id, start_ns - _SAME_NS))
        if at < len(theirs) and theirs[at] <= (tag_id, start_ns + _SAME_NS):
            pairs.append((level, other[theirs[at]]))
    return pairs


def _are_two(one: FlightOutline, other: FlightOutline) -> bool:
    """Whether one recorder wrote both, which writes each flight once; pulses know better.

    A drone's recording is the same only if it began in the same nanosecond, in whatever folder.
    Stations are told apart by the folder: two of them begin when they hear of a flight. So
    flights of a clock that begins anew in 1970 at each start are not taken for one.
    """
    if (one.pulses and other.pulses) or one.info.start_time_ns == other.info.start_time_ns:
        return False
    beside = one.directory.parent == other.directory.parent
    return one.of_ground == other.of_ground and (beside or not one.of_ground)


def _may_be_one_vehicle(one: str | None, other: str | None) -> bool:
    """Whether two are the same vehicle as far as is told; not every station names it."""
    if one is None or other is None:
        return True
    numbers, names = zip(*(each.partition(", ")[::2] for each in (one, other)), strict=True)
    return numbers[0] == numbers[1] and (names[0] == names[1] or "" in names)


def _minutes(flight: _Flight) -> float:
    """Length of the copy that is the longest."""
    longest = max(one.end_time_ns - one.info.start_time_ns for one in flight)
    return longest / NANOSECONDS_PER_SECOND / 60.0


def _key(tag: Tag) -> _Animal:
    return tag.tag_id, round(tag.frequency_hz / 1e3)


def _heard(flight: _Flight) -> list[_Animal]:
    return [_key(tag) for tag in flight[0].info.tags if tag.tag_id in flight[0].heard]


def _animals(flights: Sequence[_Flight]) -> tuple[AnimalOfSeason, ...]:
    searched: dict[_Animal, list[tuple[Tag, _Flight]]] = {}
    for flight in flights:
        for tag in flight[0].info.tags:
            searched.setdefault(_key(tag), []).append((tag, flight))
    return tuple(_animal(searched[key]) for key in sorted(searched))


def _animal(searched: Sequence[tuple[Tag, _Flight]]) -> AnimalOfSeason:
    """Summarize one animal: its flights in order of time, with the tag as each listed it."""
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


def _batteries(flights: Sequence[_Flight]) -> tuple[int, float]:
    """Count batteries that were put in, and what was used of them, over all vehicles.

    Of a flight's copies the one counts that saw most of its batteries.
    """
    before: dict[str | None, int] = {}
    put_in, used = 0, 0.0
    for flight in flights:
        copy = max(flight, key=_taken_out)
        known = [one for one in before if (one is None) == (copy.vehicle is None)]
        same = [one for one in known if _may_be_one_vehicle(one, copy.vehicle)]
        last = before.pop(same[-1]) if same else None
        for percent in copy.battery_percent:
            put_in += last is None or percent >= last + CHANGED_PERCENT
            used += 0.0 if last is None else max(0, last - percent) / 100.0
            last = percent
        if last is not None:
            before[copy.vehicle] = last  # the one flown last comes last
    return put_in, used


def _taken_out(copy: FlightOutline) -> tuple[int, int]:
    """What it saw of batteries: by how much they fell [%], and how often it noted them."""
    falls = (max(0, one - other) for one, other in pairwise(copy.battery_percent))
    return sum(falls), len(copy.battery_percent)
