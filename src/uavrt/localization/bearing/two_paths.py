"""Test whether a direct wave and a reflection explain a turn's levels better than a single
wave.

A reflection by a wall or a slope adds to the direct wave with some strength and phase. It
changes a bearing by tens of degrees without other signs: there is one lobe and a good signal.
Only the shape of the lobe shows it. All shapes that two paths can cause are compared with the
measured levels at once, by circular correlation over whole degrees.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavrt.core.runtime.lean_scipy import fft
from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.bearing.tuning import LEARNED_PATTERN, TWO_PATHS

_PAIRS_DEG = [sign * turn for turn in TWO_PATHS.apart_deg for sign in (1, -1)][:-1]
"""Directions of the weaker propagation path, clockwise from the stronger one [deg]; 180° occurs
once."""
_WEAKER_SHARE = np.repeat(
    [1.0 / (1.0 + 10.0 ** (-db / 10.0)) for db in TWO_PATHS.weaker_db], len(TWO_PATHS.cosines)
)
"""Share of the weaker propagation path in the power of both, for each strength and phase."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TwoPaths:
    """A direct wave and its reflection, as fitted to the levels of a turn."""

    bearings_deg: tuple[float, float]
    """Bearings of the stronger and the weaker path [deg]; the tag may be in either
    direction."""
    density: NDArray[np.float64]
    """Probability of each whole degree of bearing, shape (360,); greater on the stronger
    path."""


def two_paths(
    yaw_deg: NDArray[np.float64],
    matched_power: NDArray[np.float64],
    noise_db: NDArray[np.float64],
    *,
    pattern: AntennaPattern,
    level_db: float,
    fading_db: float,
    folds: int,
) -> TwoPaths | None:
    """Fit two propagation paths to a turn; None if one path explains the levels, or for few
    pulses.

    `yaw_deg`, `matched_power` and `noise_db` (n,) are heading, power over noise (noise
    included) and noise over its median, for the received pulses. `pattern` is used in the plane
    of its elements. `level_db` and `fading_db` are boresight SNR and fading of the fit with one
    path; they only determine weights and noise floor.
    """
    if len(yaw_deg) < TWO_PATHS.least_pulses:
        return None
    # The level is unchanged: a fit with two paths has the same strongest pulses.
    shapes = 10.0 * np.log10(1.0 + 10.0 ** (level_db / 10.0) * _powers(pattern))
    floor = np.maximum(matched_power, 0.1)
    s = np.maximum(matched_power - 1.0, 0.0)
    weight = 1.0 / (fading_db**2 + 18.86 * (1.0 + 2.0 * s) / (folds * (1.0 + s) ** 2))
    heading = np.remainder(np.round(yaw_deg), 360.0).astype(np.intp)
    # Only the noise floor moves with the noise; the level does so too, to first order.
    level = 10.0 * np.log10(floor) + noise_db
    binned = _binned(heading, weight)
    binned_level = _binned(heading, weight * level)
    total, sum_level = weight.sum(), float(weight @ level)
    # Entry b of each correlation is the sum over headings of f(heading) g(b - heading).
    weights, levels, harmonics = (fft.rfft(one) for one in (binned, binned_level, shapes))
    mean = fft.irfft(harmonics * weights, 360)
    cost = fft.irfft(fft.rfft(shapes**2) * weights - 2.0 * harmonics * levels, 360)
    cost += float(weight @ level**2) - (sum_level - mean) ** 2 / total
    # The table's own error explains as much without a second path.
    cost = np.maximum(cost, 0.0) + total * LEARNED_PATTERN.prior_db**2
    pulses = len(yaw_deg)
    one, many = cost[0].min(), cost[1:]
    if 0.5 * pulses * np.log(one / many.min()) <= TWO_PATHS.least_gain_nats:
        return None
    place = np.unravel_index(int(np.argmin(many)), many.shape)
    apart = _PAIRS_DEG[int(place[0]) // len(_WEAKER_SHARE)]
    score = np.exp(-0.5 * pulses * np.log(many / many.min()))
    # The probability of a path being the direct one is its share of the power.
    weaker = _WEAKER_SHARE @ score.reshape(len(_PAIRS_DEG), len(_WEAKER_SHARE), 360)
    density = score.sum(axis=0) - weaker.sum(axis=0)
    for turn, share in zip(_PAIRS_DEG, weaker, strict=True):
        density += np.roll(share, turn)
    return TwoPaths(
        bearings_deg=(float(place[1]), float(np.remainder(place[1] + apart, 360))),
        density=density / density.sum(),
    )


@lru_cache(maxsize=8)
def _powers(pattern: AntennaPattern) -> NDArray[np.float64]:
    """Model powers (shapes, 360) by bearing of the stronger path minus heading, scaled to a
    peak of 1.

    The first shape has one path. Then follow shapes with two paths, in the order of the weaker
    path's direction as in `_PAIRS_DEG`, of its strength, and of its phase.
    """
    amplitude = 10.0 ** (pattern.gain_db(np.arange(360.0)) / 20.0)
    second = np.stack([np.roll(amplitude, -turn) for turn in _PAIRS_DEG])[:, None, None, :]
    ratio = (10.0 ** (np.array(TWO_PATHS.weaker_db) / 20.0))[None, :, None, None]
    cosine = np.array(TWO_PATHS.cosines)[None, None, :, None]
    power = amplitude**2 + (ratio * second) ** 2 + 2.0 * ratio * cosine * amplitude * second
    every = np.concatenate([amplitude[None, :] ** 2, power.reshape(-1, 360)])
    return np.asarray(every / every.max(axis=1, keepdims=True))


def _binned(heading: NDArray[np.intp], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.bincount(heading, weight, 360), np.float64)
