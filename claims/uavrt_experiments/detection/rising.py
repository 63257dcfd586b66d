"""E17: noise that rises and falls: throttle, a nearby transmitter."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.measure.recorded_pulses import DetectionChain
from uavrt.core.messages import IQBlock, Pulse, Tag
from uavrt.core.units import ns_from_s
from uavrt.detection.search.thresholds import decision_interval_s
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    add_pulse,
    noise,
    pulse_train,
)
from uavrt_experiments.detection.trials import RATE_HZ, WHOLE_CHANNEL_HZ, compare, detect
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import count_interval, share_by_flight

Samples = NDArray[np.complex64]
Rows = Literal["all", "half"]
"""Spectrogram rows whose noise rises: all, or those on one side of an edge near the tag."""
ABSENT_TAG = replace(THESIS_TAG, false_alarm_probability=0.05)
_STRETCH_S = 120.0
_EDGE_HZ = 200.0
"""Largest distance of a transmitter's edge from the tag's frequency."""
_SKIRT_HZ = 40.0
"""Width over which a transmitter's density falls to nothing [Hz]."""
_SOON_S = 0.1
_LATE_S = 1.0
"""Time after a rise from which false groups are counted as in steady noise [s]."""
_SOON_MOST = 2.0
_LATER = (0.7, 1.4)
_CONFIRMED_MOST = 0.001
_STRONG_DB = 14.0
_WEAK_DB = 10.0
_STRONG_LEAST = 0.9
_WEAK_LOSS = 0.1
_WEAK_LEAST = 0.5
"""Least share of pulses found; a detector that finds none even in steady noise must fail."""
_TAG_HZ = 100.0
_INSIDE_HZ = 150.0
"""Least distance of an edge from the tag's frequency, in cases where the tag's own rows rise
[Hz]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rise:
    """Noise that rises, stays, and falls again, repeatedly.

    `depth_db`: difference between the high level and the low one [dB].
    `up_s`, `down_s`: duration of the rise and the fall, linear in decibels [s].
    `high_s`, `low_s`: duration of each level [s].
    `first_s`: start of the first rise [s].
    """

    depth_db: float
    up_s: float
    down_s: float
    high_s: float
    low_s: float
    first_s: float

    @property
    def period_s(self) -> float:
        """Time from a rise to the next [s]."""
        return self.up_s + self.high_s + self.down_s + self.low_s

    def level_db(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Level over the low one [dB] at given times, shape as given."""
        phase = (time_s - self.first_s) % self.period_s
        top = self.up_s + self.high_s
        corners = [0.0, self.up_s, top, top + self.down_s, self.period_s]
        level = np.interp(phase, corners, [0.0, self.depth_db, self.depth_db, 0.0, 0.0])
        return np.where(time_s < self.first_s, 0.0, level)

    def starts_s(self, duration_s: float) -> NDArray[np.float64]:
        """Start times of the rises in a stretch [s]."""
        return np.arange(self.first_s, duration_s, self.period_s)


def random_rise(rng: np.random.Generator) -> Rise:
    """Draw a rise of 1 to 20 dB within 0.01 to 5 s, with levels of at least 0.5 s and periods
    from 2 s.
    """

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    up_s, down_s = between(0.01, 5.0), between(0.01, 5.0)
    high_s, low_s = between(0.5, 10.0), between(0.5, 10.0)
    low_s = max(low_s, 2.0 - up_s - down_s - high_s)
    return Rise(
        depth_db=float(rng.uniform(1.0, 20.0)),
        up_s=up_s,
        down_s=down_s,
        high_s=high_s,
        low_s=low_s,
        first_s=5.0 + float(rng.uniform(0.0, up_s + high_s + down_s + low_s)),
    )


