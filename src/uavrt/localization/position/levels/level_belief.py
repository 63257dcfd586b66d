"""Estimate the unknowns of a tag's level for each possible position, from its pulses and
misses.

Published trackers assume that the strength is known. Here every position (particle) has a
joint normal distribution of the tag's strength, the path loss exponent and the errors that
many pulses share, given that the tag is there: a level is linear in all of them. A received
pulse updates the distribution exactly, a missed pulse by its first two moments. So the search
itself estimates these unknowns.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import exp
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.core.runtime.lean_scipy import special
from uavrt.localization.antenna import NULL_DB, AntennaPattern
from uavrt.localization.position.levels.ground_reflection import ReflectionShapes
from uavrt.localization.position.tuning import LEVEL, POWER
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
    doubtful_db: _Floats | float | None = None
    """Additional loss per unit of the lasting error, at each tag position [dB]; None: there is
    no lasting error."""
    reflection: ReflectionShapes | None = None
    """Unknown reflection by level ground; None: there is none."""

    def slopes(
        self, slant2_m2: _Floats, height_m: _Floats | float
    ) -> tuple[_Floats | float, list[_Floats | float]]:
        """Known part of a level [dB], and its change with each unknown but the strength."""
        decades = float(10.0 * np.log10(POWER.reference_m)) - 5.0 * np.log10(slant2_m2)
        known: _Floats | float = -self.lost_db
        slopes: list[_Floats | float] = [decades]
        if self.doubtful_db is not None:
            slopes.append(-self.doubtful_db)
        if self.reflection is not None:
            mean, *shapes = self.reflection.at(abs(height_m) / np.sqrt(slant2_m2))
            known = known + mean
            slopes.extend(shapes)
        return known, slopes


LEVEL_AT_100_M, EXPONENT, LASTING = range(3)
"""Rows of the unknowns of a level: SNR at 100 m [dB], path loss exponent, lasting error of
losses. The components of a reflection follow; without a lasting error they begin earlier."""


@lru_cache(maxsize=8)
def packed_rows(unknowns: int) -> tuple[tuple[int, ...], ...]:
    """Row of a packed covariance for each pair of unknowns."""
    rows = np.zeros((unknowns, unknowns), int)
    upper = np.triu_indices(unknowns)
    rows[upper] = np.arange(len(upper[0]))
    return tuple(tuple(row) for row in np.maximum(rows, rows.T).tolist())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExpectedLevel:
    """Expected SNR of one pulse for each possible position."""

    level_db: _Floats
    variance_db2: _Floats
    """Variance of the expected SNR, without fading [dB²]."""
    shared: list[_Floats]
    """Covariance of each unknown with the SNR."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LevelBelief:
    """Joint normal distribution of a level's unknowns for each position; updated in place."""

    mean: _Floats
    """(unknowns, positions)."""
    covariance: _Floats
    """(pairs, positions) covariances in the order of `packed_rows`."""

    @classmethod
    def before_pulses(
        cls, means: list[float], sigmas: list[float], positions: int
    ) -> "LevelBelief":
        """Independent unknowns, equal for all positions."""
        own = np.diag(np.array(sigmas, np.float32) ** 2)[np.triu_indices(len(sigmas))]
        return cls(
            mean=np.repeat(np.array(means, np.float32)[:, None], positions, axis=1),
            covariance=np.repeat(own[:, None], positions, axis=1),
        )

    def variance(self, row: int) -> _Floats:
        """Variance of one unknown."""
        own = self.covariance[packed_rows(len(self.mean))[row][row]]
        return np.asarray(np.maximum(own, 0.0))

    def expected(
        self,
        heard: Listening,
        east_m: _Floats,
        north_m: _Floats,
        pattern: AntennaPattern | None,
        ground: GroundEffect,
    ) -> ExpectedLevel:
        """Expected SNR at the drone if the tag is at each position."""
        # As Python floats they do not change single precision to double.
        dx, dy = east_m - float(heard.east_m), north_m - float(heard.north_m)
        height = float(heard.height_m) - ground.rise_m
        yaw = None if heard.yaw_deg is None else float(heard.yaw_deg)
        slant2 = np.maximum(dx * dx + dy * dy + height**2, 1.0)
        known, slopes = ground.slopes(slant2, height)
        gain = antenna_gain_db(pattern, yaw, dx, dy, height, np.sqrt(slant2))
        level = self.mean[LEVEL_AT_100_M] + gain + known
        for slope, mean in zip(slopes, self.mean[1:], strict=True):
            level += slope * mean
        shared = []
        for first, *others in packed_rows(len(self.mean)):
            one = self.covariance[first].copy()
            for slope, row in zip(slopes, others, strict=True):
                one += slope * self.covariance[row]
            shared.append(one)
        variance = shared[LEVEL_AT_100_M].copy()
        for slope, one in zip(slopes, shared[1:], strict=True):
            variance += slope * one
        return ExpectedLevel(
            level_db=level, variance_db2=np.maximum(variance, 0.0), shared=shared
        )

    def update(
        self,
        heard: Listening,
        expected: ExpectedLevel,
        fading_db: float,
        *,
        missed_share: float = LEVELS.outlier_share,
        chance_share: float = LEVELS.outlier_share,
        elsewhere: float = 0.0,
        learns: bool = True,
    ) -> _Floats:
        """Update with a received or a missed pulse; return the log-likelihood at each
        position.

        `elsewhere` is the density [1/dB] of a pulse of this level from another source. If
        `learns` is False, only the likelihood is computed.
        """
        variance = expected.variance_db2 + fading_db**2
        if heard.snr_db is not None:
            innovation = float(heard.snr_db) - expected.level_db
            scale = (1.0 - missed_share) / np.sqrt(2.0 * np.pi * variance)
            density = np.exp(-0.5 * innovation * innovation / variance) * scale
            others = chance_share * false_pulse_density(heard) + elsewhere
            mixed = density + max(others, LEVEL.least_share)
            if learns:
                # Chance pulses contain no information about the strength.
                part = density / mixed / variance
                self.learn(expected.shared, part * innovation, part)
            return np.asarray(np.log(mixed))
        u = (float(heard.threshold_db) - expected.level_db) / np.sqrt(variance)
        log_below = log_normal_tail(u)
        below = np.exp(log_below) * (1.0 - missed_share)
        mixed = below + max(missed_share, LEVEL.least_share)
        if learns:
            hazard = np.exp(-0.5 * u * u - log_below) / float(np.sqrt(2.0 * np.pi))
            ratio = below / mixed * hazard
            part = np.clip(ratio * (ratio + u), 0.0, 1.0) / variance
            self.learn(expected.shared, -ratio / np.sqrt(variance), part)
        return np.asarray(np.log(mixed))

    def learn(self, shared: list[_Floats], moved: _Floats, shrunk: _Floats) -> None:
        """Update by slope (`moved`) and curvature (`shrunk`) of a log-likelihood of a quantity.

        `shared`: covariance of each unknown with the quantity.
        """
        for row, (one, packed) in enumerate(zip(shared, packed_rows(len(shared)), strict=True)):
            self.mean[row] += one * moved
            part = one * shrunk
            for column in range(row + 1):
                self.covariance[packed[column]] -= part * shared[column]
            own = self.covariance[packed[row]]
            np.maximum(own, 0.0, out=own)

    def take(self, row: int, precision: float, weighted: float) -> _Floats:
        """Update one unknown by a normal likelihood: precision, and precision × mean.

        Returns its logarithm at each position. The precision may be negative: information that
        is withdrawn.
        """
        shared = [self.covariance[one].copy() for one in packed_rows(len(self.mean))[row]]
        mean, variance = self.mean[row].copy(), shared[row]
        grown = np.maximum(1.0 + precision * variance, LEVEL.least_growth)
        self.learn(shared, (weighted - precision * mean) / grown, precision / grown)
        square = (weighted - 0.5 * precision * mean) * mean + 0.5 * weighted**2 * variance
        return np.asarray(square / grown - 0.5 * np.log(grown))

    def relax(self, row: int, mean: float, sigma: float, kept: float) -> None:
        """Return an unknown to its prior, but for a share `kept` of its deviation from it."""
        self.mean[row] = mean + kept * (self.mean[row] - mean)
        packed = packed_rows(len(self.mean))[row]
        for one in packed:
            self.covariance[one] *= kept
        own = self.covariance[packed[row]]
        own *= kept
        own += sigma**2 * (1.0 - kept**2)

    def at(self, index: NDArray[np.intp]) -> "LevelBelief":
        """Distributions at selected positions."""
        return LevelBelief(mean=self.mean[:, index], covariance=self.covariance[:, index])

    def drawn(self, row: int, rng: Generator) -> "LevelBelief":
        """Distribution given one unknown, which is drawn at random for each position."""
        packed = np.array(packed_rows(len(self.mean)))
        covariance = self.covariance[packed]
        own = np.maximum(covariance[row, row], LEVEL.least_variance)
        per_sigma = covariance[row] / np.sqrt(own)
        drawn = rng.standard_normal(self.mean.shape[1], np.float32)
        left = covariance - per_sigma[:, None] * per_sigma
        return LevelBelief(
            mean=self.mean + per_sigma * drawn,
            covariance=left[np.triu_indices(len(self.mean))],
        )
