"""Recognise ghosts: spurious copies of a stronger tag's pulses that the receiver produces.

A quadrature receiver shows each signal weakly at its mirror frequency about the radio's centre.
If it is saturated, it also shows the signal at multiples of its distance from the centre. Two
simultaneous signals, such as a tag and a steady carrier, cause intermodulation products at 2 f1
- f2 and other frequencies. A ghost has its pulses at the times of the original's pulses and at
one of these frequencies. The probability that an independent tag does so is computed from its
phase, interval and frequency.
"""

import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Generic

import numpy as np

from uavrt.config.ghost_places import Receiver
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.detection.search.refine import timing_error_s
from uavrt.detection.track.other_signals.masking import level
from uavrt.detection.track.tracks import Slot, Track
from uavrt.detection.track.transmitters.coincidence import by_chance, of_ghosts
from uavrt.detection.track.transmitters.trains import H
from uavrt.detection.track.tuning import BOUNDS, GHOSTS


@dataclass(frozen=True, slots=True)
class _ReceivedTrain(Generic[H]):
    detector: H
    track: Track
    level: float
    frequency_hz: float
    times_ns: list[int]
    near_s: list[float]
    """Maximum time from each pulse to a simultaneous pulse of another train [s]."""

    @property
    def edge_s(self) -> float:
        """Maximum time between a pulse and the false pulse that its edge may make [s]."""
        return GHOSTS.edge_widths * self.track.tag.pulse_width_s


@dataclass(frozen=True, slots=True)
class _Coincidence:
    together: int
    pulses: int
    near_s: float


class _Instants(Generic[H]):
    """Pulses of all trains in order of time, indexed by instant for a fast search."""

    def __init__(self, received: list[_ReceivedTrain[H]]) -> None:
        self._trains = received
        times_ns = np.array([time_ns for one in received for time_ns in one.times_ns], np.int64)
        owners = np.repeat(np.arange(len(received)), [len(one.times_ns) for one in received])
        order = np.argsort(times_ns)
        self._times_ns, self._owners = times_ns[order], owners[order].tolist()

    def coinciding(self, one: _ReceivedTrain[H]) -> list[_ReceivedTrain[H]]:
        """Other trains that have at least `GHOSTS.least_pulses` simultaneous with a train."""
        near_s = np.maximum(one.near_s, one.edge_s)
        near_ns = (near_s * NANOSECONDS_PER_SECOND).astype(np.int64) + GHOSTS.rounding_ns
        times_ns = np.array(one.times_ns, np.int64)
        first = np.searchsorted(self._times_ns, times_ns - near_ns, side="left").tolist()
        last = np.searchsorted(self._times_ns, times_ns + near_ns, side="right").tolist()
        often: Counter[int] = Counter()
        for begin, end in zip(first, last, strict=True):
            often.update(set(self._owners[begin:end]))
        return [
            other
            for number, other in enumerate(self._trains)
            if often[number] >= GHOSTS.least_pulses and other is not one
        ]


def mark_ghosts(
    detectors: Iterable[H], receiver: Receiver, carriers_hz: Sequence[float] = ()
) -> list[tuple[H, Track]]:
    """Mark tracks that are spurious copies of others; return those not marked before."""
    received = [
        _received_train(detector, track, slots)
        for detector in detectors
        for track in detector.tracks
        if len(slots := _accepted(track)) >= GHOSTS.least_pulses
    ]
    strongest = max((one.level for one in received), default=0.0)
    instants: _Instants[H] | None = None
    new = []
    for one in received:
        if strongest < GHOSTS.stronger_ratio * one.level and one.track.ghost_of is None:
            continue
        before = one.track.ghost_of
        instants = instants or _Instants(received)
        one.track.ghost_of = _original(one, instants.coinciding(one), receiver, carriers_hz)
        if one.track.ghost_of is not None and before is None:
            new.append((one.detector, one.track))
    return new


def _original(
    one: _ReceivedTrain[H],
    received: list[_ReceivedTrain[H]],
    receiver: Receiver,
    carriers_hz: Sequence[float],
) -> int | None:
    for other in received:
        if other.track.ghost_of is None and _is_edges(one, other):
            return other.detector.tag.tag_id
    stronger = [
        (other, found)
        for other in received
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
            nominal_hz=one.detector.tag.frequency_hz,
            half_width_hz=one.detector.half_width_hz,
        ) <= GHOSTS.mistaken_share * of_ghosts(found.together, found.pulses):
            return other.detector.tag.tag_id
    return None


def _is_edges(one: _ReceivedTrain[H], other: _ReceivedTrain[H]) -> bool:
    """True if a train is only the leakage of another train at a distant frequency: the edges of
    a rectangular pulse have at most 1 / (pi df tp)^2 of its power.
    """
    if other.level < GHOSTS.edge_ratio * one.level or one.detector.may_be_at(
        other.frequency_hz
    ):
        return False
    apart_hz = abs(one.frequency_hz - other.frequency_hz)
    edge = math.sqrt(other.level) / (math.pi * apart_hz * other.track.tag.pulse_width_s)
    if edge < 1.0 or one.level > (edge + GHOSTS.edge_noise) ** 2:
        return False
    found = _coincidence(one, other, [one.edge_s] * len(one.times_ns))
    return found.together >= max(GHOSTS.least_pulses, GHOSTS.edge_share * found.pulses)


def _chance(one: _ReceivedTrain[H], other: _ReceivedTrain[H], found: _Coincidence) -> float:
    tag, interval_s = one.track.tag, other.track.interval_s
    return by_chance(
        found.together,
        found.pulses,
        near_s=found.near_s,
        interval_s=interval_s,
        uncertainty_s=tag.interval_uncertainty_s
        + BOUNDS.clock_error * max(tag.pulse_intervals_s),
    )


def _coincidence(
    one: _ReceivedTrain[H], other: _ReceivedTrain[H], near_s: Sequence[float]
) -> _Coincidence:
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


def _received_train(detector: H, track: Track, slots: list[Slot]) -> _ReceivedTrain[H]:
    width_s = track.tag.pulse_width_s
    return _ReceivedTrain(
        detector,
        track,
        level(track),
        detector.absolute_hz(track),
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
