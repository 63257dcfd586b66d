"""E2, E3: single decisions by ENR, number of pulses summed, and long integration."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from uavrt.experiments.detection import original, theory
from uavrt.experiments.detection.campaign import FULL_TRIALS, Case, Experiment
from uavrt.experiments.detection.false_alarms import count_false, false_alarm_row
from uavrt.experiments.detection.result import Row
from uavrt.experiments.detection.signals import THESIS_TAG, TRACKER_TAG
from uavrt.experiments.detection.statistics import Z95, level_for, wilson_interval
from uavrt.experiments.detection.trials import WHOLE_CHANNEL_HZ, Decision
from uavrt.messages import Tag

Shot = tuple[float, bool]
"""ENR of a decision [dB], and whether the group was found."""


def points_of(shots: Sequence[Shot]) -> list[tuple[float, int, int]]:
    """Level, hits and trials of each level."""
    levels = sorted({level for level, _ in shots})
    return [
        (
            level,
            sum(hit for at, hit in shots if at == level),
            sum(at == level for at, _ in shots),
        )
        for level in levels
    ]


def curve_case(
    *,
    name: str,
    decision: Decision,
    levels_db: Sequence[float],
    rows: Callable[[Sequence[Shot]], list[Row]],
    seconds: float,
    per_level: int = FULL_TRIALS,
) -> Case:
    """Decisions at several levels, which take turns."""

    def trial(rng: np.random.Generator, index: int) -> Shot:
        level = levels_db[index % len(levels_db)]
        return level, decision.found(rng, level)

    return Case(
        name=name,
        trials=per_level * len(levels_db),
        least=8 * len(levels_db),
        seconds=seconds,
        trial=trial,
        rows=rows,
    )


def pd_rows(
    shots: Sequence[Shot],
    *,
    experiment: str,
    case: str,
    reference: dict[float, float],
    bars: dict[float, float] | None = None,
    k: int = 3,
    probability: float = 0.01,
    cells: float | None = None,
) -> list[Row]:
    """Pd at each level: at least the original's."""
    rows = []
    for level, hits, trials in points_of(shots):
        low, high = wilson_interval(hits, trials)
        rows.append(
            Row(
                experiment=experiment,
                quantity="Pd",
                case=f"{case}, {level:g} dB",
                figure=hits / trials,
                low=low,
                high=high,
                n=trials,
                least=(bars or {}).get(level, reference.get(level)),
                original=reference.get(level),
                genie=theory.genie(k, level, probability),
                union=theory.union_bound(k, level, probability, cells),
                single=theory.single_pulse(level, probability),
                at=level,
            )
        )
    return rows


def level_row(
    shots: Sequence[Shot],
    *,
    experiment: str,
    case: str,
    share: float = 0.5,
    most: float | None = None,
    original: float | None = None,
    genie: float | None = None,
    union: float | None = None,
    at: float | None = None,
    note: str = "",
) -> Row:
    """ENR at which a curve reaches a share."""
    level, low, high, _ = level_for(points_of(shots), share)
    return Row(
        experiment=experiment,
        quantity=f"ENR for Pd {share:g}, dB",
        case=case,
        figure=level,
        low=low,
        high=high,
        n=len(shots),
        most=most,
        original=original,
        genie=genie,
        union=union,
        at=at,
        note=note,
    )


def level_of_bound(bound: Callable[[float], float], share: float) -> float:
    """ENR at which a bound reaches a share [dB]."""
    low, high = -10.0, 25.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        if bound(middle) < share:
            low = middle
        else:
            high = middle
    return high


def _headline(shots: Sequence[Shot]) -> list[Row]:
    rows = pd_rows(
        shots,
        experiment="E2",
        case="K = 3, pf 1 %",
        reference=original.PD,
        bars={8.9: 0.5, 10.5: 0.9},
    )
    for share, most, published in (
        (0.5, 8.9, original.ENR_HALF_DB),
        (0.9, 10.5, original.ENR_NINE_TENTHS_DB),
    ):
        rows.append(
            level_row(
                shots,
                experiment="E2",
                case="K = 3, pf 1 %",
                share=share,
                most=most,
                original=published,
                genie=level_of_bound(lambda level: theory.genie(3, level), share),
                union=level_of_bound(lambda level: theory.union_bound(3, level), share),
            )
        )
    return rows


def _spread_rows(strength: str) -> Callable[[Sequence[Shot]], list[Row]]:
    return lambda shots: [level_row(shots, experiment="E2", case=f"K = 3, pf 1 %, {strength}")]


