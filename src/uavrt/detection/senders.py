"""Which of the listed tags sent a train of pulses, where several could have.

Detectors whose bands overlap hear the same pulses, and each would take them for its own tag's.
Here their tracks are put together: tracks of the same pulses are one train, and each train is
given to one tag, each tag one train, by interval and frequency. A declared uncertainty is read
as three standard deviations of a normal error, and as a bound. Where another tag is no less
than a twentieth as likely, its number stands beside the pulses' own. What was measured of a
tag's interval while nothing else could have sent it is kept, and decides later.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

from uavrt.detection.report import SAME_FREQUENCY_HZ
from uavrt.detection.sharing import best_sharing, losses, parts
from uavrt.detection.tracks import CLOCK_ERROR, Track
from uavrt.messages import Tag

CERTAIN = math.log(20.0)
"""Another tag is ruled out when it is so much less likely (log of the ratio)."""
INTERVAL_DRIFT = 2e-3
"""Relative change of a tag's interval within a flight that what was learnt must allow for. The
crystals and oscillators of tags keep to 1e-4 and 1e-3 over the temperatures of a day."""
_SIGMAS = 2.5
"""Of the measured interval, beyond a tag's bound."""
_BOUND_SIGMAS = 3.0
"""A declared bound in standard deviations of the error behind it."""
_USUAL_HZ = 500.0
"""Tags are off by no more, however wide the search is."""
_MOST_MISS = 30.0
"""Squared standard deviations of a frequency: the search goes as far as it was told to."""
_STAYS = 1.0
"""A train stays with its tag until another is so much likelier (log of the ratio)."""
_GIVEN = 50.0
"""Worth of giving a train to any tag: more than all that tells tags apart."""
_RELEARN_NS = 60e9
"""So long a tag must be heard with another interval than was learnt before that is given up."""
_MOST_TRAINS = 6
"""Trains of one band at most that are shared out: those heard last."""
_LIKELY = -6.0
"""Log odds of a track that is about to be confirmed: it is taken for bursts while another train
is not sure, whose pulses are counted as such. Groups are reported from about there on."""
_REMEMBERED_NS = 40_000_000_000
"""Pulses of confirmed trains are known for so long: longer than bursts are remembered."""
_SAME_SHARE = 2.0 / 3.0
"""So many pulses of two tracks are the same when they are one train; less is a collision."""


class Hearer(Protocol):
    """What is needed of a detector."""

    tag: Tag
    sample_rate_hz: float

    @property
    def tracks(self) -> list[Track]:
        """All that it follows."""

    def absolute_hz(self, track: Track) -> float:
        """Frequency of a track."""

    def time_ns(self, time_s: float) -> float:
        """Time of its tracks' seconds."""

    def could_be(self, frequency_hz: float) -> bool:
        """Whether it searches there for its tag."""

    @property
    def now_s(self) -> float:
        """Up to when it has searched, in its tracks' seconds."""

    @property
    def half_width_hz(self) -> float:
        """Of its search."""

    def report(self, track: Track) -> None:
        """Tell a track's pulses, if it is not held."""


H = TypeVar("H", bound=Hearer)
_Figures = tuple[float, float, float, tuple[tuple[int, bool], ...]]
"""Interval, its deviation, frequency, and the detectors that follow a train, held or not."""
_Share = tuple[int, int, tuple[int, ...]]
"""Place of a train, number of its tag, numbers of others that it may be."""


