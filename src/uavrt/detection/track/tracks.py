"""Track a tag from pulse to pulse, even if pulses are missed.

A track estimates the phase and the interval of the pulses by a Kalman filter, and their
frequency. The next pulse is expected within narrow limits of time and frequency. So its
threshold is lower than that of the search, by 1.3 dB or more at K = 3.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Literal

from uavrt.core.messages import Tag
from uavrt.detection.search.refine import Measured, timing_error_s
from uavrt.detection.search.thresholds import finer_times, group_tail
from uavrt.detection.search.tuning import MEASURE
from uavrt.detection.track.chance import QUIET, BurstRates, log_begin, log_empty, log_odds
from uavrt.detection.track.tuning import BOUNDS, FOLLOW

SlotState = Literal["open", "accepted", "reported", "missed"]
Around = Callable[["Track", Measured], BurstRates]


@dataclass(slots=True)
class Slot:
    """One expected pulse of a track, and the detection at its time."""

    number: int
    """Number of the expected pulse in its track, from 0 at the first pulse."""
    time_s: float
    time_ns: int
    measured: Measured
    volume: float
    """Number of independent time-frequency cells searched for the expected pulse."""
    state: SlotState = "open"
    disputed: bool = False
    """True if the pulse may belong to either of the tag's two rates."""
    bursts: BurstRates = QUIET
    """Rates of other transmitters' bursts around the time and frequency of the pulse."""
    burst_odds: float = 0.0
    """Log odds that the detection at the expected time is the tag's pulse and not another
    transmitter's burst."""
    tag_odds: float = 0.0
    """Log odds that the detection is the tag's pulse, and neither noise nor another
    transmitter's burst."""

    @property
    def received(self) -> bool:
        """True if the detection is accepted as the tag's pulse, reported or not."""
        return self.state in ("accepted", "reported")


