"""Compute the likelihood of a bearing given the powers of a turn, averaged over level and
fading.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.bearing.tuning import PATTERN
from uavrt.localization.power_law import PowerTables
from uavrt.localization.tuning import POWER_LAW

Gain = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Function from bearings (b,) [deg] to the antenna's gain at n pulses (n, b), relative to
boresight [dB]."""

GRID_DEG = np.arange(0.0, 360.0, PATTERN.grid_step_deg)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BearingLikelihood:
    """Likelihood of each bearing on the grid `GRID_DEG`, with the fitted level and fading."""

    log_density: NDArray[np.float64]
    """Log-likelihood of each bearing, averaged over the priors of level and fading, shape
    (1440,)."""
    log_flat: float
    """Log-likelihood of a signal without direction: mean of noise alone and of a constant tag
    level."""
    fading_db: float
    """Posterior mean of the standard deviation of fading from pulse to pulse [dB]."""
    level_db: float
    """SNR on boresight that fits best at the most likely bearing [dB]."""
    level_sigma_db: float


def bearing_likelihood(
    tables: PowerTables, gain: Gain, noise_db: NDArray[np.float64]
) -> BearingLikelihood:
    """Compute the likelihood of bearings on a coarse grid, and near the peak on a fine grid.

    `gain` is the antenna's gain at each pulse towards a bearing. `noise_db` (n,) is the noise
    of each pulse relative to the median noise [dB].
    """
    pulses = len(noise_db)
    last = round((tables.highest_db - tables.lowest_db) / POWER_LAW.level_step_db)
    first = round(PATTERN.lowest_level_db / POWER_LAW.level_step_db)
    prior = -np.log(
        (last + tables.lowest_db / POWER_LAW.level_step_db - first) * POWER_LAW.level_step_db
    )

    def places_of(bearing_deg: NDArray[np.float64]) -> NDArray[np.float64]:
        return (
            gain(bearing_deg) - noise_db[:, None] - tables.lowest_db
        ) / POWER_LAW.level_step_db

    every = np.arange(
        first, round(tables.highest_db / POWER_LAW.level_step_db), PATTERN.coarse_level_steps
    )
    coarse_deg = np.arange(0.0, 360.0, PATTERN.coarse_step_deg)
    starts = np.full(len(coarse_deg), first)
    coarse = _summed(tables.log_likelihood, places_of(coarse_deg), starts, every - first)
    step_db = PATTERN.coarse_level_steps * POWER_LAW.level_step_db
    coarse_marginal = _log_mean(_log_integral(coarse, step_db) + prior)
    kept = coarse_marginal > coarse_marginal.max() - PATTERN.refined_nats
    best_level = every[np.argmax(_log_mean(coarse), axis=1)]

    # With few pulses the level is uncertain: use longer steps, so that the window contains it.
    level_step = 1 if pulses >= 30 else 2 if pulses >= 10 else 4
    spread = level_step * np.arange(2 * PATTERN.levels_each_side + 1)
    part = max(1, round(12 * min(1.0, 30.0 / np.count_nonzero(kept))))
    offsets = (np.arange(part) / part - 0.5) * PATTERN.coarse_step_deg
    fine_deg = (coarse_deg[kept][:, None] + offsets).ravel()
    starts = np.repeat(best_level[kept], part) - level_step * PATTERN.levels_each_side
    fine = _summed(tables.log_likelihood, places_of(fine_deg), starts, spread)
    fine_marginal = _log_integral(fine, level_step * POWER_LAW.level_step_db) + prior

    known_deg = np.concatenate([coarse_deg[~kept], fine_deg])
    known = np.concatenate([coarse_marginal[~kept], _log_mean(fine_marginal)])
    density = np.interp(GRID_DEG, *_sorted(known_deg, known), period=360.0)

    top = int(np.argmax(_log_mean(fine_marginal)))
    share = np.exp(fine_marginal[top] - fine_marginal[top].max())
    level, sigma = _moments(fine[top], (starts[top] + spread) * POWER_LAW.level_step_db)
    flat = np.arange(round(tables.highest_db / POWER_LAW.level_step_db) - first)
    flat_places = (-noise_db[:, None] - tables.lowest_db) / POWER_LAW.level_step_db
    equal = _summed(tables.log_likelihood, flat_places, np.array([first]), flat)
    log_equal = _log_mean(_log_integral(equal, POWER_LAW.level_step_db) + prior)[0]
    log_noise = _log_mean(tables.log_likelihood[:, 0, :].sum(axis=0, dtype=np.float64))
    return BearingLikelihood(
        log_density=density,
        log_flat=float(np.logaddexp(log_equal, log_noise) - np.log(2.0)),
        fading_db=float(np.dot(share, tables.fadings_db) / share.sum()),
        level_db=level,
        level_sigma_db=sigma,
    )


