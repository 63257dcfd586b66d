"""Likelihood of a position from signal levels of turns and of receivers that never turned.

A mast, a person, or a drone that passes gives no bearing. Its levels still depend on the
antenna's gain towards the tag, and on the tag's strength, which is common to all receivers. A
receiver's gain, cable, noise and height above ground are unknown; together they are one error
common to all its levels.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.position.levels.level_belief import antenna_gain_db
from uavrt.localization.position.levels.over_hills import TrackHillLosses
from uavrt.localization.position.levels.strengths import Strengths
from uavrt.localization.position.tuning import LEVEL, POWER
from uavrt.localization.tuning import LEVELS

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Propagation:
    """Assumptions about the path loss that are made before the flight."""

    exponent: float = LEVELS.exponent
    exponent_sigma: float = LEVELS.exponent_sigma
    shadowing_db: float = LEVELS.shadowing_db


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Levels:
    """Signal levels in the local plane: first those of bearings, then those of receivers that
    never turned.
    """

    east_m: _Floats
    north_m: _Floats
    height_m: _Floats
    level_db: _Floats
    sigma_db: _Floats
    group: NDArray[np.int64]
    """Number of the receiver whose common error a level has, shape (n,); -1 if only one
    receiver turns.

    Receivers that never turned have the first numbers."""


class LevelEvidence:
    """Log-likelihood of positions, given two or more levels of bearings and other receivers.

    Level i is P - 10 n log10(r_i / 100 m) + the gain towards the tag + the receiver's error + a
    normal error. P has a flat prior and n a normal prior. The error of a receiver that never
    turned is normal, with one of two widths; the errors of several receivers that turn are
    unknown. All are integrated out in closed form. `listeners` are the receivers that never
    turned, in the order of their numbers.
    """

    def __init__(
        self,
        levels: Levels,
        listeners: tuple[Strengths, ...],
        propagation: Propagation,
        over_hills: TrackHillLosses | None = None,
    ) -> None:
        self._levels, self._listeners, self._known = levels, listeners, propagation
        self._over_hills = over_hills
        self._variance_db2 = levels.sigma_db**2 + propagation.shadowing_db**2
        groups = np.arange(levels.group.max() + 1)
        errors = levels.group[:, None] == groups
        # The unknown gains of receivers that turn contain P.
        several = len(groups) > 0 and not listeners
        self._errors = errors * 1.0 if several else np.insert(errors * 1.0, len(groups), 1.0, 1)
        """(n, errors) 1 where a level has a receiver's error; last column: tag power P."""
        self._own_gains = LEVEL.receiver_gains_db if listeners else ((1.0, 1.0),)

    def log_likelihood(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """Log-likelihood of positions given the levels, up to a constant, shape (places,)."""
        levels, over = self._levels, self._over_hills
        dx, dy = east_m[:, None] - levels.east_m, north_m[:, None] - levels.north_m
        height, variance = levels.height_m[np.newaxis], self._variance_db2[np.newaxis]
        lost: _Floats | float = 0.0
        if over is not None:
            lost = over.lost_db(east_m, north_m).astype(np.float64)
            height = height - over.hills.rise_m(east_m, north_m)[:, np.newaxis]
            variance = variance + (POWER.hill_error * lost) ** 2
        slant2 = dx * dx + dy * dy + np.maximum(np.abs(height), 1.0) ** 2
        x = -5.0 * np.log10(slant2 / 100.0**2)
        heard = levels.level_db + lost - self._gain_db(dx, dy, np.sqrt(slant2))
        residual = heard - self._known.exponent * x
        scores = [
            np.log(share) + self._score(x, residual, 1.0 / variance, gain_db)
            for share, gain_db in self._own_gains
        ]
        return np.asarray(np.logaddexp.reduce(scores))

    def _gain_db(self, dx: _Floats, dy: _Floats, slant_m: _Floats) -> _Floats:
        """Antenna gain towards positions [dB], shape (places, n); 0 for bearings, which are on
        boresight.
        """
        gain = np.zeros(dx.shape)
        for number, one in enumerate(self._listeners):
            rows = np.flatnonzero(self._levels.group == number)
            for row, yaw_deg in zip(rows, one.yaw_deg, strict=True):
                gain[:, row] = antenna_gain_db(
                    *(one.antenna, float(yaw_deg), dx[:, row], dy[:, row]),
                    *(max(abs(float(self._levels.height_m[row])), 1.0), slant_m[:, row]),
                )
        return gain

    def _score(self, x: _Floats, residual: _Floats, weight: _Floats, gain_db: float) -> _Floats:
        """Log-likelihood, integrated over strength P, receivers' errors and path loss, shape
        (places,).
        """
        errors, listeners = self._errors, len(self._listeners)
        normal = np.einsum("pn,nj,nk->pjk", weight, errors, errors)
        normal[:, range(listeners), range(listeners)] += gain_db**-2.0
        both = np.stack([x, residual])
        weighed = both * weight
        explained = weighed @ errors
        fitted = np.einsum("apj,pjk->apk", explained, np.linalg.inv(normal))
        (xx, xr), (_, rr) = np.einsum("apn,bpn->abp", weighed, both) - np.einsum(
            "apj,bpj->abp", fitted, explained
        )
        # Remaining part of n: deviation d ~ N(0, exponent_sigma²), residual = d x + error.
        prior = 1.0 / max(self._known.exponent_sigma, 1e-6) ** 2
        score = np.log(weight).sum(axis=1) - np.linalg.slogdet(normal)[1]
        score = score - 2.0 * listeners * np.log(gain_db) - np.log((xx + prior) / prior)
        return np.asarray(0.5 * (score - rr + xr * xr / (xx + prior)))
