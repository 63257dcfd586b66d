"""E3: the number of pulses summed, and long integration."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from uavrt.core.messages import Tag
from uavrt_experiments.detection import theory
from uavrt_experiments.detection.cases import FULL_TRIALS, Case, Experiment
from uavrt_experiments.detection.false_alarms import count_false, false_alarm_row
from uavrt_experiments.detection.sensitivity import (
    Shot,
    clearly_above,
    curve_case,
    level_of_bound,
    level_row,
    points_of,
)
from uavrt_experiments.detection.signals import THESIS_TAG
from uavrt_experiments.detection.trials import WHOLE_CHANNEL_HZ, Decision
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import Z95, level_for

_COST_S = {1: 0.006, 2: 0.01, 5: 0.035, 8: 0.1, 12: 1.45}
"""CPU time of a decision in the whole channel [s], by K."""


def _summed(k: int) -> Case:
    expected = theory.ENR_HALF_DB[k]

    def rows(shots: Sequence[Shot]) -> list[Row]:
        return [
            level_row(
                shots,
                experiment="E3",
                case=f"K = {k}, whole channel",
                most=expected + 0.5,
                genie=theory.GENIE_HALF_DB[k],
                union=expected,
                at=float(k),
            )
        ]

    tag = replace(THESIS_TAG, k=k)
    # Twelve pulses cost seconds in the whole channel; what they could miss they miss here too.
    brief = Decision(tag=tag) if k < 12 else _narrow(tag)
    return curve_case(
        name=f"K = {k}",
        decision=Decision(tag=tag),
        short=clearly_above(
            experiment="E3",
            name=f"K = {k}",
            decision=brief,
            bar_db=expected + 0.5,
            trials={8: 6, 12: 4}.get(k, 8),
        ),
        levels_db=(expected - 0.2, expected + 0.4, expected + 1.0),
        seconds=_COST_S[k],
        # Twelve pulses cost ten times as much as eight.
        per_level=FULL_TRIALS if k < 12 else FULL_TRIALS // 3,
        rows=rows,
    )


def _narrow(tag: Tag) -> Decision:
    return Decision(tag=tag, frequency_window_hz=100.0, band_hz=90.0)


def long_tag(k: int, jitter_s: float) -> Tag:
    """The thesis's tag with its interval known to 0.125 ms, for long integration."""
    return replace(THESIS_TAG, k=k, interval_uncertainty_s=0.000125, interval_jitter_s=jitter_s)


def long_decision(k: int, jitter_s: float, *, drifting: bool = False) -> Decision:
    """Decision with the largest allowed errors of interval, jitter, frequency and drifts."""
    return Decision(
        tag=long_tag(k, jitter_s),
        frequency_window_hz=100.0,
        band_hz=100.0,
        interval_error=1.0,
        jitter=1.0,
        interval_drift=1e-6 if drifting else 0.0,
        drift_hz_per_s=0.2 if drifting else 0.0,
    )


_LONG_BARS = {(20, 0.002): 3.0, (40, 0.002): 1.5, (20, 0.010): 3.5, (40, 0.010): 2.0}
_LONG_COST_S = {20: 0.06, 40: 0.2}
_DRIFT_COST_DB = 0.5


def _long(k: int, jitter_s: float) -> Case:
    bar = _LONG_BARS[k, jitter_s]
    return curve_case(
        name=f"K = {k}, jitter {1e3 * jitter_s:g} ms",
        decision=long_decision(k, jitter_s),
        levels_db=(bar - 2.0, bar - 1.25, bar - 0.5),
        seconds=_LONG_COST_S[k],
        short=clearly_above(
            experiment="E3",
            name=f"K = {k}, jitter {1e3 * jitter_s:g} ms",
            decision=long_decision(k, jitter_s),
            bar_db=bar,
            trials=8 if k < 40 else 4,
        ),
        rows=lambda shots: [
            level_row(
                shots,
                experiment="E3",
                case=f"K = {k}, interval ± 0.125 ms, ± 100 Hz, jitter ± {1e3 * jitter_s:g} ms",
                most=bar,
                genie=level_of_bound(lambda level: theory.genie(k, level), 0.5),
                union=theory.LONG_HALF_DB[k],
                note="search bound without jitter",
            )
        ],
    )


