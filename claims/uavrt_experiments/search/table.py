"""Rows of the search tables: each planner's figures with intervals, and the requirements."""

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.guidance.search.neighbour_drones import SEPARATION
from uavrt_experiments.figures import mean, measured, median, rms, share, tenth_worst
from uavrt_experiments.result import Row
from uavrt_experiments.search.bounds import least_mean_m, least_rms_m
from uavrt_experiments.search.drones import starts_of
from uavrt_experiments.search.flight import Judged, Outcome
from uavrt_experiments.search.scenario import (
    APART,
    ERROR_THAN_ONE,
    FARTHEST,
    FASTER,
    PUBLISHED,
    THAN_PUBLISHED,
    Bar,
    Contender,
    Scenario,
)
from uavrt_experiments.statistics import Figure
from uavrt_experiments.tables import aligned

_Floats = NDArray[np.float64]
_COMPLETE = "complete, share"
_HELD = "95 % circle holds, share"
_FALSE = "false found, share"
_THAN_EASIER = "time over that of the easier case"
_HEAD_WIDTH = 13


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """All runs of one planner."""

    contender: Contender
    outcomes: tuple[Outcome, ...]


def p95(values: _Floats) -> _Floats:
    """Value that a twentieth of the runs exceed."""
    return np.asarray(np.quantile(values, 0.95, axis=-1))


def results(scenario: Scenario, flown: Sequence[Flown]) -> list[Row]:
    """Rows of a scenario; the requirements are in the rows of our planner."""
    rows = [row for one in flown for row in _rows(scenario, one)]
    ours = [one for one in flown if one.contender.planner == "mi_rate"]
    ours = [one for one in ours if not one.contender.easier]
    for one in ours:
        same = [
            (THAN_PUBLISHED, other)
            for other in flown
            if other.contender == PUBLISHED and one.contender.stop == PUBLISHED.stop
        ]
        same += [
            (_THAN_EASIER, other)
            for other in flown
            if other.contender == replace(one.contender, easier=True)
        ]
        rows += [_ratio(scenario, quantity, one, other) for quantity, other in same]
        alone = replace(one.contender, drones=1, corners=False)
        rows += [
            row
            for other in flown
            if one.contender.drones > 1 and other.contender == alone
            for row in _than_one(scenario, one, other)
        ]
    return rows


def honesty(tables: Sequence[Flown]) -> list[Row]:
    """Rows on the coverage of the stated circles, over all runs of our planner and stop rule.

    `tables`: runs of all scenarios.
    """
    all_runs = [
        run
        for one in tables
        if one.contender.planner == "mi_rate" and one.contender.stop == "ours"
        for run in one.outcomes
    ]
    judged = [j for run in all_runs for j in run.judged]
    if not judged:
        return []
    return [
        measured(
            "T9", "mi_rate, our stop, all tables", name, values, share, least=least, most=most
        )
        for name, values, least, most in (
            (_HELD, _held(judged), 0.93, 0.97),
            (_FALSE, _false(judged), None, 0.01),
        )
    ]


def _held(judged: Sequence[Judged]) -> list[float]:
    """For each present tag, true if the stated circle contains it."""
    return [float(j.error_m <= j.radius95_m) for j in judged if j.error_m is not None]


def _false(judged: Sequence[Judged]) -> list[float]:
    """For each found tag, true if it is absent, or far from its reported place."""
    return [float(j.error_m is None or j.error_m > 3.0 * j.radius95_m) for j in judged]


def _bar(scenario: Scenario, one: Flown, quantity: str) -> Bar:
    if one.contender.planner == "mi_rate" and not one.contender.easier:
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
    bounds = _bounds(runs)
    figures: list[tuple[str, list[float], Figure]] = [
        ("time, mean, s", times, mean),
        ("time, median, s", times, median),
        ("time, p90, s", times, tenth_worst),
        ("time, p95, s", times, p95),
        ("path, mean, km", [run.distance_m / 1e3 for run in runs], mean),
        (_COMPLETE, [float(run.complete) for run in runs], share),
        ("decision, median, ms", [1e3 * s for run in runs for s in run.decision_s], median),
    ]
    figures += [
        ("error, mean, m", errors, mean),
        ("error, median, m", errors, median),
        ("error, p90, m", errors, tenth_worst),
        ("error, RMS, m", errors, rms),
        (_HELD, _held(judged), share),
        (_FALSE, _false(judged), share),
    ]
    if scenario.keep_away is not None:
        near = [float(run.too_near_s > 0) for run in runs]
        figures.append(("inside the radius, share", near, share))
    if one.contender.drones > 1:
        apart = [float(run.apart_m >= SEPARATION.distance_m) for run in runs]
        figures.append((APART, apart, share))
        figures.append((FARTHEST, [_farthest_s(scenario, one, run) for run in runs], mean))
    rows: list[Row] = []
    for quantity, values, figure in figures:
        bar = _bar(scenario, one, quantity)
        if not values and bar.least is None and bar.most is None:
            continue
        rows.append(
            measured(
                scenario.name,
                str(one.contender),
                quantity,
                values,
                figure,
                least=bar.least,
                most=bar.most,
                bound=bounds.get(quantity),
            )
        )
    return rows


