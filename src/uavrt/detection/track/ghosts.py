"""Ghosts: copies of a stronger tag's pulses that the receiver produces.

A quadrature receiver shows each signal weakly at its mirror frequency about the radio's centre,
and a saturated one also at multiples of its distance from the centre. Two simultaneous signals,
such as a tag and a steady carrier, have products at 2 f1 - f2 and others. A ghost has the
pulses of its original at the same instants and at such a frequency. The chance that another tag
does so is computed from its phase, interval and frequency.
"""

import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Generic

import numpy as np

from uavrt.config.ghost_places import Receiver
from uavrt.detection.search.refine import timing_error_s
from uavrt.detection.track.coincidence import by_chance, of_ghosts
from uavrt.detection.track.masking import level
from uavrt.detection.track.tracks import Slot, Track
from uavrt.detection.track.trains import H
from uavrt.detection.track.tuning import BOUNDS, GHOSTS
from uavrt.units import NANOSECONDS_PER_SECOND


@dataclass(frozen=True, slots=True)
class _Heard(Generic[H]):
    hearer: H
    track: Track
    level: float
    frequency_hz: float
    times_ns: list[int]
    near_s: list[float]
    """Distance of each pulse within which another one is simultaneous [s]."""

    @property
    def edge_s(self) -> float:
        """Distance from a pulse within which its edges are found [s]."""
        return GHOSTS.edge_widths * self.track.tag.pulse_width_s


@dataclass(frozen=True, slots=True)
class _Coincidence:
    together: int
    pulses: int
    near_s: float


class _Instants(Generic[H]):
    """All trains' pulses in order of time; few of hundreds of trains share an instant."""

    def __init__(self, heard: list[_Heard[H]]) -> None:
        self._heard = heard
        times_ns = np.array([time_ns for one in heard for time_ns in one.times_ns], np.int64)
        whose = np.repeat(np.arange(len(heard)), [len(one.times_ns) for one in heard])
        order = np.argsort(times_ns)
        self._times_ns, self._whose = times_ns[order], whose[order].tolist()

    def of_company(self, one: _Heard[H]) -> list[_Heard[H]]:
        """Trains of which enough pulses may coincide with those of a train."""
        near_s = np.maximum(one.near_s, one.edge_s)
        near_ns = (near_s * NANOSECONDS_PER_SECOND).astype(np.int64) + GHOSTS.rounding_ns
        times_ns = np.array(one.times_ns, np.int64)
        first = np.searchsorted(self._times_ns, times_ns - near_ns, side="left").tolist()
        last = np.searchsorted(self._times_ns, times_ns + near_ns, side="right").tolist()
        often: Counter[int] = Counter()
        for begin, end in zip(first, last, strict=True):
            often.update(set(self._whose[begin:end]))
        return [
            other
            for number, other in enumerate(self._heard)
            if often[number] >= GHOSTS.least_pulses and other is not one
        ]


def mark_ghosts(
    hearers: Iterable[H], receiver: Receiver, carriers_hz: Sequence[float] = ()
) -> list[tuple[H, Track]]:
    """Mark the tracks that are ghosts of others, and unmark the rest.

    `carriers_hz`: absolute frequencies of strong steady carriers in the receiver's band.
    Returns the newly marked tracks.
    """
    heard = [
        _listen(hearer, track, slots)
        for hearer in hearers
        for track in hearer.tracks
        if len(slots := _accepted(track)) >= GHOSTS.least_pulses
    ]
    strongest = max((one.level for one in heard), default=0.0)
    instants: _Instants[H] | None = None
    new = []
    for one in heard:
        if strongest < GHOSTS.stronger_ratio * one.level and one.track.ghost_of is None:
            continue
        before = one.track.ghost_of
        instants = instants or _Instants(heard)
        one.track.ghost_of = _original(one, instants.of_company(one), receiver, carriers_hz)
        if one.track.ghost_of is not None and before is None:
            new.append((one.hearer, one.track))
    return new


def _original(
    one: _Heard[H], heard: list[_Heard[H]], receiver: Receiver, carriers_hz: Sequence[float]
) -> int | None:
    for other in heard:
        if other.track.ghost_of is None and _is_edges(one, other):
            return other.hearer.tag.tag_id
    stronger = [
        (other, found)
        for other in heard
        if other.track.ghost_of is None
        and other.level >= GHOSTS.stronger_ratio * one.level
        and (found := _coincidence(one, other, one.near_s)).together >= GHOSTS.least_pulses
    ]
    for other, found in stronger:
        partners_hz = [
            *carriers_hz,
            *(third.frequency_hz for third, _ in stronger if third is not other),
        ]
        if receiver.makes(one.frequency_hz, other.frequency_hz, partners_hz) and _chance(
            one, other, found
        ) * receiver.share_of_band(
            other.frequency_hz,
            partners_hz,
            nominal_hz=one.hearer.tag.frequency_hz,
            half_width_hz=one.hearer.half_width_hz,
        ) <= GHOSTS.mistaken_share * of_ghosts(found.together, found.pulses):
            return other.hearer.tag.tag_id
    return None


def _is_edges(one: _Heard[H], other: _Heard[H]) -> bool:
    """True if a train is only another's leakage far from its frequency.

    The edges of a rectangular pulse have at most 1 / (pi df tp)^2 of its power. Trains within
    the search band of the weaker tag are assigned by senders.py.
    """
    if other.level < GHOSTS.edge_ratio * one.level or one.hearer.could_be(other.frequency_hz):
        return False
    apart_hz = abs(one.frequency_hz - other.frequency_hz)
    edge = math.sqrt(other.level) / (math.pi * apart_hz * other.track.tag.pulse_width_s)
    if edge < 1.0 or one.level > (edge + GHOSTS.edge_noise) ** 2:
        return False
    found = _coincidence(one, other, [one.edge_s] * len(one.times_ns))
    return found.together >= max(GHOSTS.least_pulses, GHOSTS.edge_share * found.pulses)


def _chance(one: _Heard[H], other: _Heard[H], found: _Coincidence) -> float:
    tag, interval_s = one.track.tag, other.track.interval_s
    return by_chance(
        found.together,
        found.pulses,
        near_s=found.near_s,
        interval_s=interval_s,
        uncertainty_s=tag.interval_uncertainty_s
        + BOUNDS.clock_error * max(tag.pulse_intervals_s),
    )


def _coincidence(one: _Heard[H], other: _Heard[H], near_s: Sequence[float]) -> _Coincidence:
    mates_ns = other.times_ns
    first_ns, last_ns = mates_ns[0], mates_ns[-1]
    pulses = together = 0
    widest_s = 0.0
    for time_ns, this_s in zip(one.times_ns, near_s, strict=True):
        near_ns = NANOSECONDS_PER_SECOND * this_s
        if not first_ns - near_ns <= time_ns <= last_ns + near_ns:
            continue
        pulses += 1
        widest_s = max(widest_s, this_s)
        after = bisect_right(mates_ns, time_ns - near_ns)
        together += after < len(mates_ns) and mates_ns[after] < time_ns + near_ns
    return _Coincidence(together, pulses, widest_s)


def _listen(hearer: H, track: Track, slots: list[Slot]) -> _Heard[H]:
    width_s = track.tag.pulse_width_s
    return _Heard(
        hearer,
        track,
        level(track),
        hearer.absolute_hz(track),
        [slot.time_ns for slot in slots],
        [
            width_s / 16.0 + BOUNDS.timing_sigmas * timing_error_s(width_s, slot.measured.power)
            for slot in slots
        ],
    )


def _accepted(track: Track) -> list[Slot]:
    if track.dead:
        return []
    return track.received
