"""Decide which listed tag sent a train of pulses if several could have.

If bands overlap, several detectors receive the same pulses, and each would report them as its
own tag's. Tracks of the same pulses are merged into trains, which are assigned one to one to
tags, by interval and frequency. A declared uncertainty is taken as three standard deviations of
a normal error, and as a bound. Other tags at least a twentieth as likely are reported with the
pulses. A tag's interval measured without competing tags is stored for later decisions.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Generic

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag
from uavrt.detection.signal.tuning import CHANNEL
from uavrt.detection.track.tracks import Slot, Track
from uavrt.detection.track.transmitters.train_assignment import best_assignment, losses, parts
from uavrt.detection.track.transmitters.trains import (
    FollowingDetector,
    H,
    Train,
    known_pulses,
    made_of_other_trains,
    merge_tracks,
    pulse_times_ns,
)
from uavrt.detection.track.tuning import BOUNDS, SENDERS

_Properties = tuple[float, float, float, tuple[tuple[int, bool], ...]]
"""Properties of a train: interval and its standard deviation [s], frequency [Hz], and
detectors."""
_Assignment = tuple[int, int, tuple[int, ...], bool]
"""Result for one train: its index, its tag, other possible tags, and True if all competitors
are confirmed."""


def interval_separation(one: Tag, two: Tag) -> "IntervalSeparation":
    """Compute how well two tags, each received alone, are distinguished by their intervals."""
    pairs = [(a, b) for a in one.pulse_intervals_s for b in two.pulse_intervals_s]
    gap_s, nominal_s = min((abs(a - b), max(a, b)) for a, b in pairs)
    room_s = gap_s - 2.0 * BOUNDS.clock_error * nominal_s
    jitter_s = max(one.interval_jitter_s, two.interval_jitter_s)
    width_s = max(one.pulse_width_s, two.pulse_width_s)
    # For a pulse of 13 dB; the jitter is uniform.
    error_s = math.hypot(0.08 * width_s, jitter_s / math.sqrt(3.0))
    pulses = None
    if gap_s > 2.0 * SENDERS.interval_drift * nominal_s:
        # A straight line through n times: sigma of its slope is error sqrt(12 / n^3).
        least = (12.0 * (2.0 * SENDERS.interval_sigmas * error_s / gap_s) ** 2) ** (1.0 / 3.0)
        pulses = max(2, one.k, two.k, math.ceil(least))
    declared_s = one.interval_uncertainty_s + two.interval_uncertainty_s
    return IntervalSeparation(
        gap_s=gap_s,
        certain=declared_s < room_s,
        uncertainty_s=max(0.0, room_s / 2.0),
        pulses=pulses,
        seconds=None if pulses is None else pulses * nominal_s,
    )


def small_ratio(one: Tag, two: Tag) -> tuple[int, int] | None:
    """Ratio of two tags' intervals if it is 2:1, 3:1 or 3:2; None otherwise.

    At such a ratio of the longer to the shorter interval, the common pulses of both trains fit
    both tags.
    """
    pairs = [
        ((a, _bound_s(one, a)), (b, _bound_s(two, b)))
        for a in one.pulse_intervals_s
        for b in two.pulse_intervals_s
    ]
    for more, fewer in SENDERS.small_ratios:
        for pair in pairs:
            (fast_s, fast_bound_s), (slow_s, slow_bound_s) = sorted(pair)
            bound_s = fewer * slow_bound_s + more * fast_bound_s
            if abs(fewer * slow_s - more * fast_s) <= bound_s:
                return more, fewer
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class IntervalSeparation:
    """How well two tags of one band can be distinguished by their intervals."""

    gap_s: float
    """Difference between the nearest intervals of two tags in one band [s]."""
    certain: bool
    """True if each of two tags, received alone, is identified while its errors are in
    bounds."""
    uncertainty_s: float
    """Interval uncertainty in the tag list below which both tags are identified [s]."""
    pulses: int | None
    """Number of pulses needed to distinguish the intervals; None if the intervals drift by more
    than they differ."""
    seconds: float | None


@dataclass(frozen=True, slots=True)
class _Learnt:
    """Measured interval of a tag, stored for later decisions."""

    scale: float
    bound: float
    """Relative uncertainty of the tag's measured interval."""
    otherwise_ns: float | None = None
    """Time at which the tag was first received with an interval other than the stored one [ns];
    None: never."""


