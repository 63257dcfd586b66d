"""Find records of the same flight by the drone and by ground stations.

Records with pulses are compared by their pulses, others by their start and end times. Each
flight is compared only with flights that share some randomly chosen pulses, or whose time spans
overlap. So the computing time is proportional to the number of flights.
"""

from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import FormatError
from uavrt.flight.reading.outline import FlightOutline, read_pulse_levels

SAME_PULSES = 0.5
"""Minimum share of the shorter record's pulses that the other record must contain for both to
be of one flight."""
_SAME_NS = 500_000
"""Largest start difference of a pulse in two copies [ns]; radio links round times."""
SAME_LEVEL_DB = 0.1
"""Largest difference of a pulse's levels in two copies [dB]; two drones differ by 5 dB."""
SAME_SPAN = 0.9
"""Minimum overlap of two records without pulses for both to be of one flight, as a share of the
longer record."""
_PROBES = 32
"""Number of a flight's pulses that are searched for in all other flights.

If two records have a quarter of their pulses in common, they share fewer than two of these in
one case of 850."""
_FEW = 8
"""Number of pulses below which one equal pulse suffices to compare flights completely."""

CopiesOfFlight = tuple[FlightOutline, ...]
"""All records of one flight, the one with the most pulses first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Pulses:
    tag_id: NDArray[np.int64]
    start_ns: NDArray[np.int64]
    level_db: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.tag_id)


def without_copies(outlines: Sequence[FlightOutline]) -> list[CopiesOfFlight]:
    """Group the records of each flight, and sort the groups by start time."""
    outlines = sorted(outlines, key=lambda one: one.info.start_time_ns)
    pulses = {
        number: found
        for number in _overlapping(outlines)
        if (found := _pulses_of(outlines[number])) is not None
    }
    near: dict[int, set[int]] = defaultdict(set)
    for one, other in (*_alike_by_pulses(pulses), *_alike_by_times(outlines)):
        near[max(one, other)].add(min(one, other))
    flights: list[list[int]] = []
    places: list[int] = []
    for number, outline in enumerate(outlines):
        for place in sorted({places[each] for each in near[number]}, reverse=True):
            flight = flights[place]
            if _is_same(outlines, flight[0], number, pulses) and not any(
                _are_two(outlines[each], outline) for each in flight
            ):
                flight.append(number)
                break
        else:
            place = len(flights)
            flights.append([number])
        places.append(place)
    return [
        tuple(sorted((outlines[each] for each in one), key=lambda each: -each.pulses))
        for one in flights
    ]


def _overlapping(outlines: Sequence[FlightOutline]) -> list[int]:
    heard = [number for number, one in enumerate(outlines) if one.pulses]
    starts = np.array([outlines[number].info.start_time_ns for number in heard])
    ends = np.array([outlines[number].end_time_ns for number in heard])
    overlap = np.zeros(len(heard), bool)
    overlap[1:] = starts[1:] <= np.maximum.accumulate(ends)[:-1]
    overlap[:-1] |= ends[:-1] >= starts[1:]
    return [heard[place] for place in np.flatnonzero(overlap)]


def _pulses_of(outline: FlightOutline) -> _Pulses | None:
    try:
        found = sorted(read_pulse_levels(outline.directory).items())
    except FormatError:
        return None
    keys = np.array([key for key, _ in found], np.int64).reshape(-1, 2)
    levels = np.array([level for _, level in found])
    return _Pulses(tag_id=keys[:, 0], start_ns=keys[:, 1], level_db=levels)


def _alike_by_pulses(pulses: Mapping[int, _Pulses]) -> Iterator[tuple[int, int]]:
    if not pulses:
        return
    numbers, rng = [*pulses], np.random.default_rng(0)
    sizes = [len(one) for one in pulses.values()]
    owner = np.repeat(np.arange(len(numbers)), sizes)
    probe = np.zeros(len(owner), bool)
    for first, size in zip(np.cumsum([0, *sizes[:-1]]), sizes, strict=True):
        probe[first + rng.permutation(size)[:_PROBES]] = True
    tag_id = np.concatenate([one.tag_id for one in pulses.values()])
    start_ns = np.concatenate([one.start_ns for one in pulses.values()])
    level_db = np.concatenate([one.level_db for one in pulses.values()])
    order = np.lexsort((start_ns, tag_id))
    found = []
    for same_tag in np.split(order, np.flatnonzero(np.diff(tag_id[order])) + 1):
        times = start_ns[same_tag]
        mine = np.flatnonzero(probe[same_tag])
        first = np.searchsorted(times, times[mine] - _SAME_NS)
        count = np.searchsorted(times, times[mine] + _SAME_NS, "right") - first
        theirs = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
        one, other = same_tag[np.repeat(mine, count)], same_tag[theirs]
        alike = np.abs(level_db[one] - level_db[other]) <= SAME_LEVEL_DB
        alike &= owner[one] != owner[other]
        found.append(owner[one][alike] * len(numbers) + owner[other][alike])
    pairs, hits = np.unique(np.concatenate(found), return_counts=True)
    one, other = np.divmod(pairs, len(numbers))
    enough = hits >= np.where(np.array(sizes)[one] < _FEW, 1, 2)
    for first, second in zip(one[enough], other[enough], strict=True):
        yield numbers[first], numbers[second]


def _alike_by_times(outlines: Sequence[FlightOutline]) -> Iterator[tuple[int, int]]:
    """Yield pairs of records, as indices, that may be of one flight by their times; at least
    one has no pulses.

    Two records of drones are copies only if they began in the same nanosecond, since many
    drones' clocks start in 1970.
    """
    by_start: dict[int, list[int]] = defaultdict(list)
    ground: list[int] = []
    drones: list[int] = []
    for number, one in enumerate(outlines):
        by_start[one.info.start_time_ns].append(number)
        (ground if one.of_ground else drones).append(number)
    starts = [
        [outlines[number].info.start_time_ns for number in some] for some in (ground, drones)
    ]
    for number, one in enumerate(outlines):
        if one.pulses:
            continue
        start_ns = one.info.start_time_ns
        yield from ((number, other) for other in by_start[start_ns] if other != number)
        apart_ns = round((one.end_time_ns - start_ns) * (1.0 / SAME_SPAN - 1.0)) + 1
        for some, times in zip((ground, drones), starts, strict=True):
            if some is ground or one.of_ground:
                first = bisect_left(times, start_ns - apart_ns)
                last = bisect_right(times, start_ns + apart_ns)
                yield from ((number, other) for other in some[first:last] if other != number)


def _is_same(
    outlines: Sequence[FlightOutline], first: int, second: int, pulses: Mapping[int, _Pulses]
) -> bool:
    """True if two records are of one flight, by pulses or, if one has none, by times."""
    one, other = outlines[first], outlines[second]
    begin = max(one.info.start_time_ns, other.info.start_time_ns)
    overlap = min(one.end_time_ns, other.end_time_ns) - begin
    if overlap < 0 or not may_be_one_vehicle(one.vehicle, other.vehicle):
        return False
    if one.pulses and other.pulses:
        if first not in pulses or second not in pulses:
            return False
        return _share_pulses(pulses[first], pulses[second])
    longest = max(each.end_time_ns - each.info.start_time_ns for each in (one, other))
    return not _are_two(one, other) and overlap >= SAME_SPAN * longest


def _share_pulses(one: _Pulses, other: _Pulses) -> bool:
    """True if two records share at least half of their pulses, with equal tag, start (0.5 ms)
    and level (0.1 dB).

    Times are compared without rounding, since all pulses could lie at the edge of a rounding
    step.
    """
    common = same = 0
    for tag_id in np.intersect1d(one.tag_id, other.tag_id):
        mine, theirs = one.tag_id == tag_id, other.tag_id == tag_id
        times = other.start_ns[theirs]
        wanted = one.start_ns[mine]
        at = np.minimum(np.searchsorted(times, wanted - _SAME_NS), len(times) - 1)
        shared = np.abs(times[at] - wanted) <= _SAME_NS
        # Drones side by side hear the same pulses, each as strong as at its own place.
        apart_db = np.abs(one.level_db[mine] - other.level_db[theirs][at])[shared]
        common += int(np.count_nonzero(shared))
        same += int(np.count_nonzero(apart_db <= SAME_LEVEL_DB))
    least = SAME_PULSES * min(len(one), len(other))
    return common >= least and same >= SAME_PULSES * common


def _are_two(one: FlightOutline, other: FlightOutline) -> bool:
    """True if two records, at least one without pulses, must be of separate flights.

    This holds for two drones' records that began at different times, and for such records of
    ground stations in one folder.
    """
    if (one.pulses and other.pulses) or one.info.start_time_ns == other.info.start_time_ns:
        return False
    same_folder = one.directory.parent == other.directory.parent
    return one.of_ground == other.of_ground and (same_folder or not one.of_ground)


def may_be_one_vehicle(one: str | None, other: str | None) -> bool:
    """True unless two records state different vehicles; a missing name matches any vehicle."""
    if one is None or other is None:
        return True
    numbers, names = zip(*(each.partition(", ")[::2] for each in (one, other)), strict=True)
    return numbers[0] == numbers[1] and (names[0] == names[1] or "" in names)
