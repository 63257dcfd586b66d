"""Estimate a tag's strength for each possible position, and update it with each received or
missed pulse.

Published trackers assume that the strength is known. Here every position (cell or particle) has
a normal distribution of the strength, given that the tag is there. A received pulse updates it
exactly, a missed pulse by its first two moments. So the search itself estimates the
strength.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from math import exp
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.core.runtime.lean_scipy import special
from uavrt.localization.antenna import NULL_DB, AntennaPattern
from uavrt.localization.position.levels.loss_error import LossError
from uavrt.localization.position.tuning import LEVEL, LOSS, POWER
from uavrt.localization.tuning import LEVELS

_Floats = NDArray[np.floating[Any]]
"""Array in single or double precision, according to the input."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Listening:
    """One expected pulse of a tag, received or missed, and the drone's position at that
    time.
    """

    east_m: float
    """East coordinate of the drone in the tracker's plane [m]."""
    north_m: float
    height_m: float
    """Height of the drone above the tag at the pulse [m]."""
    snr_db: float | None
    """SNR of the pulse [dB]; None if it was missed, which shows where the tag is not."""
    threshold_db: float = LEVELS.threshold_db
    """SNR above which the pulse would have been detected [dB]."""
    yaw_deg: float | None = None
    """Direction of the boresight, clockwise from true north [°]; None for an upright
    monopole."""


def false_pulse_density(heard: Listening) -> float:
    """Probability density of the level of pulses that do not come from the tag [1/dB].

    Half of them are noise just above the threshold, and half may have any strength. If all had
    any strength, each weak false pulse would be evidence of a weak tag.
    """
    assert heard.snr_db is not None
    over = max(float(heard.snr_db) - float(heard.threshold_db), 0.0)
    return 0.5 / LEVELS.any_strength_db + 0.5 / LEVEL.false_pulse_db * exp(
        -over / LEVEL.false_pulse_db
    )