class ConfirmedPulses:
    """Pulses of confirmed trains in the last 40 s, which no detector counts as other bursts."""

    def __init__(self) -> None:
        self._pulses: dict[int, tuple[float, float]] = {}
        """Absolute frequency [Hz] and power of each confirmed pulse, by its time [ns]."""
        self._times_ns = np.zeros(0, np.int64)
        """Times of the stored confirmed pulses [ns], as an array."""
        self._how = np.zeros((0, 2))

    def update(self, detectors: Iterable[FollowingDetector]) -> None:
        """Add the pulses of the detectors' confirmed tracks."""
        for detector in detectors:
            for track in detector.tracks:
                if not track.confirmed or track.dead:
                    continue
                frequency_hz = detector.absolute_hz(track)
                for slot in track.received:
                    self._pulses[slot.time_ns] = frequency_hz, slot.measured.power
        if self._pulses:
            since_ns = max(self._pulses) - SENDERS.kept_ns
            self._pulses = {at: how for at, how in self._pulses.items() if at >= since_ns}
            self._times_ns = np.array(list(self._pulses), np.int64)
            self._how = np.array(list(self._pulses.values()))

    def at_frequencies(
        self, wanted: Callable[[NDArray[np.float64]], NDArray[np.bool_]]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Times [ns], and (frequency [Hz], power), of pulses at the `wanted` frequencies."""
        some = wanted(self._how[:, 0])
        return self._times_ns[some], self._how[some]


class Senders(Generic[H]):
    """Assigns trains to the tags of detectors with overlapping bands."""

    def __init__(self, detectors: Sequence[H]) -> None:
        self.detectors = sorted(detectors, key=lambda detector: detector.tag.tag_id)
        self._learnt: dict[int, _Learnt] = {}
        self._by_tag = {detector.tag.tag_id: detector for detector in self.detectors}
        self._by_frequency = sorted(
            self.detectors, key=lambda detector: detector.tag.frequency_hz
        )
        self._frequencies_hz = [detector.tag.frequency_hz for detector in self._by_frequency]
        self._rate_hz = max(detector.sample_rate_hz for detector in self.detectors)
        # Locked or not, a search stays within the window around the tag's frequency.
        self._reach_hz = 1.0 + max(
            2.0 * h.half_width_hz + 1.0 / h.tag.pulse_width_s for h in self.detectors
        )
        self._near_ns = 0.75e9 * max(detector.tag.pulse_width_s for detector in self.detectors)
        self._last_properties: list[_Properties] = []
        """Properties of all trains when they were last assigned to tags."""
        self._last_assignment: list[_Assignment] = []
        self.confirmed_pulses = ConfirmedPulses()

    def settle(self) -> None:
        """Assign each train to a tag, and let the detectors report their pulses."""
        if not any(detector.tracks for detector in self.detectors):
            return
        self.confirmed_pulses.update(self.detectors)
        trains = merge_tracks(self.detectors)
        # A ghost belongs to no tag, but the detector of the one tag reports it.
        ghosts = [t for t in trains if any(track.ghost_of is not None for _, track in t.tracks)]
        nobodys = {id(train) for train in ghosts}
        nobodys |= {id(train) for train in made_of_other_trains(trains, near_ns=self._near_ns)}
        # A likely train has no share yet, but takes its place from what else may be its tag's.
        able = [t for t in trains if t.likely and id(t) not in nobodys]
        given = self._assign_trains(self._latest(able))
        if self._drop_begun_by_others(trains, given):
            trains = [train for train in trains if train.tracks]
            given = [share for share in given if share[0].tracks]
        owned = {tag_id: not others for _, tag_id, others, _ in given}
        for train, tag_id, others, sure in given:
            _assign(train, tag_id, others)
            # Learn an interval only from a confirmed train without competing tags.
            if sure and not others:
                self._learn(train, tag_id)
        shared = {id(train) for train, *_ in given}
        for train in trains:
            if id(train) in shared:
                continue
            if train.confirmed:
                _assign(train, None, ())
            else:
                self._assign_tentative(train, owned)
        self._report()

    def _drop_begun_by_others(
        self, trains: list[Train[H]], given: list[tuple[Train[H], int, tuple[int, ...], bool]]
    ) -> bool:
        """Drop tracks begun or confirmed only by pulses of other tags; return True if any were.

        One strong pulse, with the largest noise one interval before and after it, makes a group
        for any tag. A second strong pulse at one of its expected times would confirm the group.
        """
        dropped: set[int] = set()
        unsettled = [
            (detector, track, slots)
            for detector in self.detectors
            for track in detector.tracks
            if (slots := _unsettled_pulses(track))
        ]
        for train, tag_id, *_ in given if unsettled else ():
            # Trains that may be the detector's own tag are assigned by interval and frequency.
            others = [
                (detector, track, slots)
                for detector, track, slots in unsettled
                if detector.tag.tag_id != tag_id
                and abs(detector.absolute_hz(track) - train.frequency_hz) < self._reach_hz
                and self._likelihood(train, detector) == -math.inf
            ]
            known = known_pulses(train) if others else []
            for detector, track, slots in others:
                at_hz, width_s = detector.absolute_hz(track), track.tag.pulse_width_s
                if all(
                    any(
                        pulse.explains(slot, at_hz, width_s, near_ns=self._near_ns)
                        for pulse in known
                    )
                    for slot in slots
                ):
                    dropped.add(id(track))
        if dropped:
            for detector in self.detectors:
                detector.tracks[:] = [t for t in detector.tracks if id(t) not in dropped]
            for train in trains:
                train.tracks = [pair for pair in train.tracks if id(pair[1]) not in dropped]
        return bool(dropped)

    def _report(self) -> None:
        pairs = [(detector, track) for detector in self.detectors for track in detector.tracks]
        done = _Reported[H]()
        for detector, track in pairs:
            if track.confirmed:
                done.add(detector, track, _reported_ns(track))
        # The train received longest is least likely to have other trains' pulses.
        for detector, track in sorted(pairs, key=lambda pair: -len(pulse_times_ns(pair[1]))):
            if not track.held:
                for times_ns in done.near(detector, track):
                    _mark_reported(track, times_ns)
            before = set(_reported_ns(track))
            detector.report(track)
            if track.confirmed and not track.held:
                done.add(detector, track, [t for t in _reported_ns(track) if t not in before])

    def _latest(self, trains: list[Train[H]]) -> list[Train[H]]:
        some = sorted(trains, key=lambda train: train.frequency_hz)
        frequencies_hz = [train.frequency_hz for train in some]
        left = []
        for train in some:
            begin = bisect_left(frequencies_hz, train.frequency_hz - self._reach_hz)
            end = bisect_right(frequencies_hz, train.frequency_hz + self._reach_hz)
            later = sum(other.last_pulse_ns > train.last_pulse_ns for other in some[begin:end])
            if later < SENDERS.most_trains:
                left.append(train)
        return sorted(left, key=lambda train: -train.last_pulse_ns)

    def _assign_trains(
        self, trains: list[Train[H]]
    ) -> list[tuple[Train[H], int, tuple[int, ...], bool]]:
        """Assign trains; reuse the last assignment while their properties are unchanged."""
        picture = [_properties(train) for train in trains]
        if picture != self._last_properties:
            self._last_properties, self._last_assignment = picture, self._assign_again(trains)
        return [
            (trains[at], to, others, sure) for at, to, others, sure in self._last_assignment
        ]

    def _assign_again(self, trains: list[Train[H]]) -> list[_Assignment]:
        likely = [self._likely(train) for train in trains]
        shares = []
        for part in parts(likely):
            some = self._assign_part([trains[at] for at in part], [likely[at] for at in part])
            shares += [(part[at], to, others, sure) for at, to, others, sure in some]
        return shares

    def _assign_part(
        self, trains: list[Train[H]], likely: list[dict[int, float]]
    ) -> list[_Assignment]:
        behind = losses(likely, best_assignment(likely))
        able: list[dict[int, float]] = []
        possible: list[list[int]] = []
        for at, train in enumerate(trains):
            followers = {h.tag.tag_id: t for h, t in train.tracks if t.confirmed}
            possible.append(
                [i for i, loss in behind[at].items() if loss <= SENDERS.ruled_out_log]
            )
            # The likeliest may not have found the train yet; wait if no other is possible.
            able.append(
                {
                    i: likely[at][i] + (0.0 if followers[i].held else SENDERS.stay_log)
                    for i in possible[at]
                    if i in followers
                }
            )
        sure = all(train.confirmed for train in trains)
        return [
            (at, to, tuple(i for i in possible[at] if i != to), sure)
            for at, to in enumerate(best_assignment(able))
            if to is not None
        ]

    def _likely(self, train: Train[H]) -> dict[int, float]:
        """Log-likelihood of a train for each possible tag, plus a bonus over having no tag."""
        values = {h.tag.tag_id: self._likelihood(train, h) for h in self._near(train)}
        return {
            i: value + SENDERS.any_tag_log for i, value in values.items() if value > -math.inf
        }

    def _near(self, train: Train[H]) -> list[H]:
        reach_hz, rate_hz = self._reach_hz, self._rate_hz
        places: set[int] = set()
        for alias_hz in (-rate_hz, 0.0, rate_hz):
            low_hz = train.frequency_hz + alias_hz - reach_hz
            begin = bisect_left(self._frequencies_hz, low_hz)
            places.update(
                range(begin, bisect_right(self._frequencies_hz, low_hz + 2.0 * reach_hz))
            )
        near = [self._by_frequency[place] for place in places]
        return sorted(near, key=lambda detector: detector.tag.tag_id)

    def _assign_tentative(self, train: Train[H], owned: dict[int, bool]) -> None:
        """Assign an unconfirmed train to the likeliest tag that has no train in `owned`."""
        likely = {h.tag.tag_id: self._likelihood(train, h) for h, _ in train.tracks}
        free = {i: v for i, v in likely.items() if i not in owned and v > -math.inf}
        if not free:
            _assign(train, None, ())
            return
        tag_id = min(free, key=lambda i: (-free[i], i))
        least = free[tag_id] - SENDERS.ruled_out_log
        others = [
            h.tag.tag_id
            for h in self._near(train)
            if h.tag.tag_id != tag_id
            and not owned.get(h.tag.tag_id, False)
            and self._likelihood(train, h) > least
        ]
        _assign(train, tag_id, tuple(others))

    def _likelihood(self, train: Train[H], detector: FollowingDetector) -> float:
        if not detector.may_be_at(train.frequency_hz):
            return -math.inf
        tag = detector.tag
        sigma_hz = min(detector.half_width_hz, CHANNEL.usual_error_hz) / SENDERS.bound_sigmas
        miss_hz = train.frequency_hz - tag.frequency_hz
        learnt = self._learnt.get(tag.tag_id)
        best = -math.inf
        for nominal_s in tag.pulse_intervals_s:
            bound_s = _bound_s(tag, nominal_s)
            value = _normal(train, nominal_s, bound_s)
            if learnt is not None and value > -math.inf:
                # A learned interval may be wrong, or no longer valid.
                value -= SENDERS.ruled_out_log
                known_s = nominal_s * learnt.scale
                value = max(value, _normal(train, known_s, learnt.bound * nominal_s))
            best = max(best, value)
        return best - 0.5 * min((miss_hz / sigma_hz) ** 2, SENDERS.most_miss)

    def _learn(self, train: Train[H], tag_id: int) -> None:
        tag = self._by_tag[tag_id].tag
        nominal_s = min(tag.pulse_intervals_s, key=lambda s: abs(s - train.interval_s))
        bound = SENDERS.interval_drift + SENDERS.bound_sigmas * train.sigma_s / nominal_s
        if bound * nominal_s >= _bound_s(tag, nominal_s):
            return
        scale = train.interval_s / nominal_s
        known = self._learnt.get(tag_id)
        if known is not None and abs(scale - known.scale) > known.bound + bound:
            # Where trains cross, a track may change to another animal step by step.
            since_ns = train.last_pulse_ns if known.otherwise_ns is None else known.otherwise_ns
            if train.last_pulse_ns - since_ns < SENDERS.relearn_ns:
                self._learnt[tag_id] = replace(known, otherwise_ns=since_ns)
                return
        self._learnt[tag_id] = _Learnt(scale, bound)


def _properties(train: Train[H]) -> _Properties:
    """Properties of a train that affect which tag it is assigned to, rounded."""
    return (
        round(train.interval_s, 3),
        round(train.sigma_s, 3),
        round(train.frequency_hz, -1),
        tuple(sorted((h.tag.tag_id, t.held) for h, t in train.tracks if t.confirmed)),
    )


def _bound_s(tag: Tag, nominal_s: float) -> float:
    shortest_s = min(tag.pulse_intervals_s)
    return tag.interval_uncertainty_s * nominal_s / shortest_s + BOUNDS.clock_error * nominal_s


def _normal(train: Train[H], center_s: float, bound_s: float) -> float:
    """Log-density of a train's interval, given a tag's interval and bound; -inf outside it."""
    miss_s = abs(train.interval_s - center_s)
    if miss_s > bound_s + SENDERS.interval_sigmas * train.sigma_s:
        return -math.inf
    sigma_s = math.hypot(bound_s / SENDERS.bound_sigmas, train.sigma_s)
    return -0.5 * (miss_s / sigma_s) ** 2 - math.log(sigma_s)


def _unsettled_pulses(track: Track) -> list[Slot]:
    """Pulses by which a track began or was just confirmed; none once a tag is assigned."""
    if track.dead or track.confirmed_at_assignment:
        return []
    accepted = track.received
    if track.confirmed and track.tested:
        return [slot for slot in accepted[-1:] if slot.number >= track.tag.k]
    return accepted


def _reported_ns(track: Track) -> list[int]:
    return [slot.time_ns for slot in track.slots if slot.state == "reported"]


def _assign(train: Train[H], tag_id: int | None, others: tuple[int, ...]) -> None:
    reported_ns = [
        slot.time_ns
        for detector, track in train.tracks
        if detector.tag.tag_id != tag_id
        for slot in track.slots
        if slot.state == "reported"
    ]
    mine = [t for h, t in train.tracks if h.tag.tag_id == tag_id]
    # Of two tracks of one detector take the confirmed one, then the one received last.
    best = max(mine, key=lambda t: (t.confirmed, t.last_accepted_s), default=None)
    for _, track in train.tracks:
        begins = track is best and track.held
        track.held = track is not best or (track.clashing and not track.confirmed)
        track.alternatives = others if track is best else ()
        track.confirmed_at_assignment = track.confirmed
        if begins and not track.held:
            _mark_reported(track, reported_ns)


class _Reported(Generic[H]):
    """Pulses reported so far, indexed by frequency for a fast search."""

    def __init__(self) -> None:
        self._places: dict[int, list[tuple[H, float, list[int]]]] = {}

    def add(self, detector: H, track: Track, times_ns: list[int]) -> None:
        if times_ns:
            at_hz = detector.absolute_hz(track)
            place = math.floor(at_hz / BOUNDS.same_transmitter_hz)
            self._places.setdefault(place, []).append((detector, at_hz, times_ns))

    def near(self, detector: H, track: Track) -> Iterator[list[int]]:
        """Times of pulses that other detectors reported at a track's frequency [ns]."""
        here_hz = detector.absolute_hz(track)
        middle = math.floor(here_hz / BOUNDS.same_transmitter_hz)
        for place in range(middle - 1, middle + 2):
            for other, at_hz, times_ns in self._places.get(place, ()):
                if other is not detector and abs(at_hz - here_hz) < BOUNDS.same_transmitter_hz:
                    yield times_ns


def _mark_reported(track: Track, reported_ns: Iterable[int]) -> None:
    near_ns = 0.75e9 * track.tag.pulse_width_s
    times = list(reported_ns)
    for slot in track.slots:
        if slot.state == "accepted" and any(
            abs(slot.time_ns - time_ns) < near_ns for time_ns in times
        ):
            slot.state = "reported"
