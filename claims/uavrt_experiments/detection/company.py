"""E12, E13: a neighbour in the channel, and a tag with two rates."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavrt.core.messages import Pulse
from uavrt.detection.detector import PulseDetector
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    TruePulse,
    add_pulse,
    make_samples,
    pulse_train,
)
from uavrt_experiments.detection.tracking import count_row
from uavrt_experiments.detection.trials import (
    RATE_HZ,
    WHOLE_CHANNEL_HZ,
    Samples,
    blocks_of,
    compare,
    detect,
)
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import share_by_flight, share_of

_OWN_HZ = 333.0
_OWN_DB = 16.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Company:
    """Result of a flight with a neighbour in the channel."""

    true: int
    confirmed: int
    foreign: int
    """Number of the neighbour's pulses confirmed under our tag's number after ours was
    confirmed."""
    foreign_before: int
    """Number confirmed before ours was confirmed, when the only track is the nearest to the
    nominal frequency."""
    listed: bool
    """True if the neighbour was among the other signals at the end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbour:
    """Another tag in the channel, and its flights."""

    apart_hz: float
    levels_db: tuple[float, ...]
    """Levels of the neighbour over our tag's [dB]; flights use them in turn."""
    interval_s: float = 1.254
    head_start_s: float = 0.0
    """Time for which the neighbour sends before our tag begins [s]."""
    duration_s: float = 120.0

    def fly(self, rng: np.random.Generator, index: int) -> Company:
        """Run one flight with the neighbour."""
        level = self.levels_db[index % len(self.levels_db)]
        duration_s = self.duration_s + self.head_start_s
        own = pulse_train(
            rng,
            duration_s=duration_s,
            interval_s=1.254,
            offset_hz=_OWN_HZ,
            enr_db=_OWN_DB,
            jitter_s=0.005,
            first_s=self.head_start_s + rng.uniform(0.0, 1.254),
        )
        other = pulse_train(
            rng,
            duration_s=duration_s,
            interval_s=self.interval_s + rng.uniform(-0.02, 0.02),
            offset_hz=_OWN_HZ + self.apart_hz,
            enr_db=_OWN_DB + level,
        )
        samples = make_samples(rng, own, duration_s=duration_s)
        add_pulses(rng, samples, other)
        # The tag's nominal frequency is its own: who is nearest is ours.
        tag = replace(THESIS_TAG, frequency_hz=THESIS_TAG.frequency_hz + _OWN_HZ)
        center_hz = THESIS_TAG.frequency_hz
        pulses, signals = _detect_listing(samples, center_hz)
        mine = compare(pulses, own, tag, center_frequency_hz=center_hz)
        # In the order of their records.
        theirs = [
            at
            for at, p in enumerate(pulses)
            if p.confirmed and _is_of(p, other, center_hz) and not _is_of(p, own, center_hz)
        ]
        ours = (i for i, p in enumerate(pulses) if p.confirmed and _is_of(p, own, center_hz))
        begun = next(ours, len(pulses))
        return Company(
            true=mine.true,
            confirmed=mine.confirmed,
            foreign=sum(at > begun for at in theirs),
            foreign_before=sum(at < begun for at in theirs),
            listed=any(abs(hz - other[0].offset_hz) < 50.0 for hz in signals),
        )


def add_pulses(rng: np.random.Generator, samples: Samples, pulses: Sequence[TruePulse]) -> None:
    """Add pulses of random phase in place."""
    for pulse in pulses:
        add_pulse(
            samples,
            pulse,
            sample_rate_hz=RATE_HZ,
            width_s=THESIS_TAG.pulse_width_s,
            phase=rng.uniform(0.0, 2.0 * math.pi),
        )


def _is_of(pulse: Pulse, truth: Sequence[TruePulse], center_hz: float) -> bool:
    at_s = (pulse.start_time_ns - START_NS) * 1e-9
    return any(
        abs(at_s - t.start_s) < 0.015
        and abs(pulse.frequency_hz - center_hz - t.offset_hz) < 40.0
        for t in truth
    )


