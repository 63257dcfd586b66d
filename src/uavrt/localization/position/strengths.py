"""Likelihood of a place from receivers that never turned: one level for each place and heading.

A mast, a person, or a passing drone gives no bearing. Its pulses still contain the antenna's
gain towards the tag, and the tag's level, which all receivers share. The effect of a receiver's
own gain, cable, noise and height over the ground is unknown, and is one error of all its
levels.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.position.level_belief import antenna_gain_db
from uavrt.localization.position.level_evidence import Propagation

_Floats = NDArray[np.float64]

OWN_GAINS_DB = ((0.7, 6.0), (0.3, 20.0))
"""Common error of a receiver's levels: probability and standard deviation. Another radio or
cable makes some decibels. An antenna 6 m over the ground hears a far tag 20 dB weaker than one
at 60 m (two rays: 20 log of the heights' ratio), and one behind a hut weaker still."""

UNKNOWN_GAIN_DB = 100.0
"""Standard deviation of the unknown gain of each of several receivers that turn."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Strengths:
    """One receiver's levels of a tag, received without turning."""

    listener: str
    """Name of the receiver, for the operator: ``vehicle 7`` or a flight's name."""
    pulses: int
    """Number of pulses in the levels, used or not."""
    latitude_deg: _Floats
    """(n,) places of the receiver."""
    longitude_deg: _Floats
    height_m: _Floats
    yaw_deg: _Floats
    """(n,) headings of the boresight."""
    level_db: _Floats
    """(n,) received SNR, including the antenna's gain towards the tag."""
    sigma_db: _Floats
    antenna: AntennaPattern | None
    """None is an upright monopole."""
    unused: str | None = None
    """Why none of it can be used."""

    def because(self, reason: str) -> str:
        """Sentence that it is not used, and why."""
        return f"{self.listener}: its strengths ({self.pulses} pulses) are not used: {reason}"

    @property
    def outcome(self) -> str:
        """Sentence for the operator on its use."""
        if self.unused is not None:
            return self.because(self.unused)
        stood = "one place" if len(self.level_db) == 1 else f"{len(self.level_db)} places"
        return f"{self.listener}: the strengths of {self.pulses} pulses, at {stood}, went in"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Levels:
    """Levels in the local plane, row by row: of bearings first, then of receivers."""

    east_m: _Floats
    north_m: _Floats
    height_m: _Floats
    level_db: _Floats
    sigma_db: _Floats
    group: NDArray[np.int64]
    """(n,) number of the receiver, whose error all its levels share: those of listeners first,
    then those of several that turn; -1 where only one turns."""


class JoinedLevels:
    """Log-likelihood of places, given levels of bearings and of receivers that never turned.

    Level i is P - 10 n log10(r_i / 100 m) + the gain towards the tag + the receiver's error + a
    normal error. P has a flat prior and n a normal one, as in `LevelEvidence`. A listener's
    error is normal, of one of two widths; that of each of several receivers that turn is
    unknown. All integrate out in closed form.

    `levels`: two or more.
    `listeners`: the receivers, as their groups number them.
    """

    def __init__(
        self, levels: Levels, listeners: tuple[Strengths, ...], propagation: Propagation
    ) -> None:
        self._levels, self._listeners, self._known = levels, listeners, propagation
        own = np.diag(levels.sigma_db**2 + propagation.shadowing_db**2)
        same = (levels.group[:, None] == levels.group) & (levels.group[:, None] >= 0)
        turns = levels.group >= len(listeners)
        self._mixed = [
            (np.log(share), np.linalg.inv(covariance), float(np.linalg.slogdet(covariance)[1]))
            for share, gain_db in OWN_GAINS_DB
            for covariance in [own + same * np.where(turns, UNKNOWN_GAIN_DB, gain_db) ** 2]
        ]

    def log_likelihood(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """(places,) up to a constant."""
        levels = self._levels
        dx, dy = east_m[:, None] - levels.east_m, north_m[:, None] - levels.north_m
        slant2 = dx * dx + dy * dy + np.maximum(np.abs(levels.height_m), 1.0) ** 2
        heard = levels.level_db - self._gain_db(dx, dy, np.sqrt(slant2))
        x = -5.0 * np.log10(slant2 / 100.0**2)
        residual = heard - self._known.exponent * x
        return np.asarray(
            np.logaddexp.reduce(
                [
                    share + _score(x, residual, weight, log_det, self._known.exponent_sigma)
                    for share, weight, log_det in self._mixed
                ]
            )
        )

    def _gain_db(self, dx: _Floats, dy: _Floats, slant_m: _Floats) -> _Floats:
        """(places, n) gains towards the places; 0 for bearings, with levels at boresight."""
        gain = np.zeros(dx.shape)
        for number, one in enumerate(self._listeners):
            rows = np.flatnonzero(self._levels.group == number)
            for row, yaw_deg in zip(rows, one.yaw_deg, strict=True):
                gain[:, row] = antenna_gain_db(
                    *(one.antenna, float(yaw_deg), dx[:, row], dy[:, row]),
                    *(max(abs(float(self._levels.height_m[row])), 1.0), slant_m[:, row]),
                )
        return gain


def _score(
    x: _Floats, residual: _Floats, weight: _Floats, log_det: float, exponent_sigma: float
) -> _Floats:
    """(places,) log-likelihood, level and exponent integrated out."""
    ones = weight.sum(axis=1)
    total = float(ones.sum())
    x = x - (x @ ones / total)[:, None]
    residual = residual - (residual @ ones / total)[:, None]
    weighted = x @ weight
    xx, xr = (weighted * x).sum(axis=1), (weighted * residual).sum(axis=1)
    prior = 1.0 / max(exponent_sigma, 1e-6) ** 2
    cost = ((residual @ weight) * residual).sum(axis=1) - xr * xr / (xx + prior)
    score = -0.5 * (cost + log_det + np.log(total)) - 0.5 * np.log((xx + prior) / prior)
    return np.asarray(score)