@dataclass(slots=True)
class Track:
    """A tag followed at one rate and frequency; times are from the detector's epoch [s]."""

    tag: Tag
    rate: int
    offset_hz: float
    score: float
    steady_hz: float = 0.0
    """Track's frequency averaged over more pulses than `offset_hz` [Hz]."""
    placed: bool = False
    """True once the track's frequency was chosen among its aliases."""
    drift_hz: float = 0.0
    """Change of the track's frequency per pulse [Hz]."""
    time_s: float = 0.0
    interval_s: float = 0.0
    variance: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    """Covariance of the pulses' phase and interval: phase, cross, interval [s²]."""
    number: int = 0
    """Number of the track's last expected pulse, counted from its first pulse."""
    slots: list[Slot] = field(default_factory=list)
    """Recent expected pulses of the track with their detections, oldest first."""
    past_ns: list[int] = field(default_factory=list)
    """Times of accepted pulses that are no longer in `slots` [ns], for comparison with tracks
    of longer intervals."""
    confirmed: bool = False
    held: bool = False
    """True if no pulse is reported before confirmation, as another track is the tag's."""
    clashing: bool = False
    """True if the track began with a pulse that belongs to another track."""
    alternatives: tuple[int, ...] = ()
    """Ids of other listed tags that may have sent the track's pulses (train_senders.py)."""
    confirmed_at_assignment: bool = False
    """True if the track was confirmed when it was last assigned to a tag."""
    ghost_of: int | None = None
    """Id of the stronger tag if the track is a spurious signal of it (ghosts.py); None
    otherwise."""
    dead: bool = False
    since_accepted: int = 0
    tested: int = 0
    """Number of expected pulses tested after the group of pulses that began the track."""
    gained: float = 0.0
    sequences: dict[int, int] = field(default_factory=dict)
    """Sequence number of each reported group of K pulses, by its place in the track (pulse
    number divided by K)."""
    last_accepted_s: float = 0.0
    odds: float = 0.0
    """Log odds that the track is a tag and not a chance series of bursts."""
    best_odds: float = 0.0
    in_doubt: bool = False
    """True if chance bursts were ever too likely for the track's pulses to be reported."""
    stands_out: bool = False
    """True if noise alone is unlikely to be the cause of the track's pulses."""
    interval_open: bool = False
    """True if the pulses are too few to distinguish the interval from another train's."""
    trust: float = FOLLOW.most_trust
    """Log odds that a confirmed track is a tag; received pulses raise it, missed pulses lower
    it."""
    at_other_rate: "list[Track]" = field(default_factory=list)
    """Tracks of the transmitter at the tag's other rate, if it has switched (two_rates.py)."""
    settled_s: float = -math.inf
    """Time of the last pulse up to which the tag's rate is decided [s]."""
    halves: list[float] = field(default_factory=lambda: [0.0, 0.0])
    """Log odds that the tag sends at even, and at odd, pulse numbers; the weight of old pulses
    decays."""
    certain_s: float = math.inf
    """Time until which the tag's rate is certain [s]; later pulses are not reported yet."""

    def begin(
        self, pulses: list[tuple[int, float, int, Measured]], around: Around = lambda *_: QUIET
    ) -> None:
        """Start a track from a detected group of pulses, each with its number among the K."""
        tag = self.tag
        nominal = tag.pulse_intervals_s[self.rate - 1]
        self.interval_s = nominal
        self._reset_phase(pulses[0][3].power)
        floor = least_real([measured.power for *_, measured in pulses])
        first = next(place for place, _, _, measured in pulses if measured.power >= floor)
        half_s = tag.interval_jitter_s + tag.pulse_width_s / 8.0
        volume = independent_cells(tag, half_s, MEASURE.track_band_hz)
        for number, time_s, time_ns, measured in pulses:
            real = measured.power >= floor
            state: SlotState = "accepted" if real else "missed"
            self.slots.append(Slot(number, time_s, time_ns, measured, 1.0, state))
            self._note_half(number, _against_noise(measured.power, volume))
            if number == first:
                self.number, self.time_s = number, time_s
                self.last_accepted_s = time_s
                self.offset_hz = measured.offset_hz
                self.odds = log_begin(around(self, measured).begin_per_s)
            if not real or number == first:
                continue
            # A noise peak contains no phase information and would bias the interval.
            while self.number < number:
                self._predict()
                self.number += 1
            self.slots[-1].bursts = around(self, measured)
            self.odds += self._odds(self.slots[-1], self.time_s, self.variance[0])
            self._correct(time_s, measured.power)
            self.last_accepted_s = time_s
        while self.number < self.tag.k - 1:
            self._predict()
            self.number += 1
        weights = [min(p[3].power, 100.0) for p in pulses]
        total = sum(w * p[3].offset_hz for w, p in zip(weights, pulses, strict=True))
        self.offset_hz = self.steady_hz = total / sum(weights)
        if len(tag.pulse_intervals_s) > 1:
            self.certain_s = self.last_accepted_s
        sure = [s for s in self.slots if s.measured.power >= FOLLOW.sure_power]
        self.best_odds = self.odds
        self.stands_out = len(sure) >= max(3, self.tag.k)
        self.confirmed = self.stands_out and self.odds >= 0.0
        self.trust = min(FOLLOW.most_trust, FOLLOW.first_trust + max(0.0, self.odds))

    def continue_from(self, slot: Slot, *, interval_s: float, share: float) -> None:
        """Start at a known pulse, with `share` of the interval's declared error."""
        self.interval_s = interval_s
        self._reset_phase(slot.measured.power, share)
        self.slots = [replace(slot, number=0, state="reported")]
        self.steady_hz = self.offset_hz
        self.time_s = self.last_accepted_s = self.settled_s = slot.time_s
        self.confirmed = True

    def join(
        self,
        pulses: list[tuple[int, float, int, Measured]],
        base: int,
        around: Around = lambda *_: QUIET,
    ) -> None:
        """Add the new pulses of a group; `base`: number of its first pulse in the track."""
        width_s = self.tag.pulse_width_s
        floor = least_real([measured.power for *_, measured in pulses])
        for place, time_s, time_ns, measured in pulses:
            number = base + place
            if any(abs(slot.time_s - time_s) < 0.75 * width_s for slot in self.slots):
                continue
            real = measured.power >= floor
            state: SlotState = "accepted" if real else "missed"
            self.slots.append(Slot(number, time_s, time_ns, measured, 1.0, state))
            if real and number > self.number:
                while self.number < number:
                    self._predict()
                    self.number += 1
                self.slots[-1].bursts = around(self, measured)
                self.odds += self._odds(self.slots[-1], self.time_s, self.variance[0])
                self._correct(time_s, measured.power)
                self.last_accepted_s = time_s
                self.tested += 1
        self._keep_slots(max(2 * self.tag.k, 6))
        # A second group on the lattice of the first is not noise; which of two rates it has is
        # undecided.
        one_rate = len(self.tag.pulse_intervals_s) == 1
        if self.tested >= self.tag.k and one_rate and self.odds >= 0.0:
            self.confirmed = True
        self.certain_s = math.inf

    @property
    def received(self) -> list[Slot]:
        """Recent slots with detections that are accepted as the tag's pulses, oldest first."""
        return [slot for slot in self.slots if slot.received]

    @property
    def sure(self) -> bool:
        """True if the pulses of the track are certainly not other transmitters' bursts."""
        return self.confirmed and not self.dead and self.trust > FOLLOW.sure_trust

    def expected(self) -> tuple[float, float]:
        """Time of the next pulse, and half the width of the window searched around it [s]."""
        phase, cross, interval = self.variance
        variance = max(0.0, phase + 2.0 * cross + interval)  # rounding
        half = 2.5 * math.sqrt(variance) + self.tag.interval_jitter_s
        return self.time_s + self.interval_s, half + self.tag.pulse_width_s / 8.0

    def spread_s(self) -> float:
        """Standard deviation of the next pulse's time around `expected` [s]."""
        phase, cross, interval = self.variance
        own = (0.08 * self.tag.pulse_width_s) ** 2 + self.tag.interval_jitter_s**2 / 3.0
        return math.sqrt(max(0.0, phase + 2.0 * cross + interval) + own)

    def step(self, slot: Slot) -> None:
        """Update the track with the search result for the next expected pulse."""
        self._predict()
        self.number += 1
        self.offset_hz += self.drift_hz
        slot.number = self.number
        self.tested += 1
        slot.tag_odds = self._weighed(slot)
        self._note_half(slot.number, slot.tag_odds)
        self.slots.append(slot)
        self._keep_slots(max(2 * self.tag.k, 6, 0 if self.confirmed else FOLLOW.most_tests))
        power = slot.measured.power
        if self.confirmed:
            self._weigh(slot)
            self._follow(slot)
        else:
            self._try_to_confirm(slot)
        if slot.state == "accepted":
            self.since_accepted = 0
            self._correct(slot.time_s, power)
            self._correct_frequency(slot.measured)
        else:
            self.since_accepted += 1
            self.drift_hz *= 0.8
            if self.confirmed and power > 4.0 and slot.state != "missed":
                # Too weak to report, but sufficient to stabilise the phase.
                self._correct(slot.time_s, power * 0.3)
            if self.since_accepted > FOLLOW.most_missed or self.trust <= 0.0:
                self.dead = True

    def skip(self) -> None:
        """Skip an expected pulse with lost samples."""
        self._predict()
        self.number += 1
        self.offset_hz += self.drift_hz
        self.since_accepted += 1
        if self.since_accepted > FOLLOW.most_missed:
            self.dead = True

    def doubt(self, since_s: float) -> None:
        """Require the track to be confirmed again; `since_s` becomes the zero of its times."""
        self.confirmed = False
        self.tested = self.since_accepted = 0
        self.gained, self.trust = 0.0, FOLLOW.most_trust
        self.odds, self.stands_out = 0.0, False
        self.halves = [0.0, 0.0]
        self.slots.clear()
        self.past_ns.clear()
        self.at_other_rate.clear()
        self.time_s -= since_s
        self.certain_s -= since_s
        self.settled_s -= since_s
        self.last_accepted_s = -math.inf

    def _keep_slots(self, count: int) -> None:
        old = [s.time_ns for s in self.slots[:-count] if s.received]
        if old:
            self.past_ns += old
            del self.past_ns[: -FOLLOW.past_pulses]
        del self.slots[:-count]

    def _try_to_confirm(self, slot: Slot) -> None:
        self.gained += min(slot.measured.power, 14.0)
        slot.state = "open"
        short = self.tag.k <= FOLLOW.most_alone
        volume = _round(FOLLOW.more_cells * slot.volume if short else slot.volume)
        chance = FOLLOW.confirm_false if short else FOLLOW.confirm_long_false
        tests = max(2, self.tag.k) + (FOLLOW.more_tests if short else 0)
        self.odds += slot.tag_odds if short else 0.0
        self.best_odds = max(self.best_odds, self.odds)
        if not self.stands_out:
            limit = narrow_threshold(self.tested, volume, chance)
            self.stands_out = self.gained >= limit
            if self.stands_out and short:
                self.trust = min(FOLLOW.most_trust, FOLLOW.first_trust + self.gained - limit)
        if self.stands_out and self.odds >= 0.0 and not self.interval_open:
            self.confirmed = True
            self.trust = min(self.trust, FOLLOW.first_trust + self.odds)
            for other in self.slots:
                clear = other.tag_odds > 0.0 or other.number > self.number - tests
                clear &= not self._sends_nothing(other)
                clear &= other.measured.power > FOLLOW.weakest_power
                if other.state == "open" and clear:
                    other.state = "accepted"
                    self.last_accepted_s = other.time_s
        elif not self.stands_out:
            self.dead = self.tested >= tests
        else:
            # It is not noise, but may still be a chance series of other bursts.
            self.dead = self.odds < self.best_odds - FOLLOW.odds_lost
            self.dead |= self.tested >= FOLLOW.most_tests
            if slot.tag_odds > 0.0:
                self.since_accepted = -1
                self._correct(slot.time_s, slot.measured.power)
                self._correct_frequency(slot.measured)

    def _note_half(self, number: int, tag_odds: float) -> None:
        half = number % 2
        tag_odds = max(-FOLLOW.trust_lost, min(FOLLOW.trust_won, tag_odds))
        self.halves[half] = FOLLOW.half_kept * self.halves[half] + tag_odds

    def _sends_nothing(self, slot: Slot) -> bool:
        """True if the tag's interval is twice the track's and nothing is sent at this pulse."""
        own, other = self.halves[slot.number % 2], self.halves[1 - slot.number % 2]
        return own < FOLLOW.empty_half and other > FOLLOW.full_half

    def against_bursts(self, slot: Slot) -> float:
        """Log odds that a detection at the next expected time is the tag's, and not a burst."""
        phase, cross, interval = self.variance
        phase += 2.0 * cross + interval
        return self._odds(slot, self.time_s + self.interval_s, phase)

    def _odds(self, slot: Slot, expected_s: float, phase: float) -> float:
        phase += self._timing_variance(slot.measured.power)
        levels = [
            10.0 * math.log10(other.measured.power)
            for other in self.slots
            if other is not slot and (other.received or other.tag_odds > 0)
        ][-3:]
        level = 10.0 * math.log10(max(slot.measured.power, 1.0))
        return log_odds(
            slot.bursts,
            width_s=self.tag.pulse_width_s,
            late_s=slot.time_s - expected_s,
            spread_s=math.sqrt(max(phase, 1e-12)),
            beside_hz=slot.measured.offset_hz - self.offset_hz,
            above_db=level - sum(levels) / len(levels) if levels else 0.0,
        )

    def _weighed(self, slot: Slot) -> float:
        """Log odds that a detection at the expected time is the tag's, not noise or a burst."""
        noise = _against_noise(slot.measured.power, slot.volume)
        empty = log_empty(slot.bursts, width_s=self.tag.pulse_width_s)
        slot.burst_odds = self._odds(slot, self.time_s, self.variance[0])
        return max(empty, min(noise, slot.burst_odds))

    def _weigh(self, slot: Slot) -> None:
        if self.tag.k > FOLLOW.most_alone:
            return
        self.trust += max(-FOLLOW.trust_lost, min(FOLLOW.trust_won, slot.tag_odds))
        self.trust = min(self.trust, FOLLOW.most_trust)

    def _follow(self, slot: Slot) -> None:
        k = self.tag.k
        if slot.bursts.alike_per_s > 0.0 and slot.burst_odds < 0.0 and k <= FOLLOW.most_alone:
            slot.state = "missed"
            return
        empty = self._sends_nothing(slot)
        false = FOLLOW.follow_false / k * (FOLLOW.half_false if empty else 1.0)
        single = narrow_threshold(1, _round(slot.volume), false)
        if slot.measured.power >= single:
            slot.state = "accepted"
            self.last_accepted_s = slot.time_s
        recent = [s for s in self.slots if s.number > self.number - k]
        if k == 1 or len(recent) < k or self.trust < FOLLOW.joint_trust:
            return
        limit = narrow_threshold(k, _round(max(s.volume for s in recent)), FOLLOW.follow_false)
        for weak in recent:
            own = weak.measured.power
            others = [s.measured.power for s in recent if s is not weak]
            floor = FOLLOW.joint_share * min(40.0, max(others))
            if weak.state != "open" or own <= max(FOLLOW.weakest_power, floor):
                continue
            if self._sends_nothing(weak):
                continue
            # Other pulses support a weak one only up to twice its own power: between strong
            # pulses a weaker peak is noise in a null of the antenna.
            total = own + sum(min(power, FOLLOW.joint_ratio * own) for power in others)
            if total >= limit:
                weak.state = "accepted"
                self.last_accepted_s = max(self.last_accepted_s, weak.time_s)

    def _correct_frequency(self, pulse: Measured) -> None:
        alpha = 0.5 if pulse.power > 30.0 else 0.3
        self.steady_hz += max(1.0 / (self.number + 1), FOLLOW.steady_gain) * (
            pulse.offset_hz - self.steady_hz
        )
        miss = pulse.offset_hz - self.offset_hz
        self.offset_hz += alpha * miss
        self.drift_hz += alpha**2 / (2.0 - alpha) * miss
        self.drift_hz = max(-FOLLOW.most_drift_hz, min(FOLLOW.most_drift_hz, self.drift_hz))

    def _timing_variance(self, power: float) -> float:
        noise_s = timing_error_s(self.tag.pulse_width_s, power)
        return noise_s**2 + (self.tag.interval_jitter_s / 2.0) ** 2

    def _reset_phase(self, power: float, share: float = 1.0) -> None:
        """Covariance from a pulse's timing error and `share` of the interval's uncertainty."""
        spread_s = share * self.tag.interval_uncertainty_s / math.sqrt(3.0)
        interval = spread_s**2 + (BOUNDS.clock_error * self.interval_s) ** 2
        self.variance = [self._timing_variance(power), 0.0, interval]

    def _predict(self) -> None:
        phase, cross, interval = self.variance
        walk = (FOLLOW.interval_walk * self.interval_s) ** 2
        self.time_s += self.interval_s
        self.variance = [
            phase + 2.0 * cross + interval + FOLLOW.phase_walk_s**2,
            cross + interval,
            interval + walk,
        ]

    def _correct(self, time_s: float, power: float) -> None:
        phase, cross, interval = self.variance
        total = phase + self._timing_variance(power)
        gain_phase, gain_interval = phase / total, cross / total
        miss = time_s - self.time_s
        self.time_s += gain_phase * miss
        self.interval_s += gain_interval * miss
        self.variance = [
            phase * (1.0 - gain_phase),
            cross * (1.0 - gain_phase),
            interval - gain_interval * cross,
        ]