def _detect_listing(samples: Samples, center_hz: float) -> tuple[list[Pulse], list[float]]:
    """Detected pulses, and the frequencies of the other signals at the stream's end."""
    detector = PulseDetector(
        replace(THESIS_TAG, frequency_hz=center_hz + _OWN_HZ),
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=center_hz,
        frequency_window_hz=WHOLE_CHANNEL_HZ,
    )
    pulses: list[Pulse] = []
    for block, time_ns in blocks_of(samples):
        pulses += detector.process(block, time_ns)
    others = [track.offset_hz for track in detector.other_signals()]
    return pulses + detector.flush(), others


def _neighbour_case(
    name: str, neighbour: Neighbour, *, rounds: int, barred: bool = True, listed: bool = True
) -> Case:
    def rows(flights: Sequence[Company]) -> list[Row]:
        made = [
            Row.with_interval(
                "E12",
                "own recall",
                name,
                share_by_flight([f.confirmed for f in flights], [f.true for f in flights]),
                sum(f.true for f in flights),
                least=0.95 if barred else None,
                original=0.0 if neighbour.interval_s == 1.254 else None,
                note=f"{len(flights)} flights",
            ),
            count_row(
                [f.foreign for f in flights],
                experiment="E12",
                quantity="neighbour's pulses under our number in a flight",
                case=name,
                most=0.0 if barred else None,
                original=230.0 if neighbour.interval_s == 1.254 else None,
            ),
        ]
        if neighbour.head_start_s:
            made.append(
                count_row(
                    [f.foreign_before for f in flights],
                    experiment="E12",
                    quantity="neighbour's pulses under our number before ours was confirmed",
                    case=name,
                )
            )
        if listed:
            made.append(
                Row.with_interval(
                    "E12",
                    "neighbour listed as another signal",
                    name,
                    share_of(sum(f.listed for f in flights), len(flights)),
                    len(flights),
                    least=0.95 if barred else None,
                )
            )
        return made

    levels = len(neighbour.levels_db)
    full = Case(
        name=name,
        trials=levels * rounds,
        least=levels,
        seconds=0.45,
        trial=neighbour.fly,
        rows=rows,
    )
    brief = replace(neighbour, duration_s=40.0, head_start_s=min(neighbour.head_start_s, 30.0))
    return replace(full, short=replace(full, least=1, trial=brief.fly))


_STRONGER_DB = (0.0, 10.0, 20.0)

