"""What is believed of a tag's strength, place by place, and how a pulse or a miss changes it.

Published trackers take the strength as known. Here every place (cell or particle) carries a
normal belief of it, given that the tag is there; a pulse updates it exactly, a miss by its
first two moments. So the strength is learnt while the tag is found.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from uavrt.localization.antenna import AntennaPattern, monopole_gain_db

_LOG_ROOT_TWO_PI = 0.918_938_533
_BY_CHANCE = 0.02
"""Share of pulses that are missed, or are heard at any strength, for no reason of geometry."""
_ANY_STRENGTH = 1.0 / 120.0
"""Density of those [1/dB]."""
REFERENCE_M = 100.0

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Listening:
    """One pulse that was heard, or listened for in vain."""

    east_m: float
    """Place of the drone in the tracker's plane."""
    north_m: float
    height_m: float
    """Above the tag."""
    snr_db: float | None
    """None is a miss: it tells where the tag is not."""
    threshold_db: float = 10.0
    """SNR from which it would have been heard."""
    yaw_deg: float | None = None
    """Boresight; None is an upright monopole."""


@dataclass(slots=True, kw_only=True, eq=False)
class LevelBelief:
    """Mean and variance of the SNR that the tag has at 100 m, for each place."""

    mean_db: _Floats
    variance_db2: _Floats

    def expected_db(
        self,
        heard: Listening,
        east_m: _Floats,
        north_m: _Floats,
        exponent: _Floats,
        pattern: AntennaPattern | None,
    ) -> _Floats:
        """SNR that a tag of the mean strength at each place would have here."""
        dx, dy = east_m - heard.east_m, north_m - heard.north_m
        ground = np.hypot(dx, dy)
        slant = np.maximum(np.hypot(ground, heard.height_m), 1.0)
        if pattern is None or heard.yaw_deg is None:
            gain = monopole_gain_db(np.degrees(np.arctan2(heard.height_m, ground)))
        else:
            turn = np.arctan2(dx, dy) - np.radians(heard.yaw_deg)
            flat = ground / slant
            down = np.broadcast_to(heard.height_m / slant, flat.shape)
            gain = pattern.gain_towards_db(flat * np.cos(turn), flat * np.sin(turn), down)
        return self.mean_db - 10.0 * exponent * np.log10(slant / REFERENCE_M) + gain

    def update(self, heard: Listening, expected_db: _Floats, fading_db: float) -> _Floats:
        """Take one pulse or miss in; its log-likelihood at each place."""
        variance = self.variance_db2 + fading_db**2
        if heard.snr_db is not None:
            innovation = heard.snr_db - expected_db
            normal = -0.5 * innovation**2 / variance - 0.5 * np.log(variance) - _LOG_ROOT_TWO_PI
            mixed = np.logaddexp(
                normal + np.log1p(-_BY_CHANCE), np.log(_BY_CHANCE * _ANY_STRENGTH)
            )
            # What came by chance says nothing of the strength.
            sure = np.exp(normal + np.log1p(-_BY_CHANCE) - mixed)
            part = sure * self.variance_db2 / variance
            self.mean_db = self.mean_db + part * innovation
            self.variance_db2 = self.variance_db2 * (1.0 - part)
            return np.asarray(mixed)
        u = (heard.threshold_db - expected_db) / np.sqrt(variance)
        below = log_ndtr(u)
        mixed = np.logaddexp(below + np.log1p(-_BY_CHANCE), np.log(_BY_CHANCE))
        sure = np.exp(below + np.log1p(-_BY_CHANCE) - mixed)
        ratio = sure * np.exp(-0.5 * u * u - _LOG_ROOT_TWO_PI - below)
        part = self.variance_db2 / variance
        self.mean_db = self.mean_db - np.sqrt(variance) * part * ratio
        shrink = 1.0 - part * np.clip(ratio * (ratio + u), 0.0, 1.0)
        self.variance_db2 = self.variance_db2 * shrink
        return np.asarray(mixed)