def least_real(powers: list[float]) -> float:
    """Minimum power at which a group's pulse counts as received and not as noise.

    A pulse far weaker than the others and not certain by itself counts as noise. In a long
    group most detections may be noise, so the strongest quarter is the reference.
    """
    strongest = sorted(powers)[-(len(powers) // 4) :]
    return min(20.0, FOLLOW.weakest_share * sum(strongest) / len(strongest))


def independent_cells(tag: Tag, half_s: float, half_band_hz: float) -> float:
    """Number of independent cells of noise in a window of time and frequency."""
    width_s = tag.pulse_width_s
    times = 1.0 + 5.0 * half_s / width_s * finer_times(tag, math.inf)
    return times * (1.0 + 3.0 * half_band_hz * width_s)


def _against_noise(power: float, volume: float) -> float:
    """Log odds that the strongest of a window's `volume` independent cells is a pulse."""
    return (
        FOLLOW.power_slope * power + FOLLOW.power_start - math.log(FOLLOW.more_cells * volume)
    )


def _round(volume: float) -> float:
    return math.exp(math.ceil(math.log(max(volume, 1.0)) * 10.0) / 10.0)


@lru_cache(maxsize=4096)
def narrow_threshold(k: int, volume: float, expected_false: float) -> float:
    """Threshold of a sum of k maxima, each of `volume` independent cells [noise powers]."""
    if k == 1:
        return math.log(volume / expected_false)
    low, high = 0.0, 14.0 * k
    for _ in range(40):
        middle = 0.5 * (low + high)
        if volume * group_tail(k, volume, middle) > expected_false:
            low = middle
        else:
            high = middle
    return high
