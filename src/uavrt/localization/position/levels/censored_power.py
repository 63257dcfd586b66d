"""Fit pulse powers over distance when weak pulses were missed.

A fit to the received pulses alone is biased: near the threshold, the loss seems not to increase
with distance. So each missed pulse is replaced by its expected level below the threshold, and
the fit is repeated (expectation maximisation of Tobin's model). Some pulses are missed for
other reasons, such as an interferer; their share is estimated at each position in the same way.
A fit can also allow for pulses of other senders, which have any strength; then the probability
of this is estimated for each received pulse.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavrt.core.runtime.lean_scipy import special
from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.position.tuning import POWER
from uavrt.localization.tuning import LEVELS

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PowerFit:
    """Fitted level and path loss exponent at each position, and the log-likelihood."""

    log_likelihood: _Floats
    level_db: _Floats
    exponent: _Floats
    missed_db: _Floats | None = None
    """(places, misses) expected fading of each miss, given that it was missed [dB]; None: the
    fit is to received pulses."""


def regression_sums(
    x: NDArray[np.floating],
    z: NDArray[np.floating],
    weight: NDArray[np.floating] | None = None,
) -> _Floats:
    """Sums of x, z, xx, xz and zz over the pulses of (places, pulses) arrays, shape (5,
    places).
    """
    wx, wz = (x, z) if weight is None else (weight * x, weight * z)
    first = [np.asarray(one.sum(axis=1), np.float64) for one in (wx, wz)]
    return np.stack([*first, dot(wx, x), dot(wx, z), dot(wz, z)])


def dot(a: NDArray[np.floating], b: NDArray[np.floating]) -> _Floats:
    """Sums over the pulses of products of (places, pulses) arrays, shape (places,)."""
    return np.asarray(np.einsum("ij,ij->i", a, b), np.float64)


def thinned(missed: NDArray[np.intp]) -> tuple[NDArray[np.intp], _Floats]:
    """Missed pulses, thinned out where many follow each other; how many each represents.

    A miss between received pulses represents no other: counted twice, it would shift positions.
    """
    every = max(1, -(-len(missed) // POWER.most_misses))
    number = np.arange(len(missed))
    begins = np.diff(missed, prepend=-2) > 1
    since = number - np.maximum.accumulate(np.where(begins, number, 0))
    starts = np.flatnonzero(since % every == 0)
    sizes = np.diff(starts, append=len(missed))
    return missed[starts + sizes // 2], sizes.astype(np.float64)


@lru_cache(maxsize=1)
def _normal_tables() -> tuple[_Floats, _Floats, _Floats, _Floats]:
    u = np.arange(
        POWER.lowest_sigmas,
        POWER.highest_sigmas + 2.0 / POWER.table_steps,
        1.0 / POWER.table_steps,
    )
    below = special.ndtr(u)
    ratio = np.exp(-0.5 * u * u - 0.5 * np.log(2.0 * np.pi) - special.log_ndtr(u))
    return below[:-1], np.diff(below), ratio[:-1], np.diff(ratio)


def normal_tail(u: _Floats) -> tuple[_Floats, _Floats]:
    """Return the normal distribution function, and the density divided by it (inverse Mills
    ratio).

    Linear interpolation in tables is several times as fast as computing the functions, with
    errors up to 8e-6 and 2e-5. Above the tables the values remain constant; below them the
    ratio continues as the line -u, which it approaches.
    """
    below, below_steps, ratio, ratio_steps = _normal_tables()
    place = np.minimum(u, POWER.highest_sigmas)
    place -= POWER.lowest_sigmas
    place *= POWER.table_steps
    number = np.maximum(place, 0.0).astype(np.intp)
    place -= number
    of_ratio = ratio_steps[number]
    of_ratio *= place
    of_ratio += ratio[number]
    of_below = below_steps[number]
    of_below *= np.maximum(place, 0.0, out=place)
    of_below += below[number]
    return of_below, of_ratio


def censored_fit(
    loss: NDArray[np.floating],
    level_heard_db: NDArray[np.floating],
    missed_loss: _Floats,
    limit_db: _Floats,
    miss_weight: _Floats,
    propagation: Propagation,
    *,
    correlation: float = 0.0,
    foreign: bool = False,
) -> PowerFit:
    """Fit level, exponent, fading and the share of random misses at each position.

    `loss` and `level_heard_db` (places, received) are -10 log10 of the distance over 100 m,
    and the levels minus the antenna's gain. `missed_loss` and `limit_db` (places, missed) are
    the same loss for missed pulses, and upper limits of their levels. `miss_weight` (missed,)
    is the number of missed pulses that each represents. `foreign` is True if some received
    pulses may come from another sender.
    """
    heard = regression_sums(loss, level_heard_db)
    x, z = heard[:2]
    places = len(loss)
    count: int | _Floats = loss.shape[1]

    def energy(level: _Floats, exponent: _Floats) -> _Floats:
        x, z, xx, xz, zz = heard
        across = zz - 2.0 * (level * z + exponent * xz)
        along = 2.0 * level * exponent * x + exponent**2 * xx
        return np.asarray(np.maximum(across + along + level**2 * count, 1e-9))

    exponent = np.full(places, propagation.exponent)
    level = (z - exponent * x) / count
    sigma = np.full(places, LEVELS.fading_db)
    chance = np.full(places, LEVELS.outlier_share)
    everything = loss.shape[1] + miss_weight.sum() + POWER.missed_pulses
    for _ in range(POWER.foreign_rounds if foreign else POWER.censored_rounds):
        if foreign:
            own, log_heard = _own_share(loss, level_heard_db, level, exponent, sigma)
            heard, count = regression_sums(loss, level_heard_db, own), own.sum(axis=1)
        expected = level[:, None] + exponent[:, None] * missed_loss
        u = (limit_db - expected) / sigma[:, None]
        below, ratio = normal_tail(u)
        weak = (1.0 - chance[:, None]) * below
        share = miss_weight * weak / (weak + chance[:, None])
        filled = expected - sigma[:, None] * ratio
        variance = sigma[:, None] ** 2 * np.maximum(1.0 - ratio * (u + ratio), 0.0)
        weighed = share.sum(axis=1)
        level, exponent, determinant = _regressed(
            heard, count, missed_loss, filled, share, sigma, propagation
        )
        of_missed = filled - level[:, None] - exponent[:, None] * missed_loss
        squares = energy(level, exponent) + np.sum(share * (of_missed**2 + variance), axis=1)
        sigma = np.sqrt((squares + LEVELS.fading_db**2) / (count + weighed + 1.0))
        by_chance = miss_weight.sum() - weighed
        chance = (by_chance + LEVELS.outlier_share * POWER.missed_pulses) / everything
    expected = level[:, None] + exponent[:, None] * missed_loss
    below, ratio = normal_tail((limit_db - expected) / sigma[:, None])
    weak = (1.0 - chance[:, None]) * below
    misses = np.log(chance[:, None] + weak) @ miss_weight
    if foreign:
        log_heard = _own_share(loss, level_heard_db, level, exponent, sigma)[1]
    else:
        log_heard = -count * np.log(sigma) - 0.5 * energy(level, exponent) / sigma**2
    score = log_heard + misses + loss.shape[1] * np.log1p(-chance)
    # Correlated fading makes neighbours count as one.
    score *= (1.0 - correlation) / (1.0 + correlation)
    prior_pulses = LEVELS.outlier_share * POWER.missed_pulses
    score += prior_pulses * np.log(chance)
    score += (POWER.missed_pulses - prior_pulses) * np.log1p(-chance)
    score -= 0.5 * ((exponent - propagation.exponent) / propagation.exponent_sigma) ** 2
    # The fading's own width and prior cancel those of level and exponent (Laplace).
    score -= 0.5 * np.log(determinant) + 0.5 * (LEVELS.fading_db / sigma) ** 2
    return PowerFit(
        log_likelihood=score,
        level_db=level,
        exponent=exponent,
        missed_db=-sigma[:, None] * ratio * weak / (chance[:, None] + weak),
    )


def _own_share(
    loss: NDArray[np.floating],
    level_heard_db: NDArray[np.floating],
    level: _Floats,
    exponent: _Floats,
    sigma: _Floats,
) -> tuple[NDArray[np.floating], _Floats]:
    """Return the probability that each pulse is the tag's (places, received), and the
    log-likelihood (places,).
    """
    level, exponent, sigma = (
        one.astype(loss.dtype)[:, None] for one in (level, exponent, sigma)
    )
    off = (level_heard_db - level - exponent * loss) / sigma
    own = np.exp(-0.5 * off * off) * (1.0 - LEVELS.outlier_share) / sigma
    mixed = own + (2.0 * np.pi) ** 0.5 * LEVELS.outlier_share / LEVELS.any_strength_db
    return own / mixed, np.log(mixed).sum(axis=1, dtype=np.float64)


def _regressed(
    heard: _Floats,
    count: int | _Floats,
    missed_loss: _Floats,
    filled: _Floats,
    share: _Floats,
    sigma: _Floats,
    propagation: Propagation,
) -> tuple[_Floats, _Floats, _Floats]:
    prior = (sigma / propagation.exponent_sigma) ** 2
    weighted = share * missed_loss
    ones = count + share.sum(axis=1)
    x = heard[0] + weighted.sum(axis=1)
    z = heard[1] + dot(share, filled)
    xx = heard[2] + dot(weighted, missed_loss) + prior
    xz = heard[3] + dot(weighted, filled) + prior * propagation.exponent
    determinant = np.maximum(ones * xx - x * x, 1e-9)
    exponent = (ones * xz - x * z) / determinant
    return (z - exponent * x) / ones, exponent, determinant


def correlation_over_hills(residual: _Floats, error_db: float, alike: float) -> float:
    """Estimate the correlation of neighbouring pulses from the scatter of means over stretches
    of the track.

    Errors of the ground model persist over many pulses. The fit absorbs some of them, so the
    model's expected error `error_db`, constant over `alike` pulses, is added to that of the
    residuals (n,).
    """
    energy = max(float(np.var(residual)), 1e-9)
    inflation = 1.0
    for size in POWER.stretches:
        count = len(residual) // size
        if count < POWER.least_stretches:
            break
        means = residual[: count * size].reshape(count, size).mean(axis=1)
        inflation = max(inflation, size * float(np.var(means, ddof=1)) / energy)
    inflation += alike * error_db**2 / energy
    return float(np.clip((inflation - 1.0) / (inflation + 1.0), 0.0, POWER.most_lasting))


def lasting_correlation(residual: _Floats) -> float:
    """Correlation of neighbouring residuals (n,), 0 to 0.95, less the part that is due to
    chance.

    The variance of a correlation by chance, 1/n, is subtracted from its square. Strong
    correlations hardly change; weak ones become 0.
    """
    energy = max(float(residual @ residual), 1e-9)
    lag = float(residual[1:] @ residual[:-1]) / energy
    lag = max(lag + (1.0 + 3.0 * lag) / len(residual), 1e-9)
    return float(np.clip(lag - 1.0 / (len(residual) * lag), 0.0, 0.95))
