"""E1: false alarms at the nominal rate, in noise of any colour."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Pulse, Tag
from uavrt.detection.search.thresholds import decision_interval_s
from uavrt_experiments.detection import original
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.interference import coloured_noise
from uavrt_experiments.detection.signals import THESIS_TAG, noise
from uavrt_experiments.detection.trials import RATE_HZ, WHOLE_CHANNEL_HZ, detect
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import count_interval

Noise = Callable[[np.random.Generator, int], NDArray[np.complex64]]
STRETCH_S = 300.0
_CONFIRMED_PER_DECISION = 0.0005
"""Largest allowed number of falsely confirmed groups per decision interval."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FalseAlarms:
    """Counts of a detector's reports without a tag."""

    intervals: float
    """Number of decision intervals searched."""
    groups: int
    confirmed: int
    """Number of groups with a confirmed pulse among them."""


def detected_groups(pulses: Sequence[Pulse]) -> tuple[int, int]:
    """Number of distinct groups above the threshold, and of those with a confirmed pulse."""
    detected = {
        (p.rate, p.group_sequence) for p in pulses if p.detection_status != "subthreshold"
    }
    confirmed = {(p.rate, p.group_sequence) for p in pulses if p.confirmed}
    return len(detected), len(confirmed)


def count_false(
    rng: np.random.Generator,
    tag: Tag,
    *,
    make: Noise = noise,
    frequency_window_hz: float = WHOLE_CHANNEL_HZ,
    stretch_s: float = STRETCH_S,
) -> FalseAlarms:
    """Search one stretch without a tag and count false groups."""
    samples = make(rng, round(stretch_s * RATE_HZ))
    pulses, _ = detect(samples, tag, frequency_window_hz=frequency_window_hz)
    groups, confirmed = detected_groups(pulses)
    return FalseAlarms(
        intervals=stretch_s / decision_interval_s(tag), groups=groups, confirmed=confirmed
    )


def false_alarm_row(
    outcomes: Sequence[FalseAlarms],
    *,
    experiment: str,
    case: str,
    probability: float,
    least: float | None = 0.7,
    most: float = 1.4,
    original: float | None = None,
    at: float | None = None,
) -> Row:
    """Row with the ratio of found to nominal false alarms."""
    intervals = sum(o.intervals for o in outcomes)
    groups = sum(o.groups for o in outcomes)
    expected = intervals * probability
    low, high = count_interval([o.groups for o in outcomes])
    return Row.with_interval(
        experiment,
        "false alarms / nominal",
        f"{case}, nominal {100 * probability:g} %",
        (groups / expected, low / expected, high / expected),
        round(intervals),
        least=least,
        most=most,
        original=original,
        at=at,
        note=f"{groups} groups",
    )


def confirmed_row(
    outcomes: Sequence[FalseAlarms], *, experiment: str, case: str, most: float
) -> Row:
    """Row with the falsely confirmed groups per decision interval."""
    intervals = sum(o.intervals for o in outcomes)
    confirmed = sum(o.confirmed for o in outcomes)
    low, high = count_interval([o.confirmed for o in outcomes])
    return Row.with_interval(
        experiment,
        "falsely confirmed groups per decision, %",
        case,
        (100.0 * confirmed / intervals, 100.0 * low / intervals, 100.0 * high / intervals),
        round(intervals),
        most=100.0 * most,
        note=f"{confirmed} groups",
    )


def false_alarm_case(
    *,
    experiment: str,
    name: str,
    tag: Tag,
    stretches: int,
    make: Noise = noise,
    frequency_window_hz: float = WHOLE_CHANNEL_HZ,
    stretch_s: float = STRETCH_S,
    seconds: float = 0.6,
    least: int = 1,
    original: float | None = None,
    at: float | None = None,
) -> Case:
    """Case with stretches of one kind of noise."""
    probability = tag.false_alarm_probability

    def rows(outcomes: Sequence[FalseAlarms]) -> list[Row]:
        return [
            false_alarm_row(
                outcomes,
                experiment=experiment,
                case=name,
                probability=probability,
                original=original,
                at=at,
            ),
            confirmed_row(
                outcomes,
                experiment=experiment,
                case=f"{name}, nominal {100 * probability:g} %",
                most=_CONFIRMED_PER_DECISION,
            ),
        ]

    def trial(
        rng: np.random.Generator, _: int, *, tag: Tag = tag, stretch_s: float = stretch_s
    ) -> FalseAlarms:
        return count_false(
            rng, tag, make=make, frequency_window_hz=frequency_window_hz, stretch_s=stretch_s
        )

    full = Case(
        name=f"{name}, {100 * probability:g} %",
        trials=stretches,
        seconds=seconds,
        least=least,
        trial=trial,
        rows=rows,
    )
    return replace(full, short=replace(full, least=1, trial=partial(trial, stretch_s=40.0)))


NOISES: dict[str, Noise] = {
    "white": noise,
    "edges": partial(coloured_noise, edge=True),
    "tilt 6 dB": partial(coloured_noise, tilt_db=6.0),
    "hum": partial(coloured_noise, hum=True),
}
_STRETCHES = {0.05: 60, 0.01: 72, 0.001: 180}
"""Number of stretches by nominal probability: 5050, 6050 and 15 100 decision intervals, with
250, 60 and 15 groups expected."""


def _cases() -> tuple[Case, ...]:
    cases = [
        false_alarm_case(
            experiment="E1",
            name=f"{name}, whole channel",
            tag=replace(THESIS_TAG, false_alarm_probability=probability),
            stretches=stretches,
            make=make,
            least=4 if probability > 0.02 else 6,
            original=original.FALSE_ALARMS.get(probability) if name == "white" else None,
            at=100.0 * probability,
            # 37 lines are taken out of each batch.
            seconds=5.0 if name == "hum" else 1.0,
        )
        for name, make in NOISES.items()
        for probability, stretches in _STRETCHES.items()
    ]
    cases += [
        false_alarm_case(
            experiment="E1",
            name="white, ± 500 Hz",
            tag=replace(THESIS_TAG, false_alarm_probability=probability),
            stretches=stretches,
            frequency_window_hz=500.0,
            seconds=0.2,
            least=6,
            at=100.0 * probability,
        )
        for probability, stretches in _STRETCHES.items()
    ]
    return tuple(cases)


E1 = Experiment(name="E1", title="False alarms compared with the nominal rate", cases=_cases())
