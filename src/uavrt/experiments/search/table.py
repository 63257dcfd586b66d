"""Rows of the tables: each contender's figures with their intervals, and the bars."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.experiments.figures import (
    mean,
    measured,
    median,
    share,
    tenth_worst,
)
from uavrt.experiments.result import Row
from uavrt.experiments.search.flight import Outcome
from uavrt.experiments.search.scenario import Bar, Contender, Scenario

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """All runs of one contender."""

    contender: Contender
    outcomes: tuple[Outcome, ...]


def p95(values: _Floats) -> float:
    """Value that a twentieth of the runs exceed."""
    return float(np.quantile(values, 0.95))


def results(scenario: Scenario, flown: Sequence[Flown]) -> list[Row]:
    """Rows of a scenario; the bars stand beside those of our planner."""
    rows = [row for one in flown for row in _rows(scenario, one)]
    ours = [one for one in flown if one.contender == Contender(planner="mi_rate")]
    theirs = Contender(planner="renyi", filter="TrackerBots")
    rivals = [one for one in flown if one.contender == theirs]
    return [*rows, *(_ratio(scenario, a, b) for a in ours for b in rivals)]


def _bar(scenario: Scenario, one: Flown, quantity: str) -> Bar:
    """The bar of a quantity, for our planner alone."""
    if one.contender.planner == "mi_rate":
        for bar in scenario.bars:
            if bar.quantity == quantity:
                return bar
    return Bar(quantity=quantity)


def _rows(scenario: Scenario, one: Flown) -> list[Row]:
    runs = one.outcomes
    judged = [j for run in runs for j in run.judged]
    there = [j for j in judged if j.error_m is not None]
    errors = [j.error_m for j in there if j.error_m is not None]
    times = [run.time_s for run in runs]
    figures: list[tuple[str, list[float], Callable[[_Floats], float]]] = [
        ("time, mean, s", times, mean),
        ("time, median, s", times, median),
        ("time, p90, s", times, tenth_worst),
        ("time, p95, s", times, p95),
        ("way, mean, km", [run.distance_m / 1e3 for run in runs], mean),
        ("complete, share", [float(run.complete) for run in runs], share),
        ("decision, median, ms", [1e3 * s for run in runs for s in run.decision_s], median),
    ]
    if errors:
        held = [float((j.error_m or 0.0) <= j.radius95_m) for j in there]
        false = [float(j.error_m is None or j.error_m > 3.0 * j.radius95_m) for j in judged]
        figures += [
            ("error, mean, m", errors, mean),
            ("error, median, m", errors, median),
            ("error, p90, m", errors, tenth_worst),
            ("95 % circle holds, share", held, share),
            ("false found, share", false, share),
        ]
    if scenario.keep_away is not None:
        near = [float(run.too_near_s > 0) for run in runs]
        figures.append(("inside the radius, share", near, share))
    rows = []
    for quantity, values, figure in figures:
        bar = _bar(scenario, one, quantity)
        rows.append(
            measured(
                scenario.name,
                str(one.contender),
                quantity,
                values,
                figure,
                least=bar.least,
                most=bar.most,
            )
        )
    return rows


def _ratio(scenario: Scenario, ours: Flown, theirs: Flown) -> Row:
    """Time of ours over theirs on the same seeds."""
    quantity = "time over that of renyi, filter TrackerBots"
    by_seed = {run.seed: run.time_s for run in theirs.outcomes}
    pairs = [(run.time_s, by_seed[run.seed]) for run in ours.outcomes if run.seed in by_seed]
    numbers = np.arange(len(pairs), dtype=np.float64)
    both = np.array(pairs)

    def ratio(chosen: _Floats) -> float:
        rows = both[chosen.astype(int)]
        return float(rows[:, 0].sum() / rows[:, 1].sum())

    bar = _bar(scenario, ours, quantity)
    return measured(
        scenario.name,
        str(ours.contender),
        quantity,
        numbers.tolist(),
        ratio,
        least=bar.least,
        most=bar.most,
    )