def _sensitivity() -> tuple[Case, ...]:
    five = replace(THESIS_TAG, false_alarm_probability=0.05)
    tracker = replace(TRACKER_TAG, false_alarm_probability=0.05)
    return (
        curve_case(
            name="pf 1 %",
            decision=Decision(),
            levels_db=(*original.PD, 8.5, 8.9, 9.5, 10.5),
            seconds=0.018,
            rows=_headline,
        ),
        curve_case(
            name="pf 5 %",
            decision=Decision(tag=five),
            levels_db=tuple(original.PD_5_PERCENT),
            seconds=0.02,
            rows=lambda shots: pd_rows(
                shots,
                experiment="E2",
                case="K = 3, pf 5 %",
                reference=original.PD_5_PERCENT,
                probability=0.05,
            ),
        ),
        curve_case(
            name="15 ms tag, pf 5 %",
            decision=Decision(tag=tracker),
            levels_db=tuple(original.PD_TRACKER_5_PERCENT),
            seconds=0.03,
            rows=lambda shots: pd_rows(
                shots,
                experiment="E2",
                case="15 ms tag, pf 5 %",
                reference=original.PD_TRACKER_5_PERCENT,
                probability=0.05,
                cells=theory.EFFECTIVE_CELLS_TRACKER,
            ),
        ),
        curve_case(
            name="K = 1",
            decision=Decision(tag=replace(THESIS_TAG, k=1)),
            levels_db=tuple(original.PD_ONE_PULSE),
            seconds=0.01,
            rows=lambda shots: pd_rows(
                shots,
                experiment="E2",
                case="K = 1, pf 1 %",
                reference=original.PD_ONE_PULSE,
                k=1,
            ),
        ),
        curve_case(
            name="fading",
            decision=Decision(strength="rician"),
            levels_db=(8.0, 9.0, 10.0),
            seconds=0.018,
            per_level=200,
            rows=_spread_rows("fading of 6 dB"),
        ),
        curve_case(
            name="ramp",
            decision=Decision(strength="ramp"),
            levels_db=(8.0, 9.0, 10.0),
            seconds=0.018,
            per_level=200,
            rows=_spread_rows("3 dB from pulse to pulse"),
        ),
    )


E2 = Experiment(name="E2", title="Pd of single decisions", cases=_sensitivity())

_COST_S = {1: 0.006, 2: 0.01, 5: 0.035, 8: 0.1, 12: 1.45}
"""CPU time of a decision of the whole channel."""


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

    return curve_case(
        name=f"K = {k}",
        decision=Decision(tag=replace(THESIS_TAG, k=k)),
        levels_db=(expected - 0.2, expected + 0.4, expected + 1.0),
        seconds=_COST_S[k],
        # Twelve pulses cost ten times as much as eight.
        per_level=FULL_TRIALS if k < 12 else FULL_TRIALS // 3,
        rows=rows,
    )


def long_tag(k: int, jitter_s: float) -> Tag:
    """The thesis's tag with its interval known to 0.125 ms: for long integration."""
    return replace(THESIS_TAG, k=k, interval_uncertainty_s=0.000125, interval_jitter_s=jitter_s)


def long_decision(k: int, jitter_s: float, *, drifting: bool = False) -> Decision:
    """Everything as far off as the bar allows: interval, jitter, frequency, drifts."""
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
    """Decisions with and without drift take turns; the same seeds would not pair them."""
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
            Row(
                experiment="E3",
                quantity="cost of drift, dB",
                case=f"K = {k}, 1e-6 of the interval per pulse and 0.2 Hz/s",
                figure=cost,
                low=cost - half,
                high=cost + half,
                n=len(outcomes),
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
    )


def _alarms(k: int, stretches: int, stretch_s: float, seconds: float) -> Case:
    """False alarms at this K: a low ENR bought with false alarms would be none."""
    tag = long_tag(k, 0.002) if k >= 20 else replace(THESIS_TAG, k=k)
    probability = 0.05
    tag = replace(tag, false_alarm_probability=probability)
    where = "± 100 Hz" if k >= 20 else "whole channel"
    return Case(
        name=f"K = {k}, false alarms",
        trials=stretches,
        seconds=seconds,
        trial=lambda rng, _: count_false(
            rng,
            tag,
            frequency_window_hz=100.0 if k >= 20 else WHOLE_CHANNEL_HZ,
            stretch_s=stretch_s,
        ),
        rows=lambda outcomes: [
            false_alarm_row(
                outcomes,
                experiment="E3",
                case=f"K = {k}, {where}",
                probability=probability,
            )
        ],
    )


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
        _alarms(12, 90, 100.0, 9.5),
        _alarms(20, 100, 300.0, 0.7),
        _alarms(40, 150, 300.0, 1.2),
    ),
)