def rising_noise(
    rng: np.random.Generator,
    count: int,
    rise: Rise,
    *,
    above_hz: float | None = None,
    upwards: bool = True,
    sample_rate_hz: float = RATE_HZ,
) -> Samples:
    """Noise of unit power with an added rise, shape (count,).

    `above_hz`: edge on one side of which the noise rises [Hz]; None: all of it rises.
    `upwards`: true if the side above the edge rises.
    """
    level = 10.0 ** (rise.level_db(np.arange(count) / sample_rate_hz) / 10.0)
    if above_hz is None:
        return np.asarray(noise(rng, count) * np.sqrt(level), np.complex64)
    away_hz = np.fft.fftfreq(count, 1.0 / sample_rate_hz) - above_hz
    share = np.clip(0.5 + (away_hz if upwards else -away_hz) / _SKIRT_HZ, 0.0, 1.0)
    added = np.fft.ifft(np.fft.fft(noise(rng, count)) * np.sqrt(share))
    return np.asarray(noise(rng, count) + added * np.sqrt(level - 1.0), np.complex64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarms:
    """False groups of one stretch, and their expected number.

    A group with a pulse between 0.1 s after a rise's start and 1 s after its end is ``soon``.
    Of the others, one with a pulse in the 0.1 s left out is ``at_once``; the rest is ``later``.
    """

    soon: int
    later: int
    at_once: int
    confirmed: int
    intervals: float
    """Number of decision intervals searched."""
    soon_nominal: float
    later_nominal: float


def count_alarms(pulses: Sequence[Pulse], rise: Rise, tag: Tag, *, duration_s: float) -> Alarms:
    """Sort the groups of a stretch without a tag by their time after a rise."""
    starts_s = rise.starts_s(duration_s)

    def kinds(times_s: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Two masks of groups of pulses (groups, K): soon after a rise, and at once."""
        since = times_s[..., np.newaxis] - starts_s
        begun = since >= 0.0
        soon = (since >= _SOON_S) & (since < rise.up_s + _LATE_S)
        at_once = begun & (since < _SOON_S)
        return np.asarray(soon.any(axis=(-1, -2))), np.asarray(at_once.any(axis=(-1, -2)))

    groups: dict[tuple[int, int, int], list[float]] = {}
    sure: set[tuple[int, int, int]] = set()
    for pulse in pulses:
        key = (pulse.tag_id, pulse.rate, pulse.group_sequence)
        if pulse.detection_status != "subthreshold":
            groups.setdefault(key, []).append((pulse.start_time_ns - START_NS) * 1e-9)
        if pulse.confirmed:
            sure.add(key)
    soon = later = at_once = 0
    for times in groups.values():
        is_soon, is_at_once = kinds(np.array([times]))
        soon += int(is_soon[0])
        at_once += int(is_at_once[0] and not is_soon[0])
        later += int(not is_soon[0] and not is_at_once[0])
    # Groups of steady noise lie anywhere: what share of them is of which kind.
    interval_s = tag.pulse_intervals_s[0]
    span_s = (tag.k - 1) * interval_s
    first_s = np.arange(0.0, duration_s - span_s, 0.02)
    is_soon, is_at_once = kinds(first_s[:, np.newaxis] + interval_s * np.arange(tag.k))
    intervals = duration_s / decision_interval_s(tag)
    nominal = intervals * tag.false_alarm_probability
    return Alarms(
        soon=soon,
        later=later,
        at_once=at_once,
        confirmed=len(sure),
        intervals=intervals,
        soon_nominal=nominal * float(is_soon.mean()),
        later_nominal=nominal * float((~is_soon & ~is_at_once).mean()),
    )


def search_stretch(
    rng: np.random.Generator,
    rise: Rise,
    rows: Rows,
    *,
    tag: Tag = ABSENT_TAG,
    frequency_window_hz: float = 500.0,
    duration_s: float = _STRETCH_S,
) -> Alarms:
    """Search rising noise for an absent tag."""
    samples = rising_noise(
        rng,
        round(duration_s * RATE_HZ),
        rise,
        above_hz=None if rows == "all" else float(rng.uniform(-_EDGE_HZ, _EDGE_HZ)),
        upwards=bool(rng.integers(2)),
    )
    pulses, _ = detect(samples, tag, frequency_window_hz=frequency_window_hz)
    return count_alarms(pulses, rise, tag, duration_s=duration_s)


def alarm_rows(outcomes: Sequence[Alarms], *, case: str) -> list[Row]:
    """Rows with false groups soon after a rise and later, over nominal, and
    confirmed groups.
    """
    rows = []
    for what, counts, expected, (least, most) in (
        (
            "from 0.1 s after a rise's start to 1 s after its end",
            [o.soon for o in outcomes],
            sum(o.soon_nominal for o in outcomes),
            (None, _SOON_MOST),
        ),
        ("else", [o.later for o in outcomes], sum(o.later_nominal for o in outcomes), _LATER),
    ):
        low, high = count_interval(counts)
        rows.append(
            Row.with_interval(
                "E17",
                "false alarms / nominal",
                f"{case}, {what}",
                (sum(counts) / expected, low / expected, high / expected),
                round(sum(o.intervals for o in outcomes)),
                least=least,
                most=most,
                note=f"{sum(counts)} groups, {sum(o.at_once for o in outcomes)} in the 0.1 s",
            )
        )
    confirmed = [o.confirmed for o in outcomes]
    low, high = count_interval(confirmed)
    intervals = sum(o.intervals for o in outcomes)
    rows.append(
        Row.with_interval(
            "E17",
            "falsely confirmed groups per decision, %",
            case,
            (
                100.0 * sum(confirmed) / intervals,
                100.0 * low / intervals,
                100.0 * high / intervals,
            ),
            round(intervals),
            most=100.0 * _CONFIRMED_MOST,
            note=f"{sum(confirmed)} groups",
        )
    )
    return rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """Pulses of a tag in rising noise, compared with steady noise.

    `steady`: share found in noise that stays low, and in noise that stays high, each weighted
    by its time.
    """

    true: int
    found: int
    steady: float


def hear(
    rng: np.random.Generator,
    rise: Rise,
    rows: Rows,
    *,
    enr_db: float,
    duration_s: float = _STRETCH_S,
) -> Heard:
    """Follow a tag of constant strength above the present noise."""
    upwards, inside = bool(rng.integers(2)), bool(rng.integers(2))
    away_hz = float(rng.uniform(_INSIDE_HZ, _INSIDE_HZ + _EDGE_HZ))
    above_hz = None if rows == "all" else _TAG_HZ + away_hz * (-1.0 if upwards == inside else 1)
    rises = rows == "all" or inside
    counts: list[int] = []
    shares: list[float] = []
    low = replace(rise, depth_db=0.0)
    high = replace(rise, first_s=-1e6, high_s=1e9)
    for happening in (rise, low, high):

        def strength_db(time_s: float, own: Rise = happening) -> float:
            return enr_db + rises * float(own.level_db(np.array([time_s]))[0])

        truth = pulse_train(
            rng,
            duration_s=duration_s,
            interval_s=1.254 + rng.uniform(-0.05, 0.05),
            offset_hz=_TAG_HZ,
            enr_db=strength_db,
            jitter_s=0.005,
        )
        samples = rising_noise(
            rng, round(duration_s * RATE_HZ), happening, above_hz=above_hz, upwards=upwards
        )
        for pulse in truth:
            add_pulse(
                samples,
                pulse,
                sample_rate_hz=RATE_HZ,
                width_s=0.02,
                phase=float(rng.uniform(0.0, 2.0 * math.pi)),
            )
        pulses, _ = detect(samples, THESIS_TAG, frequency_window_hz=500.0)
        comparison = compare(pulses, truth, THESIS_TAG)
        counts += [comparison.true, comparison.matched]
        shares.append(comparison.matched / comparison.true)
    level_db = rise.level_db(np.arange(0.0, duration_s, 0.1))
    loud = float((level_db > 0.5 * rise.depth_db).mean())
    return Heard(
        true=counts[0], found=counts[1], steady=loud * shares[2] + (1.0 - loud) * shares[1]
    )


def heard_rows(
    outcomes: Sequence[Heard], *, case: str, least: float | None = None
) -> list[Row]:
    """Rows with the share of the pulses found; the default requirement is that of steady noise
    less 0.1.
    """
    steady = sum(o.steady for o in outcomes) / len(outcomes)
    return [
        Row.with_interval(
            "E17",
            "recall",
            case,
            share_by_flight([o.found for o in outcomes], [o.true for o in outcomes]),
            sum(o.true for o in outcomes),
            least=max(steady - _WEAK_LOSS, _WEAK_LEAST) if least is None else least,
            note=f"{len(outcomes)} flights; {steady:.3f} in steady noise",
        )
    ]


_RADIO_HZ = 3e6
_RADIO_S = 24.0
_RADIO_TAGS = 12


def search_radio(
    rng: np.random.Generator, rise: Rise, *, duration_s: float = _RADIO_S
) -> Alarms:
    """Search for absent tags through the whole front end, while the noise of all the band
    rises.
    """
    center_hz = THESIS_TAG.frequency_hz
    tags = [
        replace(
            ABSENT_TAG,
            tag_id=2 * (number + 1),
            frequency_hz=center_hz + 9_300.0 * (number - _RADIO_TAGS / 2.0 + 0.37),
        )
        for number in range(_RADIO_TAGS)
    ]
    chain = DetectionChain(tags, sample_rate_hz=_RADIO_HZ, center_frequency_hz=center_hz)
    count = round(0.0874 * _RADIO_HZ)
    pulses: list[Pulse] = []
    for first in range(0, round(duration_s * _RADIO_HZ), count):
        samples = noise(rng, count)
        at_s = first / _RADIO_HZ + np.arange(count) / _RADIO_HZ
        # Every hundredth is enough: the steepest rise takes 30 000 samples.
        level_db = np.interp(at_s, at_s[::100], rise.level_db(at_s[::100]))
        samples *= np.asarray(10.0 ** (level_db / 20.0), np.float32)
        pulses += chain.process(
            IQBlock(
                samples=samples,
                sample_index=first,
                time_ns=START_NS + ns_from_s(first / _RADIO_HZ),
                sample_rate_hz=_RADIO_HZ,
            )
        )
    pulses += chain.flush()
    one = count_alarms(pulses, rise, ABSENT_TAG, duration_s=duration_s)
    return replace(
        one,
        intervals=one.intervals * _RADIO_TAGS,
        soon_nominal=one.soon_nominal * _RADIO_TAGS,
        later_nominal=one.later_nominal * _RADIO_TAGS,
    )


def _alarm_case(name: str, rows: Rows, *, window_hz: float = 500.0, trials: int = 300) -> Case:
    full = Case(
        name=name,
        trials=trials,
        least=4,
        seconds=0.15 if window_hz == 500.0 else 0.5,
        trial=lambda rng, _: search_stretch(
            rng, random_rise(rng), rows, frequency_window_hz=window_hz
        ),
        rows=lambda outcomes: alarm_rows(outcomes, case=name),
    )
    return replace(full, short=replace(full, least=2 if window_hz == 500.0 else 1))


def _known_case(name: str, rise: Rise) -> Case:
    """Case with one rise repeatedly, as in the first report of a throttle."""

    def trial(rng: np.random.Generator, _: int) -> Alarms:
        own = replace(rise, first_s=rise.first_s + float(rng.uniform(0.0, 1.0)))
        return search_stretch(rng, own, "all")

    full = Case(
        name=name,
        trials=100,
        least=5,
        seconds=0.15,
        trial=trial,
        rows=lambda outcomes: alarm_rows(outcomes, case=name),
    )
    return replace(full, short=replace(full, least=2))


def _heard_case(enr_db: float, rows: Rows) -> Case:
    name = f"tag of {enr_db:g} dB, {rows} rows rising"
    least = _STRONG_LEAST if enr_db == _STRONG_DB else None
    full = Case(
        name=name,
        trials=60,
        least=3,
        seconds=0.3,
        trial=lambda rng, _: hear(rng, random_rise(rng), rows, enr_db=enr_db),
        rows=lambda outcomes: heard_rows(outcomes, case=name, least=least),
    )
    return replace(full, short=replace(full, least=1))


def _radio_case(name: str) -> Case:
    full = Case(
        name=name,
        trials=30,
        least=1,
        seconds=8.0,
        trial=lambda rng, _: search_radio(
            rng, replace(random_rise(rng), first_s=4.0 + float(rng.uniform(0.0, 4.0)))
        ),
        rows=lambda outcomes: alarm_rows(outcomes, case=name),
    )
    brief = replace(
        full,
        trial=lambda rng, _: search_radio(
            rng,
            replace(random_rise(rng), first_s=3.0 + float(rng.uniform(0.0, 2.0))),
            duration_s=9.0,
        ),
    )
    return replace(full, short=brief)


def steps(rng: np.random.Generator) -> Rise:
    """Case with steps of 20 dB up and down, one second each: the hardest required case."""
    return Rise(
        depth_db=20.0,
        up_s=0.01,
        down_s=0.01,
        high_s=1.0,
        low_s=0.98,
        first_s=3.0 + float(rng.uniform()),
    )


def _stepped_case(rows: Rows) -> Case:
    name = f"tag of {_STRONG_DB:g} dB, steps of 20 dB every 2 s, {rows} rows"

    def trial(rng: np.random.Generator, _: int, *, duration_s: float = _STRETCH_S) -> Heard:
        return hear(rng, steps(rng), rows, enr_db=_STRONG_DB, duration_s=duration_s)

    full = Case(
        name=name,
        trials=60,
        least=3,
        seconds=0.8,
        trial=trial,
        rows=lambda outcomes: heard_rows(outcomes, case=name, least=_STRONG_LEAST),
    )
    return replace(full, short=replace(full, least=1, trial=partial(trial, duration_s=60.0)))


def _throttle(depth_db: float) -> Rise:
    return Rise(depth_db=depth_db, up_s=1.0, down_s=1.0, high_s=9.0, low_s=9.0, first_s=10.0)


E17 = Experiment(
    name="E17",
    title="Noise that rises",
    cases=(
        _alarm_case("all rows rising, ± 500 Hz", "all"),
        _alarm_case("half the rows rising, ± 500 Hz", "half"),
        _alarm_case("all rows rising, whole channel", "all", window_hz=WHOLE_CHANNEL_HZ),
        _alarm_case("half the rows rising, whole channel", "half", window_hz=WHOLE_CHANNEL_HZ),
        _known_case("throttle, + 3 dB within a second every 20 s", _throttle(3.0)),
        _known_case("throttle, + 6 dB within a second every 20 s", _throttle(6.0)),
        *(
            _heard_case(enr_db, rows)
            for rows in ("all", "half")
            for enr_db in (_STRONG_DB, _WEAK_DB)
        ),
        _stepped_case("all"),
        _stepped_case("half"),
        _radio_case("all rows rising, from 3 MS/s"),
    ),
)
