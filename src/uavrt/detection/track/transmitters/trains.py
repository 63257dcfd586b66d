"""Merge tracks of several detectors into trains: the pulses of one transmitter.

Tracks of detectors with overlapping bands are merged if they have pulses in common. The train
is described by the track that explains most pulses, because a track with only one of three
expected pulses may have another interval, or belong to several trains.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

from uavrt.core.messages import Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.detection.track.tracks import Slot, Track
from uavrt.detection.track.tuning import BOUNDS, RATES, SENDERS
from uavrt.detection.track.two_rates import evidence, strength


class FollowingDetector(Protocol):
    """Interface of a detector that follows tracks, as needed to merge them into trains."""

    tag: Tag
    sample_rate_hz: float

    @property
    def tracks(self) -> list[Track]:
        """All tracks that the detector follows."""

    def absolute_hz(self, track: Track) -> float:
        """Absolute frequency of a track [Hz]."""

    def time_ns(self, time_s: float) -> float:
        """Convert a time on the scale of the tracks [s] to absolute time [ns]."""

    def may_be_at(self, frequency_hz: float) -> bool:
        """True if the detector searches for its tag at an absolute frequency."""

    @property
    def now_s(self) -> float:
        """Time up to which the detector has searched [s], on the time scale of the tracks."""

    @property
    def half_width_hz(self) -> float:
        """Half-width of the detector's search [Hz]."""

    def report(self, track: Track) -> None:
        """Report a track's pulses, unless it is doubtful or another track is the tag's."""


H = TypeVar("H", bound=FollowingDetector)


@dataclass(slots=True)
class Train(Generic[H]):
    """Pulses of one transmitter, followed by one or several detectors."""

    tracks: list[tuple[H, Track]]
    interval_s: float = 0.0
    sigma_s: float = 0.0
    frequency_hz: float = 0.0
    confirmed: bool = False
    likely: bool = False
    """True if the train is most likely neither noise nor a chance series of bursts."""
    last_pulse_ns: float = 0.0
    """Time of the train's last accepted pulse [ns]."""
    pulses_ns: list[int] = field(default_factory=list)
    """Times of the train's newest pulses [ns]."""
    explains: float = 0.0
    """Log-likelihood ratio of the train to noise, over its pulses."""

    def combine(self) -> None:
        """Set interval, frequency and times from the best track of the train."""
        # Unconfirmed tracks do not count for a confirmed train, nor noise for a likely one.
        sure = [pair for pair in self.tracks if pair[1].confirmed]
        sure = sure or [pair for pair in self.tracks if _is_likely(pair[1])] or self.tracks
        some = _best_explained(sure)
        shortest_s = min(track.interval_s for _, track in some)
        # A track of twice the interval has every second pulse.
        some = [
            pair
            for pair in some
            if pair[1].interval_s < SENDERS.same_interval_ratio * shortest_s
        ]
        detector, best = min(some, key=lambda pair: (pair[1].variance[2], pair[0].tag.tag_id))
        self.interval_s = best.interval_s
        self.sigma_s = math.sqrt(max(best.variance[2], 0.0))
        self.frequency_hz = detector.absolute_hz(best)
        self.confirmed = any(track.confirmed for _, track in self.tracks)
        self.likely = any(_is_likely(track) for _, track in self.tracks)
        self.last_pulse_ns = max(h.time_ns(t.last_accepted_s) for h, t in self.tracks)
        self.pulses_ns = [
            slot.time_ns
            for slot in best.slots
            if slot.received or (not best.confirmed and slot.tag_odds > 0.0)
        ]
        self.explains = evidence(best.slots, strength(best))


@dataclass(frozen=True, slots=True)
class KnownPulse:
    """A received pulse of a confirmed train, or the train's next expected pulse."""

    time_ns: float
    within_ns: float
    """Uncertainty of the known pulse's time [ns]: 0 for a received pulse."""
    frequency_hz: float
    power: float

    def explains(
        self, slot: Slot, frequency_hz: float, width_s: float, *, near_ns: float
    ) -> bool:
        """True if a pulse found at a frequency is this pulse or its leakage."""
        if abs(slot.time_ns - self.time_ns) >= near_ns + self.within_ns:
            return False
        apart_hz = abs(frequency_hz - self.frequency_hz)
        if apart_hz < BOUNDS.same_transmitter_hz:
            return True
        # As in `judging`: at most 1 / (pi df tp)^2 of its power, with twice the amplitude.
        leak = 4.0 * self.power / (math.pi * apart_hz * width_s) ** 2
        return slot.measured.power <= leak


def merge_tracks(detectors: Iterable[H]) -> list[Train[H]]:
    """Merge tracks with the same pulses into trains, in order of evidence per second, so that a
    tag's track comes before one of twice its interval.
    """
    trains: list[Train[H]] = []
    near: dict[int, list[tuple[H, Track, int]]] = {}
    """Tracks in each frequency step, with their detectors and the indices of their trains."""
    pairs = [
        (detector, track)
        for detector in detectors
        for track in detector.tracks
        if not track.dead and _is_active(track, detector.now_s)
    ]
    for detector, track in sorted(pairs, key=lambda pair: _explains_most(pair[1])):
        place = math.floor(detector.absolute_hz(track) / BOUNDS.same_transmitter_hz)
        others = [o for at in (-1, 0, 1) for o in near.get(place + at, ())]
        others.sort(key=lambda other: other[2])
        mate = next((at for h, t, at in others if _are_one(detector, track, h, t)), len(trains))
        if mate == len(trains):
            trains.append(Train([]))
        trains[mate].tracks.append((detector, track))
        near.setdefault(place, []).append((detector, track, mate))
    for train in trains:
        train.combine()
    return trains


