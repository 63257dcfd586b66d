"""Bearing estimators from the literature, for comparison and compatibility.

Known faults of a method are kept where a published result depends on them.
docs/explanation/localization.md compares the methods by measurements.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavrt.core.units import wrap_degrees_360
from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.bearing.tuning import SIMPLE

_SCAN_DEG = np.arange(0.0, 360.0, SIMPLE.scan_step_deg)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlainBearing:
    """Bearing estimated by a published method, with that method's own measure of confidence."""

    bearing_deg: float
    confidence: float | None


def strongest(yaw_deg: NDArray[np.float64], power: NDArray[np.float64]) -> PlainBearing:
    """Estimate the bearing as the heading of the strongest pulse."""
    top = float(yaw_deg[int(np.argmax(power))])
    return PlainBearing(bearing_deg=wrap_degrees_360(top), confidence=None)


def pca(
    yaw_deg: NDArray[np.float64],
    power: NDArray[np.float64],
    *,
    scale: Literal["linear", "log", "amplitude"] = "linear",
) -> PlainBearing:
    """Estimate the bearing as principal axis of the pulses as vectors (Shafer 2019, as in
    uavrt_bearing).

    Each pulse is a vector along its heading, whose length is its power divided by the weakest
    pulse's. The bearing is the first principal axis, on the side of the mean vector; the
    confidence is tau = 1 - S2²/S1². With fewer than four pulses, or if the headings span less
    than 270°, the result is the strongest pulse's heading without a confidence.
    """
    yaw = np.remainder(yaw_deg, 360.0)
    if len(yaw) < 4 or np.ptp(yaw) < 270.0:
        return strongest(yaw, power)
    length = power / power.min()
    if scale == "log":
        length = np.log10(length)
    elif scale == "amplitude":
        length = np.sqrt(length)
    points = length[:, None] * np.stack([np.cos(np.radians(yaw)), np.sin(np.radians(yaw))], 1)
    mean = points.mean(axis=0)
    _, singular, axes = np.linalg.svd(points - mean, full_matrices=False)
    axis = axes[0] if mean @ axes[0] >= 0.0 else -axes[0]
    bearing = wrap_degrees_360(float(np.degrees(np.arctan2(axis[1], axis[0]))))
    if singular[0] <= 0.0:
        return PlainBearing(bearing_deg=bearing, confidence=None)
    ratio = float(singular[1] / singular[0])
    return PlainBearing(bearing_deg=bearing, confidence=1.0 - ratio**2)


def pearson(
    yaw_deg: NDArray[np.float64], level_db: NDArray[np.float64], pattern: AntennaPattern
) -> PlainBearing:
    """Estimate the bearing with the best circular correlation of levels and pattern
    (ConservationBots).

    Levels are averaged in bins of one degree. Levels and pattern are both scaled to 0 … 1. If
    the plain dot product gives a direction more than 90° away, the result is rotated by
    180°.
    """
    which, place = np.unique(
        np.remainder(np.round(yaw_deg), 360.0).astype(int), return_inverse=True
    )
    mean = np.bincount(place, level_db) / np.bincount(place)
    if len(which) < 3 or np.ptp(mean) <= 0.0:
        top = strongest(which.astype(np.float64), mean)
        return PlainBearing(bearing_deg=top.bearing_deg, confidence=None)
    level = (mean - mean.min()) / np.ptp(mean)
    gain = pattern.gain_db(np.arange(360.0))
    gain = (gain - gain.min()) / np.ptp(gain)
    candidates = np.arange(360)
    expected = gain[np.remainder(which[None, :] - candidates[:, None], 360)]
    centred = expected - expected.mean(axis=1, keepdims=True)
    wanted = level - level.mean()
    scale = np.linalg.norm(centred, axis=1) * np.linalg.norm(wanted)
    correlation = np.divide(centred @ wanted, scale, out=np.zeros(360), where=scale > 1e-12)
    bearing = float(np.argmax(correlation))
    plain = float(np.argmax(expected @ level))
    confidence = float(correlation.max())
    if abs(difference_deg(bearing, plain)) > 90.0:
        bearing = wrap_degrees_360(bearing + 180.0)
    return PlainBearing(bearing_deg=bearing, confidence=confidence)


