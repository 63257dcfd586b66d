"""Compute how much information a turn loses if fading is correlated from pulse to pulse.

Fading by ground and plants persists over some degrees of a turn, so pulses are not independent.
The fit absorbs part of this correlation, so the residuals show too little of it. Several
assumed correlations are averaged by their restricted likelihood, which corrects for the fit
(Patterson and Thompson 1971). Each gives the variance of a bearing relative to independent
pulses.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.bearing.tuning import PATTERN

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Whitened:
    """Residuals of a turn's pulses after the best fit, each divided by its standard
    deviation.
    """

    residual: _Floats
    """Residuals of the pulses' powers in order of time [standard deviations], shape (n,)."""
    level_slope: _Floats
    """Change of each expected power with the tag's level [standard deviations per dB], shape
    (n,)."""
    bearing_slope: _Floats
    """Change of each expected power with the bearing [standard deviations per degree], shape
    (n,)."""
    fading_part: _Floats
    """Share of fading in each power's standard deviation, shape (n,); the rest is uncorrelated
    noise."""


def variance_factor(turn: Whitened) -> float:
    """Factor, at least 1, by which correlated fading increases a bearing's variance."""
    kept = slice(0, PATTERN.most_pulses)
    design = np.stack([turn.level_slope[kept], turn.bearing_slope[kept]], axis=1)
    residual, part = turn.residual[kept], turn.fading_part[kept]
    count = len(residual)
    normal = design.T @ design
    if count < PATTERN.least_pulses or np.linalg.cond(normal) > 1e10:
        return 1.0
    inverse = np.linalg.inv(normal)
    lags = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    decays = {rho: (rho ** np.arange(count))[lags] for rho in (0.0, *PATTERN.correlations)}
    scores, factors = [], []
    for rho, size in [
        (0.0, 1.0),
        *((rho, size) for rho in PATTERN.correlations for size in PATTERN.variance_factors),
    ]:
        law = size * np.outer(part, part) * decays[rho]
        np.fill_diagonal(law, 1.0 + (size - 1.0) * part**2)
        lower = np.linalg.cholesky(law)
        white = np.linalg.solve(lower, np.column_stack([design, residual]))
        slopes, left = white[:, :2], white[:, 2]
        information = slopes.T @ slopes
        left = left - slopes @ np.linalg.solve(information, slopes.T @ left)
        scores.append(
            -float(np.log(np.diag(lower)).sum())
            - 0.5 * float(np.linalg.slogdet(information)[1])
            - 0.5 * float(left @ left)
        )
        spread = inverse @ (design.T @ law @ design) @ inverse
        factors.append(float(spread[1, 1] / inverse[1, 1]))
    weight = np.exp(np.array(scores) - max(scores))
    weight[1:] *= PATTERN.correlated_share / (len(weight) - 1)
    weight[0] *= 1.0 - PATTERN.correlated_share
    return max(1.0, float(weight @ np.array(factors) / weight.sum()))
