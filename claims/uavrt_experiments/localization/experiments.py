"""All experiments on bearings and positions, by name, and their runner."""

from collections.abc import Callable

from uavrt_experiments.localization import (
    array_bars,
    bearing_bars,
    circle_bars,
    common_error_bars,
    misfit_worlds,
    moving_bars,
    position_bars,
    posterior_calibration,
    small_survey_bars,
    survey_error_bars,
)
from uavrt_experiments.result import Row


def _circles(runs: int, seed: int) -> list[Row]:
    return circle_bars.circles(runs, seed) + survey_error_bars.survey_errors(runs, seed)


EXPERIMENTS: dict[str, Callable[[int, int], list[Row]]] = {
    "B1, B2": bearing_bars.known_phase,
    "B3, B4": bearing_bars.censored,
    "B5": bearing_bars.wrong_pattern,
    "B6": bearing_bars.nothing_there,
    "A1": array_bars.switched,
    "L2, L3": position_bars.crossings,
    "L4": position_bars.surveys,
    "L5": position_bars.fusion,
    "L6": common_error_bars.common_errors,
    "L7": _circles,
    "L8": small_survey_bars.small_surveys,
    "L9": moving_bars.moving_tags,
    "M1": misfit_worlds.misfit_worlds,
    "C1": posterior_calibration.calibrations,
}
"""Experiment functions by name; each takes the number of runs and a seed."""


def run(runs: int = 200, seed: int = 1) -> list[Row]:
    """Run all experiments; about twenty minutes of one core for 200 runs."""
    return [one for experiment in EXPERIMENTS.values() for one in experiment(runs, seed)]
