"""The bars of bearings and positions, with intervals and bounds."""

from collections.abc import Callable

from uavrt.experiments.figures import COLUMNS, cells, table
from uavrt.experiments.localization import (
    array_bars,
    bearing_bars,
    common_error_bars,
    position_bars,
)
from uavrt.experiments.result import Row

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
}
"""Name to experiment; each takes the number of runs and a seed."""


def run(runs: int = 200, seed: int = 1) -> list[Row]:
    """Run all experiments; seven minutes of one core for 200 runs."""
    return [one for experiment in EXPERIMENTS.values() for one in experiment(runs, seed)]


__all__ = ["COLUMNS", "EXPERIMENTS", "Row", "cells", "run", "table"]