def made_of_other_trains(trains: Sequence[Train[H]], *, near_ns: float) -> list[Train[H]]:
    """Find trains in which hardly any pulse does not belong to another train.

    The expected times of a train may coincide with pulses of other trains. For example, every
    third pulse at 1254 ms coincides with every second pulse at 1881 ms.
    """
    found: list[Train[H]] = []
    confirmed = sorted(
        (train for train in trains if train.confirmed), key=lambda train: train.frequency_hz
    )
    frequencies_hz = [train.frequency_hz for train in confirmed]
    for train in sorted(trains, key=lambda train: train.explains):
        times_ns = train.pulses_ns
        if len(times_ns) < SENDERS.foreign_pulses:
            continue
        begin = bisect_right(frequencies_hz, train.frequency_hz - BOUNDS.same_transmitter_hz)
        end = bisect_left(frequencies_hz, train.frequency_hz + BOUNDS.same_transmitter_hz)
        others_ns = [
            time_ns
            for other in confirmed[begin:end]
            if other is not train and not any(other is one for one in found)
            for time_ns in other.pulses_ns
        ]
        if not others_ns or min(others_ns) > times_ns[-1]:
            continue
        shared = sum(any(abs(a - b) < near_ns for b in others_ns) for a in times_ns)
        if shared >= SENDERS.foreign_share * len(times_ns):
            found.append(train)
    return found


def known_pulses(train: Train[H]) -> list[KnownPulse]:
    """Newest pulses of a confirmed train, and the next expected one."""
    known = []
    for detector, track in train.tracks:
        if not track.confirmed or track.dead:
            continue
        at_hz = detector.absolute_hz(track)
        received = track.received
        known += [KnownPulse(s.time_ns, 0.0, at_hz, s.measured.power) for s in received]
        if received:
            # Tracks that began with it may have been faster than this detector.
            time_s, half_s = track.expected()
            half_ns = NANOSECONDS_PER_SECOND * half_s
            power = max(slot.measured.power for slot in received)
            known.append(KnownPulse(detector.time_ns(time_s), half_ns, at_hz, power))
    return known


def pulse_times_ns(track: Track) -> list[int]:
    """Times of the accepted pulses of a track [ns]."""
    return [slot.time_ns for slot in track.received]


def _explains_most(track: Track) -> tuple[bool, float]:
    """Sort key of tracks: confirmed first, then by evidence per second."""
    if not track.slots:
        return not track.confirmed, 0.0
    spanned_s = track.slots[-1].time_s - track.slots[0].time_s + track.interval_s
    return not track.confirmed, -evidence(track.slots, strength(track)) / spanned_s


def _is_likely(track: Track) -> bool:
    return track.confirmed or (track.stands_out and track.odds > SENDERS.likely_odds)


def _best_explained(pairs: list[tuple[H, Track]]) -> list[tuple[H, Track]]:
    """Select the tracks of a train that explain its pulses nearly as well as the best one."""
    intervals_s = [track.interval_s for _, track in pairs]
    if max(intervals_s) < SENDERS.same_interval_ratio * min(intervals_s):
        return pairs
    since_ns = max(track.slots[0].time_ns if track.slots else 0 for _, track in pairs)
    upto_ns = (
        min(h.time_ns(track.time_s) for h, track in pairs)
        + NANOSECONDS_PER_SECOND * min(intervals_s) / 4.0
    )
    level = max(strength(track) for _, track in pairs)
    width_ns = NANOSECONDS_PER_SECOND * pairs[0][1].tag.pulse_width_s
    values = [
        evidence([s for s in track.slots if since_ns - width_ns < s.time_ns < upto_ns], level)
        for _, track in pairs
    ]
    return [
        pair
        for pair, value in zip(pairs, values, strict=True)
        if value > max(values) - RATES.decisive_log
    ]


def _is_active(track: Track, now_s: float) -> bool:
    return not track.confirmed or now_s - track.last_accepted_s < 5.0 * track.interval_s


def _are_one(
    one_at: FollowingDetector, one: Track, two_at: FollowingDetector, two: Track
) -> bool:
    apart_hz = abs(one_at.absolute_hz(one) - two_at.absolute_hz(two))
    if apart_hz > BOUNDS.same_transmitter_hz:
        return False
    near_ns = 0.75e9 * max(one.tag.pulse_width_s, two.tag.pulse_width_s)
    ones, twos = pulse_times_ns(one), pulse_times_ns(two)
    intervals_s = one.interval_s, two.interval_s
    if max(intervals_s) > SENDERS.same_interval_ratio * min(intervals_s):
        # The slower track's pulses are older than the other track's slots.
        ones, twos = one.past_ns + ones, two.past_ns + twos
    if ones and twos:
        first, last = max(ones[0], twos[0]) - near_ns, min(ones[-1], twos[-1]) + near_ns
        ones = [t for t in ones if first <= t <= last]
        twos = [t for t in twos if first <= t <= last]
        fewer = min(len(ones), len(twos))
        if fewer > 1:
            shared = sum(any(abs(a - b) < near_ns for b in twos) for a in ones)
            return shared >= SENDERS.same_train_share * fewer
    # Too few common pulses: compare the expected times.
    interval_ns = NANOSECONDS_PER_SECOND * min(one.interval_s, two.interval_s)
    apart_ns = one_at.time_ns(one.time_s) - two_at.time_ns(two.time_s)
    return abs(math.remainder(apart_ns, interval_ns)) < near_ns / 2.0