E12 = Experiment(
    name="E12",
    title="A neighbour in the channel",
    cases=(
        _neighbour_case(
            "+10 dB, 500 Hz away, same interval, heard 60 s before",
            Neighbour(apart_hz=500.0, levels_db=(10.0,), head_start_s=60.0),
            rounds=12,
        ),
        *(
            _neighbour_case(
                f"0 to +20 dB, {apart:g} Hz away, {'same' if same else 'other'} interval",
                Neighbour(
                    apart_hz=apart, levels_db=_STRONGER_DB, interval_s=1.254 if same else 1.4
                ),
                rounds=4,
                listed=same,
            )
            for apart in (100.0, 500.0)
            for same in (True, False)
        ),
        _neighbour_case(
            "0 to +20 dB, 50 Hz away, same interval",
            Neighbour(apart_hz=50.0, levels_db=_STRONGER_DB),
            rounds=3,
            barred=False,
        ),
        _neighbour_case(
            "+40 dB, 500 Hz away, same interval",
            Neighbour(apart_hz=500.0, levels_db=(40.0,)),
            rounds=8,
            barred=False,
        ),
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class RateCount:
    """Result of a flight with a tag of two rates."""

    true: int
    right: int
    """Number of pulses confirmed at the rate at which they were sent."""
    wrong: int
    """Number of pulses confirmed at the other rate, or where none was sent."""
    lost_at_switch: int
    """Number of undetected pulses among the six around a switch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoRates:
    """A tag with two rates that may change its rate once."""

    intervals_s: tuple[float, float]
    sent: tuple[int, ...]
    """Rates in the order of sending: one, or two with a switch in the middle."""
    enr_db: float = 14.0
    duration_s: float = 120.0

    def fly(self, rng: np.random.Generator, index: int) -> RateCount:
        """Run one flight with the tag."""
        tag = replace(
            THESIS_TAG, pulse_intervals_s=self.intervals_s, interval_uncertainty_s=0.03
        )
        error = 1.0 + rng.uniform(-0.01, 0.01)
        switch_s = self.duration_s * rng.uniform(0.4, 0.6)
        truth: list[TruePulse] = []
        rates: list[set[int]] = []
        at, rate = rng.uniform(0.0, self.intervals_s[0]), self.sent[0]
        while at + 0.05 < self.duration_s:
            truth.append(
                TruePulse(
                    start_s=at + rng.uniform(0.0, 0.005), offset_hz=100.0, enr_db=self.enr_db
                )
            )
            now = self.sent[-1] if at >= switch_s else self.sent[0]
            # The pulse between an interval of one rate and one of the other belongs to both.
            rates.append({rate, now})
            rate = now
            at += self.intervals_s[rate - 1] * error
        samples = make_samples(rng, truth, duration_s=self.duration_s)
        pulses, _ = detect(samples, tag, frequency_window_hz=500.0)
        return self._judge(pulses, truth, rates)

    def _judge(
        self, pulses: Sequence[Pulse], truth: Sequence[TruePulse], rates: Sequence[set[int]]
    ) -> RateCount:
        starts = np.array([t.start_s for t in truth])
        right: set[int] = set()
        heard: set[int] = set()
        wrong = 0
        for pulse in pulses:
            at_s = (pulse.start_time_ns - START_NS) * 1e-9
            nearest = int(np.abs(starts - at_s).argmin())
            there = abs(float(starts[nearest]) - at_s) < 0.015
            if there:
                heard.add(nearest)
            if pulse.confirmed:
                if there and pulse.rate in rates[nearest]:
                    right.add(nearest)
                else:
                    wrong += 1
        lost = 0
        for at, both in enumerate(rates):
            if len(both) == 2:
                about = range(max(0, at - 3), min(len(truth), at + 4))
                lost += sum(i not in heard for i in about)
        return RateCount(true=len(truth), right=len(right), wrong=wrong, lost_at_switch=lost)


def _rate_case(name: str, rates: TwoRates) -> Case:
    def rows(flights: Sequence[RateCount]) -> list[Row]:
        made = [
            Row.with_interval(
                "E13",
                "pulses confirmed at the right rate",
                name,
                share_by_flight([f.right for f in flights], [f.true for f in flights]),
                sum(f.true for f in flights),
                least=0.95,
                note=f"{len(flights)} flights",
            ),
            count_row(
                [f.wrong for f in flights],
                experiment="E13",
                quantity="pulses confirmed at the wrong rate in a flight",
                case=name,
                most=0.0,
            ),
        ]
        if len(rates.sent) > 1:
            made.append(
                count_row(
                    [f.lost_at_switch for f in flights],
                    experiment="E13",
                    quantity="pulses lost at a switch (one group: 3)",
                    case=name,
                    most=3.0,
                    note=f"at most {max(f.lost_at_switch for f in flights)}",
                )
            )
        return made

    return Case(name=name, trials=12, least=3, seconds=0.25, trial=rates.fly, rows=rows)


E13 = Experiment(
    name="E13",
    title="A tag with two rates",
    cases=tuple(
        _rate_case(
            f"{pair[0]:g} and {pair[1]:g} s, sent "
            + " then ".join(f"{pair[rate - 1]:g}" for rate in sent),
            TwoRates(intervals_s=pair, sent=sent),
        )
        for pair in ((1.254, 2.508), (1.333, 2.0))
        for sent in ((1,), (2,), (1, 2), (2, 1))
    ),
)
