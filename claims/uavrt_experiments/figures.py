"""Figures computed over many runs, with intervals, as rows of a table."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from uavrt_experiments.result import Row
from uavrt_experiments.statistics import bootstrap_interval, wilson_interval


def measured(
    experiment: str,
    condition: str,
    quantity: str,
    values: Sequence[float],
    figure: Callable[[NDArray[np.float64]], float],
    *,
    least: float | None = None,
    most: float | None = None,
    bound: float | None = None,
) -> Row:
    """Make the row of a figure over runs, with its 95 % interval.

    `experiment`, `condition`, `quantity`: description of the measurement.
    `values`: one for each run. Without any, the figure is not a number, and misses its bar.
    `figure`: computes the figure from values: a median, a root of mean squares …
    `least`, `most`, `bound`: required range, and theoretical bound.
    """
    array = np.asarray(values, np.float64)
    low, high = (
        (math.nan, math.nan)
        if not len(array)
        # Right also for shares of 0 and 1, of which a bootstrap makes certainty.
        else wilson_interval(int(array.sum()), len(array))
        if figure is share
        else bootstrap_interval(array, figure)
    )
    return Row(
        experiment=experiment,
        case=condition,
        quantity=quantity,
        figure=figure(array) if len(array) else math.nan,
        low=low,
        high=high,
        n=len(array),
        least=least,
        most=most,
        bound=bound,
    )


def rms(values: NDArray[np.float64]) -> float:
    """Root of the mean square of values."""
    return float(np.sqrt(np.mean(values**2)))


def median(values: NDArray[np.float64]) -> float:
    """Median of values."""
    return float(np.median(values))


def mean(values: NDArray[np.float64]) -> float:
    """Arithmetic mean of values."""
    return float(np.mean(values))


def tenth_worst(values: NDArray[np.float64]) -> float:
    """Value that a tenth of the runs exceed."""
    return float(np.quantile(values, 0.9))


def share(values: NDArray[np.float64]) -> float:
    """Share of runs with a true value."""
    return float(np.mean(values))
