"""Likelihood of a place from the strengths of several rotations, the tag's own unknown."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.position.over_hills import LOSS_ERROR, OverHills

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Propagation:
    """Prior knowledge of the path loss."""

    exponent: float = 2.5
    """Mean of the path loss exponent: 2 in free space, 4 for a tag on the ground beyond the
    break point."""
    exponent_sigma: float = 0.7
    shadowing_db: float = 3.0
    """Standard deviation of the effect of ground and plants at a place, the same for a
    rotation."""


class LevelEvidence:
    """Log-likelihood of places, given boresight levels at stations.

    Level i is P - 10 n log10(r_i / 100 m) plus a normal error; P has a flat prior for each
    receiver, and n a normal one. All integrate out in closed form.

    `east_m`, `north_m`, `height_m` (n,): stations in the local plane, and above the tag.
    `level_db`, `sigma_db` (n,): levels and the errors of their estimates.
    `receiver` (n,): number of the receiver: their gains are unrelated.
    `over_hills`: losses behind hills; None is level.
    """

    def __init__(
        self,
        east_m: _Floats,
        north_m: _Floats,
        height_m: _Floats,
        level_db: _Floats,
        sigma_db: _Floats,
        propagation: Propagation,
        receiver: NDArray[np.int64],
        over_hills: OverHills | None = None,
    ) -> None:
        self._of = (receiver[:, None] == np.unique(receiver)).astype(np.float64)
        self._over_hills = over_hills
        self._east_m, self._north_m, self._height_m = east_m, north_m, height_m
        self._level_db = level_db
        self._variance_db2 = sigma_db**2 + propagation.shadowing_db**2
        self._propagation = propagation

    def log_likelihood(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """(places,) up to a constant."""
        dx = east_m[:, None] - self._east_m
        dy = north_m[:, None] - self._north_m
        height, over = self._height_m[np.newaxis], self._over_hills
        level = self._level_db[np.newaxis]
        variance = self._variance_db2[np.newaxis]
        if over is not None:
            lost = over.lost_db(east_m, north_m).astype(np.float64)
            height = height - over.hills.rise_m(east_m, north_m)[:, np.newaxis]
            level, variance = level + lost, variance + (LOSS_ERROR * lost) ** 2
        slant = dx * dx + dy * dy + np.maximum(np.abs(height), 1.0) ** 2
        x = -5.0 * np.log10(slant / 100.0**2)
        known = self._propagation
        residual = level - known.exponent * x
        weight = 1.0 / variance
        total = weight @ self._of
        x = x - ((x * weight) @ self._of / total) @ self._of.T
        residual = residual - ((residual * weight) @ self._of / total) @ self._of.T
        # What is left of n: deviation d ~ N(0, exponent_sigma²), residual = d x + error.
        xx, xr = (x * x * weight).sum(axis=1), (x * residual * weight).sum(axis=1)
        prior = 1.0 / max(known.exponent_sigma, 1e-6) ** 2
        cost = (residual * residual * weight).sum(axis=1) - xr * xr / (xx + prior)
        score = -0.5 * cost - 0.5 * np.log((xx + prior) / prior)
        if over is not None:  # levels are less sure at some places than at others
            score += 0.5 * (np.log(weight).sum(axis=1) - np.log(total).sum(axis=1))
        return np.asarray(score)