def part(one: Tag, two: Tag) -> "Parting":
    """Say how far the intervals of two tags tell them apart, heard alone.

    Parameters
    ----------
    one, two : Tag

    Returns
    -------
    Parting
    """
    pairs = [(a, b) for a in one.pulse_intervals_s for b in two.pulse_intervals_s]
    gap_s, nominal_s = min((abs(a - b), max(a, b)) for a, b in pairs)
    room_s = gap_s - 2.0 * CLOCK_ERROR * nominal_s
    jitter_s = max(one.interval_jitter_s, two.interval_jitter_s)
    width_s = max(one.pulse_width_s, two.pulse_width_s)
    # Of a pulse of 13 dB; the jitter is uniform.
    error_s = math.hypot(0.08 * width_s, jitter_s / math.sqrt(3.0))
    pulses = None
    if gap_s > 2.0 * INTERVAL_DRIFT * nominal_s:
        # A straight line through n times: sigma of its slope is error sqrt(12 / n^3).
        least = (12.0 * (2.0 * _SIGMAS * error_s / gap_s) ** 2) ** (1.0 / 3.0)
        pulses = max(2, one.k, two.k, math.ceil(least))
    declared_s = one.interval_uncertainty_s + two.interval_uncertainty_s
    return Parting(
        gap_s=gap_s,
        certain=declared_s < room_s,
        uncertainty_s=max(0.0, room_s / 2.0),
        pulses=pulses,
        seconds=None if pulses is None else pulses * nominal_s,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Parting:
    """What tells two tags of one band apart."""

    gap_s: float
    """Between their nearest intervals."""
    certain: bool
    """Whether one heard alone is told from the other whatever its error within its bound."""
    uncertainty_s: float
    """With less than this declared for each they are."""
    pulses: int | None
    """So many pulses measure the gap; None: it is less than tags drift, nothing parts them."""
    seconds: float | None
    """What that takes."""


@dataclass(slots=True)
class _Train:
    """Pulses of one transmitter, as one or several detectors follow them."""

    tracks: list[tuple[Hearer, Track]]
    interval_s: float = 0.0
    sigma_s: float = 0.0
    frequency_hz: float = 0.0
    confirmed: bool = False
    likely: bool = False
    """Whether it is no noise, and hardly an accident of bursts."""
    heard_ns: float = 0.0

    def weigh_up(self) -> None:
        """Take the best of what the tracks know."""
        # What is not confirmed yet says nothing of a train that is.
        sure = [pair for pair in self.tracks if pair[1].confirmed] or self.tracks
        shortest = min(track.interval_s for _, track in sure)
        # One of twice the interval has every second pulse.
        some = [pair for pair in sure if pair[1].interval_s < 1.2 * shortest]
        hearer, best = min(some, key=lambda pair: (pair[1].variance[2], pair[0].tag.tag_id))
        self.interval_s = best.interval_s
        self.sigma_s = math.sqrt(max(best.variance[2], 0.0))
        self.frequency_hz = hearer.absolute_hz(best)
        self.confirmed = any(track.confirmed for _, track in self.tracks)
        self.likely = self.confirmed or any(
            track.stands_out and track.odds > _LIKELY for _, track in self.tracks
        )
        self.heard_ns = max(h.time_ns(t.last_accepted_s) for h, t in self.tracks)


@dataclass(frozen=True, slots=True)
class _Learnt:
    """What was measured of a tag's interval."""

    scale: float
    """To the nominal one."""
    bound: float
    """Relative."""
    otherwise_ns: float | None = None
    """Since when the tag was heard with another interval."""


class Senders(Generic[H]):
    """Shares out trains among the tags of detectors with overlapping bands.

    Parameters
    ----------
    hearers : sequence of Hearer
        The detectors; their order says nothing.
    """

    def __init__(self, hearers: Sequence[H]) -> None:
        self.hearers = sorted(hearers, key=lambda hearer: hearer.tag.tag_id)
        self._learnt: dict[int, _Learnt] = {}
        self._by_tag = {hearer.tag.tag_id: hearer for hearer in self.hearers}
        self._by_frequency = sorted(self.hearers, key=lambda hearer: hearer.tag.frequency_hz)
        self._frequencies_hz = [hearer.tag.frequency_hz for hearer in self._by_frequency]
        self._rate_hz = max(hearer.sample_rate_hz for hearer in self.hearers)
        # Locked or not, a search stays within its window around the tag's frequency.
        self._reach_hz = 1.0 + max(
            2.0 * h.half_width_hz + 1.0 / h.tag.pulse_width_s for h in self.hearers
        )
        self._picture: list[_Figures] = []
        """By which figures trains were shared out last, and how."""
        self._shared: list[_Share] = []
        self.heard: dict[int, tuple[float, float]] = {}
        """Pulses of confirmed trains lately heard, by time [ns]: absolute frequency and power.
        They are no bursts to any tag."""

    def settle(self) -> None:
        """Give each train to one tag, and have the detectors tell what is theirs."""
        if not any(hearer.tracks for hearer in self.hearers):
            return
        self._remember()
        trains = self._trains()
        # A ghost is nobody's, but the detector of the one tag tells of it.
        ghosts = [t for t in trains if any(track.ghost_of is not None for _, track in t.tracks)]
        nobodys = {id(train) for train in ghosts}
        # A likely train has no share yet, but takes its place from what else may be its tag's.
        able = [t for t in trains if t.likely and id(t) not in nobodys]
        given = self._share_out(self._heard_last(able))
        owned = {tag_id: not others for _, tag_id, others in given}
        for train, tag_id, others in given:
            _give(train, tag_id, others)
            if not others:
                self._learn(train, tag_id)
        shared = {id(train) for train, _, _ in given}
        for train in trains:
            if id(train) in shared:
                continue
            if train.confirmed:
                _give(train, None, ())
            else:
                self._give_tentative(train, owned)
        self._report()

    def _report(self) -> None:
        """Have the detectors tell their pulses, each pulse under one tag's number."""
        pairs = [(hearer, track) for hearer in self.hearers for track in hearer.tracks]
        told = [
            (hearer, hearer.absolute_hz(track), _reported_ns(track))
            for hearer, track in pairs
            if track.confirmed
        ]
        # What was heard longest is least likely to have others' pulses.
        for hearer, track in sorted(pairs, key=lambda pair: -len(_heard_ns(pair[1]))):
            if not track.held:
                here_hz = hearer.absolute_hz(track)
                for other, at_hz, times_ns in told:
                    if other is not hearer and abs(at_hz - here_hz) < SAME_FREQUENCY_HZ:
                        _pass_over(track, times_ns)
            before = set(_reported_ns(track))
            hearer.report(track)
            if track.confirmed and not track.held:
                new = [t for t in _reported_ns(track) if t not in before]
                told.append((hearer, hearer.absolute_hz(track), new))

    def _remember(self) -> None:
        """Keep the times of what is certainly a tag's."""
        for hearer in self.hearers:
            for track in hearer.tracks:
                if not track.confirmed or track.dead:
                    continue
                frequency_hz = hearer.absolute_hz(track)
                for slot in track.slots:
                    if slot.state in ("accepted", "reported"):
                        self.heard[slot.time_ns] = frequency_hz, slot.measured.power
        if self.heard:
            since_ns = max(self.heard) - _REMEMBERED_NS
            self.heard = {at: how for at, how in self.heard.items() if at >= since_ns}

    def _trains(self) -> list[_Train]:
        """Put the tracks of the same pulses together."""
        trains: list[_Train] = []
        near: dict[int, list[tuple[H, Track, int]]] = {}
        """Tracks by frequency, each with the place of its train."""
        for hearer in self.hearers:
            for track in hearer.tracks:
                if track.dead or not _is_active(track, hearer.now_s):
                    continue
                place = math.floor(hearer.absolute_hz(track) / SAME_FREQUENCY_HZ)
                others = [o for at in (-1, 0, 1) for o in near.get(place + at, ())]
                others.sort(key=lambda other: other[2])
                mate = next(
                    (at for h, t, at in others if _are_one(hearer, track, h, t)), len(trains)
                )
                if mate == len(trains):
                    trains.append(_Train([]))
                trains[mate].tracks.append((hearer, track))
                near.setdefault(place, []).append((hearer, track, mate))
        for train in trains:
            train.weigh_up()
        return trains

    def _heard_last(self, trains: list[_Train]) -> list[_Train]:
        """Of the trains that could be one tag's by frequency those heard last."""
        some = sorted(trains, key=lambda train: train.frequency_hz)
        frequencies_hz = [train.frequency_hz for train in some]
        left = []
        for train in some:
            begin = bisect_left(frequencies_hz, train.frequency_hz - self._reach_hz)
            end = bisect_right(frequencies_hz, train.frequency_hz + self._reach_hz)
            later = sum(other.heard_ns > train.heard_ns for other in some[begin:end])
            if later < _MOST_TRAINS:
                left.append(train)
        return sorted(left, key=lambda train: -train.heard_ns)

    def _share_out(self, trains: list[_Train]) -> list[tuple[_Train, int, tuple[int, ...]]]:
        """Share out trains: each with its tag and the others that it may be."""
        picture = [_figures(train) for train in trains]
        if picture != self._picture:
            self._picture, self._shared = picture, self._share_out_anew(trains)
        return [(trains[at], tag_id, others) for at, tag_id, others in self._shared]

    def _share_out_anew(self, trains: list[_Train]) -> list[_Share]:
        """Share out the trains, those that compete together."""
        likely = [self._likely(train) for train in trains]
        shares = []
        for part in parts(likely):
            some = self._share_out_part(
                [trains[at] for at in part], [likely[at] for at in part]
            )
            shares += [(part[at], tag_id, others) for at, tag_id, others in some]
        return shares

    def _share_out_part(
        self, trains: list[_Train], likely: list[dict[int, float]]
    ) -> list[_Share]:
        """Share out trains that compete; `likely` is with the worth of any tag."""
        behind = losses(likely, best_sharing(likely))
        able: list[dict[int, float]] = []
        possible: list[list[int]] = []
        for at, train in enumerate(trains):
            followers = {h.tag.tag_id: t for h, t in train.tracks if t.confirmed}
            possible.append([i for i, loss in behind[at].items() if loss <= CERTAIN])
            # The likeliest may not have found it yet; if nothing else can be, it is waited for.
            able.append(
                {
                    i: likely[at][i] + (0.0 if followers[i].held else _STAYS)
                    for i in possible[at]
                    if i in followers
                }
            )
        return [
            (at, to, tuple(i for i in possible[at] if i != to))
            for at, to in enumerate(best_sharing(able))
            if to is not None
        ]

    def _likely(self, train: _Train) -> dict[int, float]:
        """Log-likelihood of a train for each tag that it may be, and what any tag is worth."""
        values = {h.tag.tag_id: self._likelihood(train, h) for h in self._near(train)}
        return {i: value + _GIVEN for i, value in values.items() if value > -math.inf}

    def _near(self, train: _Train) -> list[H]:
        """Detectors in whose band a train may be, by the numbers of their tags."""
        reach_hz, rate_hz = self._reach_hz, self._rate_hz
        places: set[int] = set()
        for alias_hz in (-rate_hz, 0.0, rate_hz):
            low_hz = train.frequency_hz + alias_hz - reach_hz
            begin = bisect_left(self._frequencies_hz, low_hz)
            places.update(
                range(begin, bisect_right(self._frequencies_hz, low_hz + 2.0 * reach_hz))
            )
        near = [self._by_frequency[place] for place in places]
        return sorted(near, key=lambda hearer: hearer.tag.tag_id)

    def _give_tentative(self, train: _Train, owned: dict[int, bool]) -> None:
        """Give a train that is not certain yet to the likeliest tag that has none.

        Parameters
        ----------
        train : _Train
        owned : dict of int to bool
            Tags that have a train, and whether it is certainly theirs.
        """
        likely = {h.tag.tag_id: self._likelihood(train, h) for h, _ in train.tracks}
        free = {i: v for i, v in likely.items() if i not in owned and v > -math.inf}
        if not free:
            _give(train, None, ())
            return
        tag_id = min(free, key=lambda i: (-free[i], i))
        least = free[tag_id] - CERTAIN
        others = [
            h.tag.tag_id
            for h in self._near(train)
            if h.tag.tag_id != tag_id
            and not owned.get(h.tag.tag_id, False)
            and self._likelihood(train, h) > least
        ]
        _give(train, tag_id, tuple(others))

    def _likelihood(self, train: _Train, hearer: Hearer) -> float:
        """Log-likelihood of a train's interval and frequency if a tag sent it."""
        if not hearer.could_be(train.frequency_hz):
            return -math.inf
        tag = hearer.tag
        sigma_hz = min(hearer.half_width_hz, _USUAL_HZ) / _BOUND_SIGMAS
        miss_hz = train.frequency_hz - tag.frequency_hz
        learnt = self._learnt.get(tag.tag_id)
        best = -math.inf
        for nominal_s in tag.pulse_intervals_s:
            bound_s = _bound_s(tag, nominal_s)
            value = _normal(train, nominal_s, bound_s)
            if learnt is not None and value > -math.inf:
                # What was learnt may be wrong, or no longer hold.
                value -= CERTAIN
                known_s = nominal_s * learnt.scale
                value = max(value, _normal(train, known_s, learnt.bound * nominal_s))
            best = max(best, value)
        return best - 0.5 * min((miss_hz / sigma_hz) ** 2, _MOST_MISS)

    def _learn(self, train: _Train, tag_id: int) -> None:
        """Keep the interval of a tag that nothing else can be."""
        tag = self._by_tag[tag_id].tag
        nominal_s = min(tag.pulse_intervals_s, key=lambda s: abs(s - train.interval_s))
        bound = INTERVAL_DRIFT + _BOUND_SIGMAS * train.sigma_s / nominal_s
        if bound * nominal_s >= _bound_s(tag, nominal_s):
            return
        scale = train.interval_s / nominal_s
        known = self._learnt.get(tag_id)
        if known is not None and abs(scale - known.scale) > known.bound + bound:
            # Where trains cross, a track may change over to another animal, step by step.
            since_ns = train.heard_ns if known.otherwise_ns is None else known.otherwise_ns
            if train.heard_ns - since_ns < _RELEARN_NS:
                self._learnt[tag_id] = replace(known, otherwise_ns=since_ns)
                return
        self._learnt[tag_id] = _Learnt(scale, bound)


def _figures(train: _Train) -> _Figures:
    """All that matters of a train when it is shared out, so far as it does."""
    return (
        round(train.interval_s, 3),
        round(train.sigma_s, 3),
        round(train.frequency_hz, -1),
        tuple(sorted((h.tag.tag_id, t.held) for h, t in train.tracks if t.confirmed)),
    )


def _bound_s(tag: Tag, nominal_s: float) -> float:
    """Largest error of an interval as declared; one crystal makes both rates."""
    shortest_s = min(tag.pulse_intervals_s)
    return tag.interval_uncertainty_s * nominal_s / shortest_s + CLOCK_ERROR * nominal_s


def _normal(train: _Train, center_s: float, bound_s: float) -> float:
    """Log-density of a train's interval around one with a bound; none beyond it."""
    miss_s = abs(train.interval_s - center_s)
    if miss_s > bound_s + _SIGMAS * train.sigma_s:
        return -math.inf
    sigma_s = math.hypot(bound_s / _BOUND_SIGMAS, train.sigma_s)
    return -0.5 * (miss_s / sigma_s) ** 2 - math.log(sigma_s)


def _is_active(track: Track, now_s: float) -> bool:
    """Whether a track is no mere memory; a tentative one always is."""
    return not track.confirmed or now_s - track.last_accepted_s < 5.0 * track.interval_s


def _are_one(one_at: Hearer, one: Track, two_at: Hearer, two: Track) -> bool:
    """Whether two tracks follow the same pulses."""
    apart_hz = abs(one_at.absolute_hz(one) - two_at.absolute_hz(two))
    if apart_hz > SAME_FREQUENCY_HZ:
        return False
    near_ns = 0.75e9 * max(one.tag.pulse_width_s, two.tag.pulse_width_s)
    ones, twos = _heard_ns(one), _heard_ns(two)
    if ones and twos:
        first, last = max(ones[0], twos[0]) - near_ns, min(ones[-1], twos[-1]) + near_ns
        ones = [t for t in ones if first <= t <= last]
        twos = [t for t in twos if first <= t <= last]
        fewer = min(len(ones), len(twos))
        if fewer > 1:
            shared = sum(any(abs(a - b) < near_ns for b in twos) for a in ones)
            return shared >= _SAME_SHARE * fewer
    # Too little in common: compare the places at which they expect their pulses.
    interval_ns = 1e9 * min(one.interval_s, two.interval_s)
    apart_ns = one_at.time_ns(one.time_s) - two_at.time_ns(two.time_s)
    return abs(math.remainder(apart_ns, interval_ns)) < near_ns / 2.0


def _heard_ns(track: Track) -> list[int]:
    return [slot.time_ns for slot in track.slots if slot.state in ("accepted", "reported")]


def _reported_ns(track: Track) -> list[int]:
    return [slot.time_ns for slot in track.slots if slot.state == "reported"]


def _give(train: _Train, tag_id: int | None, others: tuple[int, ...]) -> None:
    """Have one detector tell of a train, and the others be silent."""
    told = [
        slot.time_ns
        for hearer, track in train.tracks
        if hearer.tag.tag_id != tag_id
        for slot in track.slots
        if slot.state == "reported"
    ]
    mine = [t for h, t in train.tracks if h.tag.tag_id == tag_id]
    # Of two that one detector follows the one that is certain, then the one heard last.
    best = max(mine, key=lambda t: (t.confirmed, t.last_accepted_s), default=None)
    for _, track in train.tracks:
        begins = track is best and track.held
        track.held = track is not best or (track.clashing and not track.confirmed)
        track.alternatives = others if track is best else ()
        track.shared_as_confirmed = track.confirmed
        if begins and not track.held:
            _pass_over(track, told)


def _pass_over(track: Track, told_ns: Iterable[int]) -> None:
    """Leave out the pulses that were told under another tag's number."""
    near_ns = 0.75e9 * track.tag.pulse_width_s
    times = list(told_ns)
    for slot in track.slots:
        if slot.state == "accepted" and any(
            abs(slot.time_ns - time_ns) < near_ns for time_ns in times
        ):
            slot.state = "reported"