def _drifting(k: int) -> Case:
    """Case in which decisions with and without drift take turns; the same seeds would not pair
    them.
    """
    bar = _LONG_BARS[k, 0.002]
    levels = (bar - 2.0, bar - 1.25, bar - 0.5)
    kinds = [
        (level, drifting, long_decision(k, 0.002, drifting=drifting))
        for level in levels
        for drifting in (False, True)
    ]

    def trial(rng: np.random.Generator, index: int) -> tuple[float, bool, bool]:
        level, drifting, decision = kinds[index % len(kinds)]
        return level, drifting, decision.found(rng, level)

    def rows(outcomes: Sequence[tuple[float, bool, bool]]) -> list[Row]:
        still, moving = (
            level_for(
                points_of([(at, hit) for at, drifts, hit in outcomes if drifts == d]), 0.5
            )
            for d in (False, True)
        )
        cost = moving[0] - still[0]
        half = Z95 * math.hypot(still[3], moving[3])
        return [
            Row.with_interval(
                "E3",
                "cost of drift, dB",
                f"K = {k}, 1e-6 of the interval per pulse and 0.2 Hz/s",
                (cost, cost - half, cost + half),
                len(outcomes),
                most=_DRIFT_COST_DB,
            )
        ]

    return Case(
        name=f"K = {k}, drift",
        trials=FULL_TRIALS * 3,
        least=48,
        seconds=_LONG_COST_S[k],
        trial=trial,
        rows=rows,
        short=clearly_above(
            experiment="E3",
            name=f"K = {k}, drift",
            decision=long_decision(k, 0.002, drifting=True),
            bar_db=bar,
            trials=8 if k < 40 else 4,
        ),
    )


_SHORT_PROBABILITY = 0.3
"""False-alarm probability of short forms: some minutes of noise have a countable number of
false groups."""


def _alarms(k: int, stretches: int, stretch_s: float, seconds: float) -> Case:
    """Case for the false alarms at this K, because many of them would lower the ENR."""
    tag = long_tag(k, 0.002) if k >= 20 else replace(THESIS_TAG, k=k)
    where = "± 100 Hz" if k >= 20 else "whole channel"

    def case(
        probability: float, window_hz: float, long_s: float, count: int, least: float | None
    ) -> Case:
        asked = replace(tag, false_alarm_probability=probability)
        return Case(
            name=f"K = {k}, false alarms",
            trials=count,
            least=1 if count == stretches else count,
            seconds=seconds,
            trial=lambda rng, _: count_false(
                rng, asked, frequency_window_hz=window_hz, stretch_s=long_s
            ),
            rows=lambda outcomes: [
                false_alarm_row(
                    outcomes,
                    experiment="E3",
                    case=f"K = {k}, {where}",
                    probability=probability,
                    least=least,
                )
            ],
        )

    full = case(0.05, 100.0 if k >= 20 else WHOLE_CHANNEL_HZ, stretch_s, stretches, 0.7)
    brief_s, brief_hz = (100.0, WHOLE_CHANNEL_HZ) if k < 8 else (200.0, 100.0)
    if k == 12:  # a second of it takes as long as ten of eight pulses
        brief_s = 60.0
    # Thresholds are of the whole channel up to K = 12: in a part of it noise passes less.
    least = None if k in (8, 12) else 0.7
    count = 3 if k >= 20 else 2 if k < 8 else 1
    return replace(full, short=case(_SHORT_PROBABILITY, brief_hz, brief_s, count, least))


E3 = Experiment(
    name="E3",
    title="More pulses summed, and long integration",
    cases=(
        *(_summed(k) for k in _COST_S),
        *(_long(k, jitter_s) for k, jitter_s in _LONG_BARS),
        _drifting(20),
        _drifting(40),
        _alarms(1, 8, 300.0, 0.6),
        _alarms(2, 16, 300.0, 0.6),
        _alarms(5, 40, 300.0, 1.2),
        _alarms(8, 64, 300.0, 2.5),
        _alarms(12, 24, 100.0, 30.0),
        _alarms(20, 100, 300.0, 0.7),
        _alarms(40, 150, 300.0, 1.2),
    ),
)
