"""Figures computed over many runs, with intervals, as rows of a table."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavrt_experiments.result import Row
from uavrt_experiments.statistics import Figure, bootstrap_interval, wilson_interval

_Values = NDArray[np.float64]


def measured(
    experiment: str,
    condition: str,
    quantity: str,
    values: Sequence[float],
    figure: Figure,
    *,
    least: float | None = None,
    most: float | None = None,
    bound: float | None = None,
) -> Row:
    """Make the row of a figure over runs, with its 95 % interval.

    `experiment`, `condition`, `quantity`: description of the measurement.
    `values`: one for each run. Without any, the figure is not a number, and misses its bar.
    `figure`: computes the figure from values.
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
        figure=float(figure(array)) if len(array) else math.nan,
        low=low,
        high=high,
        n=len(array),
        least=least,
        most=most,
        bound=bound,
    )


def rms(values: _Values) -> _Values:
    """Root of the mean square of values."""
    return np.asarray(np.sqrt(np.mean(values**2, axis=-1)))


def median(values: _Values) -> _Values:
    """Median of values."""
    return np.asarray(np.median(values, axis=-1))


def mean(values: _Values) -> _Values:
    """Arithmetic mean of values."""
    return np.asarray(np.mean(values, axis=-1))


def tenth_worst(values: _Values) -> _Values:
    """Value that a tenth of the runs exceed."""
    return np.asarray(np.quantile(values, 0.9, axis=-1))


def share(values: _Values) -> _Values:
    """Share of runs with a true value."""
    return np.asarray(np.mean(values, axis=-1))