def _bounds(runs: Sequence[Outcome]) -> dict[str, float]:
    """Bounds of any search, by quantity; unknown ones are left out."""
    least = [run.least_time_s for run in runs if run.least_time_s is not None]
    known = [j.information for run in runs for j in run.judged if j.information is not None]
    bounds = {}
    if least:
        times = np.array(least)
        bounds = {
            "time, mean, s": float(mean(times)),
            "time, median, s": float(median(times)),
            "time, p90, s": float(tenth_worst(times)),
            "time, p95, s": float(p95(times)),
        }
    if known:
        information = np.array([[(east, both), (both, north)] for east, both, north in known])
        bounds["error, mean, m"] = least_mean_m(information)
        bounds["error, RMS, m"] = least_rms_m(information)
    return bounds


def _farthest_s(scenario: Scenario, one: Flown, run: Outcome) -> float:
    """Flight time of the nearest drone to the animal that is farthest from all starts [s]."""
    starts = starts_of(scenario, one.contender).values()
    return (
        max(
            min(float(np.hypot(x - start.east_m, y - start.north_m)) for start in starts)
            for x, y in run.ends_m
        )
        / scenario.vehicle.speed_m_s
    )


def _ratio(scenario: Scenario, quantity: str, ours: Flown, theirs: Flown) -> Row:
    """Ratio of our time to another planner's on the same seeds."""
    return _quotient(scenario, quantity, ours, (ours, theirs), _time_s)


def _than_one(scenario: Scenario, several: Flown, alone: Flown) -> list[Row]:
    """Speed and accuracy of several drones relative to one, on the same seeds."""
    faster = FASTER.format(several.contender.drones)
    return [
        _quotient(scenario, faster, several, (alone, several), _time_s),
        _quotient(scenario, ERROR_THAN_ONE, several, (several, alone), _error_m),
    ]


def _time_s(run: Outcome) -> float:
    return run.time_s


def _error_m(run: Outcome) -> float:
    return run.mean_error_m


def _quotient(
    scenario: Scenario,
    quantity: str,
    ours: Flown,
    over: tuple[Flown, Flown],
    of: Callable[[Outcome], float],
) -> Row:
    """Ratio of a sum over all runs of one planner to that of another on the same seeds."""
    top, bottom = ({run.seed: of(run) for run in one.outcomes} for one in over)
    pairs = [(top[seed], bottom[seed]) for seed in top if seed in bottom]
    numbers = np.arange(len(pairs), dtype=np.float64)
    both = np.array(pairs)

    def ratio(chosen: _Floats) -> _Floats:
        sums = np.nansum(both[chosen.astype(int)], axis=-2)
        return np.asarray(sums[..., 0] / sums[..., 1])

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


def asked_and_reached(
    scenario: Scenario, rows: Sequence[Row], cell: Callable[[Row], str]
) -> tuple[list[str], list[list[str]]]:
    """Headings, and lines of text: the requirements, then a line for each planner.

    Columns are the figures with a requirement, each followed by the bound of any search, the
    success, and the number of failed runs.
    """
    bars = {one.quantity: one for one in rows if one.barred}
    quantities = [bar.quantity for bar in scenario.bars]
    quantities += [_COMPLETE] if _COMPLETE not in quantities else []
    bounded = {one.quantity for one in rows if one.bound is not None}
    asked = [(bars[q].bar if q in bars else "", "") for q in quantities]
    heads = [(q, "bound") for q in quantities]
    lines = [["asked", *_with_bounds(asked, quantities, bounded), ""]]
    for case in dict.fromkeys(one.case for one in rows):
        own = {one.quantity: one for one in rows if one.case == case}
        found = own[_COMPLETE]
        failed = round(found.n * (1.0 - found.figure))
        cells = [
            (cell(own[one]), _bound_text(own[one])) if one in own else ("", "")
            for one in quantities
        ]
        lines.append(
            [case, *_with_bounds(cells, quantities, bounded), f"{failed} of {found.n}"]
        )
    return ["", *_with_bounds(heads, quantities, bounded), "runs failed"], lines


def _with_bounds(
    cells: Sequence[tuple[str, str]], quantities: Sequence[str], bounded: set[str]
) -> list[str]:
    """Cells of figures, each followed by its bound if the quantity has one."""
    return [
        text
        for pair, quantity in zip(cells, quantities, strict=True)
        for text in (pair if quantity in bounded else pair[:1])
    ]


def _bound_text(one: Row) -> str:
    return "" if one.bound is None else f"{one.bound:.3g}"


def section(scenario: Scenario, rows: Sequence[Row]) -> str:
    """Format a scenario for a terminal: a line for each planner.

    The CSV file has all other figures.
    """
    names, lines = asked_and_reached(scenario, rows, figure_text)
    heads = [textwrap.wrap(one, _HEAD_WIDTH) for one in names]
    height = max(map(len, heads))
    top = [[head[n] if n < len(head) else "" for head in heads] for n in range(height)]
    text = [f"{scenario.name}  {scenario.title}", aligned([*top, *lines])]
    text += [
        f"{one.verdict}: {one.quantity} {one.figure:.3g}, asked {one.bar} ({one.case})"
        for one in rows
        if one.barred and not one.met
    ]
    return "\n".join(text)


def figure_text(one: Row) -> str:
    """Format a figure with its 95 % interval."""
    figure, low, high = (
        f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"
        for value in (one.figure, one.low, one.high)
    )
    return f"{figure} ({low}–{high})"
