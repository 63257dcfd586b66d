"""E2: probability of detection of single decisions, by ENR."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from uavrt_experiments.detection import original, theory
from uavrt_experiments.detection.cases import FULL_TRIALS, Case, Experiment
from uavrt_experiments.detection.signals import THESIS_TAG, TRACKER_TAG
from uavrt_experiments.detection.trials import Decision
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import level_for, share_of

_CLEARLY_DB = 1.5
_CLEARLY_PD = 0.8
Shot = tuple[float, bool]
"""ENR of a decision [dB], and True if the group was found."""


def points_of(shots: Sequence[Shot]) -> list[tuple[float, int, int]]:
    """Level [dB], hits and number of trials of each level."""
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
    short: Case | None = None,
) -> Case:
    """Case with decisions at several levels in turn; its default short form has four
    at each.
    """

    def trial(rng: np.random.Generator, index: int) -> Shot:
        level = levels_db[index % len(levels_db)]
        return level, decision.found(rng, level)

    case = Case(
        name=name,
        trials=per_level * len(levels_db),
        least=8 * len(levels_db),
        seconds=seconds,
        trial=trial,
        rows=rows,
    )
    return replace(case, short=short or replace(case, least=4 * len(levels_db)))


def clearly_above(
    *, experiment: str, name: str, decision: Decision, bar_db: float, trials: int
) -> Case:
    """Short form of a curve: decisions at 1.5 dB above the required ENR.

    If half of them are required at the ENR, nine in ten or more are expected there. A few
    trials at the required ENR itself show nothing, because a curve fitted only to misses may
    reach a half anywhere.
    """
    level = bar_db + _CLEARLY_DB

    def rows(hits: Sequence[bool]) -> list[Row]:
        return [
            Row.with_interval(
                experiment,
                "Pd",
                f"{name}, {level:g} dB",
                share_of(sum(hits), len(hits)),
                len(hits),
                least=_CLEARLY_PD,
            )
        ]

    return Case(
        name=f"{name}, in short",
        trials=trials,
        least=trials,
        seconds=0.1,
        trial=lambda rng, _: decision.found(rng, level),
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
    """Rows with Pd at each level; at least the original's is required."""
    rows = []
    for level, hits, trials in points_of(shots):
        rows.append(
            Row.with_interval(
                experiment,
                "Pd",
                f"{case}, {level:g} dB",
                share_of(hits, trials),
                trials,
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
    """Row with the ENR [dB] at which a curve reaches a share."""
    level, low, high, _ = level_for(points_of(shots), share)
    return Row.with_interval(
        experiment,
        f"ENR for Pd {share:g}, dB",
        case,
        (level, low, high),
        len(shots),
        most=most,
        original=original,
        genie=genie,
        union=union,
        at=at,
        note=note,
    )


def level_of_bound(bound: Callable[[float], float], share: float) -> float:
    """ENR [dB] at which a theoretical bound reaches a share."""
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
                at=3.0 if share == 0.5 else None,
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