def _sorted(
    bearing_deg: NDArray[np.float64], value: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    order = np.argsort(np.remainder(bearing_deg, 360.0))
    return np.remainder(bearing_deg, 360.0)[order], value[order]


def _summed(
    tables: NDArray[np.float32],
    places: NDArray[np.float64],
    starts: NDArray[np.int64],
    steps: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Sum of all pulses' log-likelihoods, interpolated in tables: (bearings, levels, fadings).

    `tables`: shape (n, steps, fadings).
    `places` (n, b): index in each pulse's table of 0 dB on boresight, for each bearing [steps].
    `starts` (b,): lowest boresight level for each bearing [steps].
    `steps` (k,): offsets of all boresight levels from the lowest [steps].
    """
    last = tables.shape[1] - 2
    total = np.zeros((len(starts), len(steps), tables.shape[2]), np.float64)
    below = np.floor(places)
    parts = (places - below).astype(np.float32)[:, :, None, None]
    # Bearings share rows: the needed columns of each first row are copied once.
    firsts = below.astype(np.intp) + starts
    lowest = firsts.min()
    rows = np.clip(np.arange(lowest, firsts.max() + 1)[:, None] + steps, 0, last)
    low, more = (np.empty(total.shape, np.float32) for _ in range(2))
    slopes = np.diff(tables, axis=1)
    for table, slope, first, part in zip(tables, slopes, firsts - lowest, parts, strict=True):
        table.take(rows, axis=0).take(first, axis=0, out=low, mode="clip")
        slope.take(rows, axis=0).take(first, axis=0, out=more, mode="clip")
        more *= part
        low += more
        total += low
    return total


def _log_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithm of the mean of exp(values) over the last axis, which holds equally probable
    fadings.
    """
    top = values.max(axis=-1, keepdims=True)
    return np.asarray(np.log(np.mean(np.exp(values - top), axis=-1)) + top[..., 0])


def _log_integral(values: NDArray[np.float64], step_db: float) -> NDArray[np.float64]:
    """Logarithm of the integral of exp(values) over the levels (axis 1).

    A sum over levels would depend on the position of a peak that is narrower than the step. For
    such a peak, a parabola through the best three levels gives height and width (Laplace's
    method).
    """
    best = np.clip(np.argmax(values, axis=1), 1, values.shape[1] - 2)[:, None, :]
    left, middle, right = (
        np.take_along_axis(values, best + shift, axis=1)[:, 0, :] for shift in (-1, 0, 1)
    )
    curvature = np.maximum(2.0 * middle - left - right, 1e-9)
    peak = middle + (right - left) ** 2 / (8.0 * curvature)
    laplace = peak + 0.5 * np.log(2.0 * np.pi / curvature)
    summed = np.log(np.sum(np.exp(values - middle[:, None, :]), axis=1)) + middle
    narrow = (curvature > 1.0) & (np.abs(right - left) <= curvature)
    return np.asarray(np.where(narrow, laplace, summed) + np.log(step_db))


def _moments(values: NDArray[np.float64], level_db: NDArray[np.float64]) -> tuple[float, float]:
    weight = np.exp(values - values.max()).sum(axis=1)
    weight /= weight.sum()
    mean = float(weight @ level_db)
    variance = float(weight @ (level_db - mean) ** 2)
    return mean, max(variance, (POWER_LAW.level_step_db / 2.0) ** 2) ** 0.5
