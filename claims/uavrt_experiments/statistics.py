"""Figures with their 95 % intervals."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Interval = tuple[float, float, float]
"""A figure, and the ends of its 95 % interval."""
Figure = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""A figure over runs, computed along the last axis: a median, a root of mean squares …"""
Z95 = 1.96
_RESAMPLES = 400
_NEAR_DB = 1.5
"""Range around the requested level in which a Pd curve is fitted by a logistic function of the
ENR [dB]."""


def wilson_interval(hits: float, trials: int) -> tuple[float, float]:
    """95 % interval of a probability (Wilson's score)."""
    if trials == 0:
        return 0.0, 1.0
    from scipy.stats import binomtest

    interval = binomtest(round(hits), trials).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def poisson_interval(count: int) -> tuple[float, float]:
    """95 % interval of the mean of a Poisson count (Garwood's, by the chi-square law)."""
    from scipy.stats import chi2

    low = float(chi2.ppf(0.025, 2 * count)) / 2.0 if count else 0.0
    return low, float(chi2.ppf(0.975, 2 * (count + 1))) / 2.0


def bootstrap_interval(values: NDArray[np.float64], figure: Figure) -> tuple[float, float]:
    """95 % interval of a figure over runs, from the percentiles of resampled runs."""
    if len(values) < 2:
        return float(figure(values)), float(figure(values))
    rng = np.random.default_rng(len(values))
    resampled = values[rng.integers(0, len(values), (_RESAMPLES, len(values)))]
    low, high = np.percentile(figure(resampled), [2.5, 97.5])
    return float(low), float(high)


def count_interval(counts: Sequence[int]) -> tuple[float, float]:
    """95 % interval of the mean of a sum of counts that may come in clusters.

    One confirmed false track makes several groups: where the counts of equal stretches scatter
    more than Poisson's, the interval is widened in proportion (quasi-Poisson).
    """
    total = sum(counts)
    low, high = poisson_interval(total)
    if len(counts) < 2 or not total:
        return low, high
    wider = math.sqrt(max(1.0, float(np.var(counts, ddof=1)) / (total / len(counts))))
    return max(0.0, total - wider * (total - low)), total + wider * (high - total)


def mean_interval(values: Sequence[float]) -> tuple[float, float]:
    """95 % interval of a mean; infinitely wide for one value."""
    mean = float(np.mean(values))
    if len(values) < 2:
        return -math.inf, math.inf
    half = Z95 * float(np.std(values, ddof=1)) / math.sqrt(len(values))
    return mean - half, mean + half


def rms(values: Sequence[float]) -> Interval:
    """Root of the mean square, and its 95 % interval."""
    if not len(values):
        return math.nan, 0.0, math.inf
    squares = np.square(np.asarray(values, np.float64))
    mean = float(squares.mean())
    half = Z95 * float(squares.std()) / math.sqrt(len(squares))
    return math.sqrt(mean), math.sqrt(max(0.0, mean - half)), math.sqrt(mean + half)


def share_of(hits: int, trials: int) -> Interval:
    """Share of trials that succeeded, with Wilson's interval; 0 without trials."""
    return hits / max(trials, 1), *wilson_interval(hits, trials)


def share_by_flight(hits: Sequence[int], trials: Sequence[int]) -> Interval:
    """Mean share over flights; the wider of the interval over flights and over pulses.

    The pulses of a flight are not independent: one late confirmation costs many.
    """
    shares = [h / t for h, t in zip(hits, trials, strict=True) if t]
    if not shares:
        return 0.0, 0.0, 1.0
    low, high = wilson_interval(sum(hits), sum(trials))
    if len(shares) > 1:
        over = mean_interval(shares)
        low, high = min(low, over[0]), max(high, over[1])
    return float(np.mean(shares)), max(0.0, low), min(1.0, high)


def quantile(values: Sequence[float], share: float) -> Interval:
    """Quantile with the 95 % interval of its order statistics.

    The number of values below the true quantile is binomial. The interval's ends are the values
    whose ranks are the 2.5 % and 97.5 % points of that distribution.
    """
    ordered = np.sort(np.asarray(values, np.float64))
    count = len(ordered)
    if not count:
        return math.nan, -math.inf, math.inf
    from scipy.stats import binom

    below = binom.cdf(np.arange(count + 1), count, share)
    low = int(np.searchsorted(below, 0.025, side="right"))
    high = int(np.searchsorted(below, 0.975))
    return (
        float(np.quantile(ordered, share)),
        float(ordered[low - 1]) if low else -math.inf,
        float(ordered[high]) if high < count else math.inf,
    )


def level_for(
    points: Sequence[tuple[float, int, int]], share: float
) -> tuple[float, float, float, float]:
    """Level at which a detection curve reaches a share.

    A logistic function of the level is fitted by maximum likelihood to the points within
    1.5 dB of the answer, half a hit and half a miss added to each point.

    Returns: level, its 95 % interval (delta method), and the standard error [dB]. Where all or
    none were found no curve can be fitted: the level is then beyond the levels tried.

    `points`: each (level_db, hits, trials).
    """
    if not any(hits for _, hits, _ in points):
        beyond = max(at for at, _, _ in points)
        return math.inf, beyond, math.inf, math.inf
    if all(hits == trials for _, hits, trials in points):
        beyond = min(at for at, _, _ in points)
        return -math.inf, -math.inf, beyond, math.inf
    chosen = list(points)
    level, error = _logistic(chosen, share)
    for _ in range(2):
        near = [p for p in points if abs(p[0] - level) <= _NEAR_DB]
        if len(near) < 2 or near == chosen:
            break
        chosen = near
        closer, its_error = _logistic(chosen, share)
        if abs(closer - level) > _NEAR_DB:
            break  # points that are equal give no slope
        level, error = closer, its_error
    return level, level - Z95 * error, level + Z95 * error, error


def _logistic(points: Sequence[tuple[float, int, int]], share: float) -> tuple[float, float]:
    at = np.array([p[0] for p in points])
    middle = float(at.mean())
    design = np.column_stack((np.ones(len(at)), at - middle))
    trials = np.array([p[2] for p in points]) + 1.0
    hits = np.array([p[1] for p in points]) + 0.5
    weights = np.array([0.0, 1.0])
    for _ in range(50):
        fitted = 1.0 / (1.0 + np.exp(-np.clip(design @ weights, -30.0, 30.0)))
        information = design.T @ (design * (trials * fitted * (1.0 - fitted))[:, None])
        # Levenberg's small ridge: few trials may separate perfectly.
        step = np.linalg.solve(
            information + 1e-6 * np.eye(2), design.T @ (hits - trials * fitted)
        )
        step = np.clip(step, -2.0, 2.0)
        before = _likelihood(design @ weights, hits, trials)
        # A whole step may lead beyond the maximum, and farther from it each time.
        while _likelihood(design @ (weights + step), hits, trials) < before - 1e-9:
            step = 0.5 * step
        weights = weights + step
        if float(np.abs(step).max()) < 1e-10:
            break
    slope = max(float(weights[1]), 1e-3)
    logit = math.log(share / (1.0 - share))
    level = (logit - float(weights[0])) / slope
    gradient = np.array([-1.0 / slope, -level / slope])
    covariance = np.linalg.inv(information + 1e-6 * np.eye(2))
    return level + middle, math.sqrt(float(gradient @ covariance @ gradient))


def _likelihood(
    logits: NDArray[np.float64], hits: NDArray[np.float64], trials: NDArray[np.float64]
) -> float:
    """Log-likelihood of a number of hits."""
    return float(hits @ logits - trials @ np.logaddexp(0.0, logits))
