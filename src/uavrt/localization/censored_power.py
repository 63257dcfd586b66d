"""The same regression when pulses were missed because they were weak.

A fit to the heard pulses alone takes the lucky ones for the rule: at the rim of hearing the
loss looks flat. Each miss is therefore filled in by what it must have been on average, given
that it stayed below the threshold, and the fit repeated (expectation maximisation of Tobin's
model).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from uavrt.localization.level_evidence import Propagation

MISSED_BY_CHANCE = 0.02
"""Share of pulses missed for other reasons than being weak."""
_ROUNDS = 5
_MOST_MISSES = 60
"""More misses than that are thinned out, and count more each."""
_TYPICAL_FADING_DB = 4.0
_LOG_ROOT_TWO_PI = 0.918_938_533

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CensoredFit:
    """Level, exponent and fading at each place, and how probable it all is there."""

    log_likelihood: _Floats
    level_db: _Floats
    exponent: _Floats


def thinned(missed: NDArray[np.intp]) -> tuple[NDArray[np.intp], float]:
    """Some of the misses, evenly along the track, and what each counts."""
    every = max(1, -(-len(missed) // _MOST_MISSES))
    kept = missed[every // 2 :: every]
    return kept, len(missed) / max(1, len(kept))


def censored_fit(
    heard_loss: _Floats,
    heard_db: _Floats,
    missed_loss: _Floats,
    limit_db: _Floats,
    miss_weight: float,
    propagation: Propagation,
    *,
    lasting: bool = True,
) -> CensoredFit:
    """Fit level, exponent and fading at each place.

    Parameters
    ----------
    heard_loss, heard_db : (places, h) float64 arrays
        -10 log10 of distance over 100 m, and level with the antenna's gain taken out.
    missed_loss, limit_db : (places, m) float64 arrays
        The same for misses, and the level that each stayed below.
    miss_weight : float
        How many misses each stands for.
    propagation : Propagation
        Prior of the exponent.
    lasting : bool
        Fading may last from pulse to pulse.
    """
    places, heard = heard_loss.shape
    exponent = np.full(places, propagation.exponent)
    level = np.mean(heard_db - exponent[:, None] * heard_loss, axis=1)
    sigma = np.full(places, _TYPICAL_FADING_DB)
    for _ in range(_ROUNDS):
        expected = level[:, None] + exponent[:, None] * missed_loss
        u = (limit_db - expected) / sigma[:, None]
        log_below = log_ndtr(u)
        ratio = np.exp(-0.5 * u * u - _LOG_ROOT_TWO_PI - log_below)
        share = miss_weight / (1.0 + MISSED_BY_CHANCE * np.exp(-np.maximum(log_below, -30.0)))
        filled = expected - sigma[:, None] * ratio
        variance = sigma[:, None] ** 2 * np.maximum(1.0 - ratio * (u + ratio), 0.0)
        level, exponent, determinant, weight = _regressed(
            heard_loss, heard_db, missed_loss, filled, share, sigma, propagation
        )
        of_heard = heard_db - level[:, None] - exponent[:, None] * heard_loss
        of_missed = filled - level[:, None] - exponent[:, None] * missed_loss
        energy = np.sum(of_heard**2, axis=1) + np.sum(share * (of_missed**2 + variance), axis=1)
        sigma = np.sqrt((energy + _TYPICAL_FADING_DB**2) / (weight + 1.0))
    u = (limit_db - level[:, None] - exponent[:, None] * missed_loss) / sigma[:, None]
    below = np.logaddexp(log_ndtr(u) + np.log1p(-MISSED_BY_CHANCE), np.log(MISSED_BY_CHANCE))
    rho = _correlation(of_heard) if lasting else np.zeros(places)
    score = (
        -heard * np.log(sigma)
        - 0.5 * np.sum(of_heard**2, axis=1) / sigma**2
        + miss_weight * below.sum(axis=1)
    )
    # Fading that lasts makes neighbours one fact; seen at the best place, it holds for all.
    score *= (1.0 - rho[int(np.argmax(score))]) / (1.0 + rho[int(np.argmax(score))])
    score -= 0.5 * ((exponent - propagation.exponent) / propagation.exponent_sigma) ** 2
    score -= 0.5 * np.log(determinant) - np.log(sigma**2)
    return CensoredFit(log_likelihood=score, level_db=level, exponent=exponent)


def _regressed(
    heard_loss: _Floats,
    heard_db: _Floats,
    missed_loss: _Floats,
    filled: _Floats,
    share: _Floats,
    sigma: _Floats,
    propagation: Propagation,
) -> tuple[_Floats, _Floats, _Floats, _Floats]:
    """Level, exponent, determinant and number of pulses counted, for each place."""
    prior = (sigma / propagation.exponent_sigma) ** 2
    weighted = share * missed_loss
    ones = heard_loss.shape[1] + share.sum(axis=1)
    x = heard_loss.sum(axis=1) + weighted.sum(axis=1)
    z = heard_db.sum(axis=1) + np.sum(share * filled, axis=1)
    xx = np.sum(heard_loss**2, axis=1) + np.sum(weighted * missed_loss, axis=1) + prior
    xz = np.sum(heard_loss * heard_db, axis=1) + np.sum(weighted * filled, axis=1)
    xz = xz + prior * propagation.exponent
    determinant = np.maximum(ones * xx - x * x, 1e-9)
    exponent = (ones * xz - x * z) / determinant
    return (z - exponent * x) / ones, exponent, determinant, ones


def _correlation(residual: _Floats) -> _Floats:
    """Correlation of neighbours, 0 to 0.95; chance's 1/√n taken off."""
    energy = np.maximum(np.sum(residual**2, axis=1), 1e-9)
    lag = np.sum(residual[:, 1:] * residual[:, :-1], axis=1) / energy
    return np.asarray(np.clip(lag - residual.shape[1] ** -0.5, 0.0, 0.95))