def ls_db(
    yaw_deg: NDArray[np.float64], level_db: NDArray[np.float64], pattern: AntennaPattern
) -> PlainBearing:
    """Estimate the bearing by a least-squares fit of the pattern to levels in dB, the most
    accurate published method at high SNR.
    """
    gain = pattern.gain_db(_SCAN_DEG[:, None] - yaw_deg[None, :])
    difference = level_db[None, :] - gain
    cost = np.sum((difference - difference.mean(axis=1, keepdims=True)) ** 2, axis=1)
    top = int(np.argmin(cost))
    left, middle, right = (cost[(top + shift) % len(cost)] for shift in (-1, 0, 1))
    bend = left - 2.0 * middle + right
    shift = 0.5 * (left - right) / bend if bend > 0.0 else 0.0
    total = float(np.sum((level_db - level_db.mean()) ** 2))
    return PlainBearing(
        bearing_deg=wrap_degrees_360(float(_SCAN_DEG[top] + 0.5 * shift)),
        confidence=1.0 - float(middle) / total if total > 0.0 else None,
    )


def ls_linear(
    yaw_deg: NDArray[np.float64],
    power: NDArray[np.float64],
    noise: NDArray[np.float64],
    missed_yaw_deg: NDArray[np.float64],
    pattern: AntennaPattern,
) -> PlainBearing:
    """Estimate the bearing by a least-squares fit of linear power, A g(θ - φ) + B (UAV-RT
    flight code of 2026).

    Bearings within 90° of the strongest pulse are tried. A missed pulse counts where the model
    exceeds half of the weakest received power. The middle of all nearly equal fits is
    returned.
    """
    scan = float(yaw_deg[int(np.argmax(power))]) + np.arange(-90.0, 90.25, 0.5)
    gain = 10.0 ** (pattern.gain_db(scan[:, None] - yaw_deg[None, :]) / 10.0)
    missed = 10.0 ** (pattern.gain_db(scan[:, None] - missed_yaw_deg[None, :]) / 10.0)
    weight = (np.median(noise) / noise) ** 2
    slope, floor = _fitted_line(gain, power, weight)
    cost = np.sum(weight * (slope * gain + floor - power) ** 2, axis=1)
    over = np.maximum(0.0, slope * missed + floor - 0.5 * power.min())
    cost = cost + np.sum(over**2, axis=1)
    energy = float(np.sum(power**2))
    good = scan[cost <= cost.min() + max(cost.min(), 0.005 * energy)]
    span = float(good[-1] - good[0])
    free = 2 + (len(power) >= 3)
    fill = np.clip((len(power) + len(missed_yaw_deg) - free + 1) / 5.0, 0.0, 1.0)
    confidence = (1.0 - cost.min() / energy) * (1.0 - span / 180.0) * fill
    return PlainBearing(
        bearing_deg=wrap_degrees_360(float(good[0] + span / 2.0)), confidence=float(confidence)
    )


def _fitted_line(
    gain: NDArray[np.float64], power: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    total = weight.sum()
    mean_gain = (gain @ weight / total)[:, None]
    mean_power = float(power @ weight / total)
    centred = gain - mean_gain
    spread = np.maximum((centred**2) @ weight, 1e-30)
    slope = (centred @ (weight * (power - mean_power)) / spread)[:, None]
    floor = mean_power - slope * mean_gain
    through_zero = (gain @ (weight * power) / np.maximum((gain**2) @ weight, 1e-30))[:, None]
    no_floor = (floor < 0.0) | (len(power) < 3)
    slope = np.where(no_floor, through_zero, np.maximum(slope, 0.0))
    floor = np.where(no_floor, 0.0, np.where(slope <= 0.0, mean_power, floor))
    return slope, floor