@lru_cache(maxsize=64)
def _by_cosine(pattern: AntennaPattern) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Gains in and across the plane of the elements [dB], tabulated over the cosine of the
    angle off boresight (-1 to 1).
    """
    forward = np.linspace(-1.0, 1.0, LEVEL.pattern_steps + 1)
    aside = np.sqrt(1.0 - forward**2)
    none = np.zeros_like(forward)
    return (
        pattern.gain_towards_db(forward, aside, none).astype(np.float32),
        pattern.gain_towards_db(forward, none, aside).astype(np.float32),
    )


@lru_cache(maxsize=1)
def _tails() -> NDArray[np.float32]:
    """Table of the logarithm of the normal distribution function, symmetric about 0, shape
    (n,).
    """
    return special.log_ndtr(
        np.arange(-LEVEL.tail_sigmas, LEVEL.tail_sigmas + LEVEL.tail_step, LEVEL.tail_step)
    ).astype(np.float32)


def log_normal_tail(u: _Floats) -> _Floats:
    """Logarithm of the normal distribution function, read from a table and constant beyond its
    ends.
    """
    place = (np.clip(u, -LEVEL.tail_sigmas, LEVEL.tail_sigmas) + LEVEL.tail_sigmas) * (
        1.0 / LEVEL.tail_step
    ) + 0.5
    return np.asarray(_tails()[place.astype(np.int32)])


def antenna_gain_db(
    pattern: AntennaPattern | None,
    yaw_deg: _Floats | float | None,
    dx: _Floats,
    dy: _Floats,
    height_m: _Floats | float,
    slant_m: _Floats,
) -> _Floats:
    """Antenna gain of a level drone towards points at (dx, dy), `height_m` below the drone
    [dB].
    """
    if pattern is None or yaw_deg is None:
        # cos² of the elevation, not below that of the null
        flat = 1.0 - (height_m / slant_m) ** 2
        return np.asarray(10.0 * np.log10(np.maximum(flat, 10.0 ** (NULL_DB / 10.0))))
    yaw = np.radians(yaw_deg)
    if isinstance(yaw_deg, float | int):
        # As Python floats they do not change single precision to double.
        sine, cosine = float(np.sin(yaw)), float(np.cos(yaw))
        ahead, right = dx * sine + dy * cosine, dx * cosine - dy * sine
    else:
        ahead = dx * np.sin(yaw) + dy * np.cos(yaw)
        right = dx * np.cos(yaw) - dy * np.sin(yaw)
    forward = np.clip(ahead / slant_m, -1.0, 1.0)
    place = ((forward + 1.0) * (0.5 * LEVEL.pattern_steps) + 0.5).astype(np.int32)
    in_plane, across = _by_cosine(pattern)
    gain = in_plane[place]
    if pattern.h_plane_db is None:
        return np.asarray(gain)
    aside = right**2
    share = aside / np.maximum(aside + height_m * height_m, 1e-6)
    return np.asarray(share * gain + (1.0 - share) * across[place])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GroundEffect:
    """Effect of the ground between drone and tag on a pulse, for a tag at each position."""

    rise_m: _Floats | float = 0.0
    """Height of the ground at each tag position relative to the ground at the take-off [m]."""
    lost_db: _Floats | float = 0.0
    doubtful_db: _Floats | float = 0.0
    """Additional loss at each tag position for an error of one unit [dB]; see `LossError`."""

    def scatter_db(self, fading_db: float) -> _Floats | float:
        """Standard deviation of fading and of losses that vary from pulse to pulse [dB]."""
        return (fading_db**2 + (LOSS.pulse_share * self.lost_db) ** 2) ** 0.5


NO_EFFECT = GroundEffect()


@dataclass(slots=True, kw_only=True, eq=False)
class LevelBelief:
    """Mean and variance of the tag's SNR at 100 m, for each possible position."""

    mean_db: _Floats
    variance_db2: _Floats
    known: bool = False
    """True if the tag's strength is known and not estimated."""
    error: LossError | None = None
    """Error of losses (by hills or shadowing) common to many pulses; None if there is none."""

    def expected_db(
        self,
        heard: Listening,
        east_m: _Floats,
        north_m: _Floats,
        exponent: _Floats,
        pattern: AntennaPattern | None,
        ground: GroundEffect,
    ) -> _Floats:
        """Expected SNR at the drone if the tag is at each position [dB]."""
        # As Python floats they do not change single precision to double.
        dx, dy = east_m - float(heard.east_m), north_m - float(heard.north_m)
        height = float(heard.height_m) - ground.rise_m
        yaw = None if heard.yaw_deg is None else float(heard.yaw_deg)
        slant2 = np.maximum(dx * dx + dy * dy + height**2, 1.0)
        gain = antenna_gain_db(pattern, yaw, dx, dy, height, np.sqrt(slant2))
        loss = exponent * (5.0 * np.log10(slant2) - float(10.0 * np.log10(POWER.reference_m)))
        expected = self.mean_db - loss + gain - ground.lost_db
        if self.error is not None:
            expected = expected - self.error.mean * ground.doubtful_db
        return np.asarray(expected)

    def spread_db2(self, ground: GroundEffect) -> _Floats:
        """Variance of the expected SNR at the drone, without fading [dB²]."""
        error, doubtful = self.error, ground.doubtful_db
        if error is None:
            return self.variance_db2
        both = doubtful * (doubtful * error.variance - 2.0 * error.with_level_db)
        return np.asarray(np.maximum(self.variance_db2 + both, 0.0))

    def update(
        self,
        heard: Listening,
        expected_db: _Floats,
        fading_db: _Floats | float,
        *,
        missed_share: float = LEVELS.outlier_share,
        chance_share: float = LEVELS.outlier_share,
        elsewhere: float = 0.0,
        ground: GroundEffect = NO_EFFECT,
    ) -> _Floats:
        """Update with a received or a missed pulse; return the log-likelihood at each position.

        `fading_db` includes other unknown parts of the level. `elsewhere` is the density [1/dB]
        of a pulse of this level from another source.
        """
        learns = not self.known or self.error is not None
        variance: Any = fading_db**2
        if learns:
            variance = self.spread_db2(ground) + variance
        if heard.snr_db is not None:
            innovation = float(heard.snr_db) - expected_db
            scale = (1.0 - missed_share) / np.sqrt(2.0 * np.pi * variance)
            density = np.exp(-0.5 * innovation * innovation / variance) * scale
            others = chance_share * false_pulse_density(heard) + elsewhere
            mixed = density + max(others, LEVEL.least_share)
            if learns:
                # Chance pulses contain no information about the strength.
                part = density / mixed / variance
                self._learn(ground, part * innovation, part)
            return np.asarray(np.log(mixed))
        u = (float(heard.threshold_db) - expected_db) / np.sqrt(variance)
        log_below = log_normal_tail(u)
        below = np.exp(log_below) * (1.0 - missed_share)
        mixed = below + max(missed_share, LEVEL.least_share)
        if learns:
            hazard = np.exp(-0.5 * u * u - log_below) / float(np.sqrt(2.0 * np.pi))
            ratio = below / mixed * hazard
            part = np.clip(ratio * (ratio + u), 0.0, 1.0) / variance
            self._learn(ground, -ratio / np.sqrt(variance), part)
        return np.asarray(np.log(mixed))

    def _learn(self, ground: GroundEffect, moved: _Floats, shrunk: _Floats) -> None:
        """Update the strengths by the slope (`moved`) and curvature (`shrunk`) of a
        log-likelihood.
        """
        error, with_pulse = self.error, self.variance_db2
        if error is not None:
            with_pulse = with_pulse - ground.doubtful_db * error.with_level_db
            crossed = error.with_level_db - ground.doubtful_db * error.variance
            covariance = error.with_level_db - with_pulse * crossed * shrunk
            learnt = error.learnt(ground.doubtful_db, moved, shrunk)
            self.error = replace(learnt, with_level_db=covariance)
        self.mean_db = self.mean_db + with_pulse * moved
        self.variance_db2 = np.maximum(self.variance_db2 - with_pulse**2 * shrunk, 0.0)
