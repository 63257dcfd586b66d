"""Compute a bearing and its uncertainty from a log-density over the circle."""

import numpy as np
from numpy.typing import NDArray

from uavrt.core.units import wrap_degrees_360
from uavrt.localization.angles import difference_deg
from uavrt.localization.bearing.pattern_likelihood import GRID_DEG
from uavrt.localization.bearing.tuning import PATTERN
from uavrt.localization.results import ArrayMethod, Bearing


def described(log_density: NDArray[np.float64], *, method: ArrayMethod, pulses: int) -> Bearing:
    """Return the bearing with its uncertainty from log-likelihoods (1440,) and a uniform
    prior.
    """
    best_deg = peak_deg(log_density)
    density = np.exp(log_density - log_density.max())
    density /= density.sum()
    sigma, second = lobe_moments(density, best_deg)
    return Bearing(
        bearing_deg=wrap_degrees_360(best_deg),
        method=method,
        pulses=pulses,
        sigma_deg=sigma,
        interval90_deg=shortest_arc(density, 0.9),
        second_lobe_probability=second,
        posterior=whole_degrees(density),
    )


def lobe_moments(density: NDArray[np.float64], best_deg: float) -> tuple[float, float]:
    """Return the standard deviation within the lobe around a direction [deg], and the
    probability outside the lobe.
    """
    off = np.abs(difference_deg(GRID_DEG, best_deg))
    lobe = off <= PATTERN.lobe_deg
    variance = np.sum(density[lobe] * off[lobe] ** 2) / density[lobe].sum()
    return float(np.sqrt(variance + PATTERN.grid_step_deg**2 / 12.0)), float(
        density[~lobe].sum()
    )


def lobe_mean_deg(density: NDArray[np.float64], best_deg: float) -> float:
    """Mean direction within the lobe around a direction [deg], in [0, 360)."""
    off = difference_deg(GRID_DEG, best_deg)
    weight = np.where(np.abs(off) <= PATTERN.lobe_deg, density, 0.0)
    return float(wrap_degrees_360(best_deg + weight @ off / weight.sum()))


def peak_deg(log_density: NDArray[np.float64]) -> float:
    """Direction at which a density on the circle is greatest [deg], refined by a parabola."""
    top = int(np.argmax(log_density))
    left, middle, right = (log_density[(top + shift) % len(GRID_DEG)] for shift in (-1, 0, 1))
    curvature = 2.0 * middle - left - right
    shift = 0.5 * (right - left) / curvature if curvature > 1e-12 else 0.0
    return float(GRID_DEG[top] + PATTERN.grid_step_deg * np.clip(shift, -0.5, 0.5))


def shortest_arc(density: NDArray[np.float64], share: float) -> tuple[float, float]:
    """Shortest arc that contains the probability `share`: its ends [deg], in clockwise
    order.
    """
    count = len(density)
    edges = np.concatenate([[0.0], np.cumsum(np.tile(density, 2))])
    goal = edges[:count] + share
    after = np.clip(np.searchsorted(edges, goal), 1, 2 * count)
    inside = density[(after - 1) % count]
    part = np.divide(goal - edges[after - 1], inside, out=np.ones(count), where=inside > 0.0)
    width = after - 1 + np.clip(part, 0.0, 1.0) - np.arange(count)
    start = int(np.argmin(width))
    low = (start - 0.5) * PATTERN.grid_step_deg
    return float(wrap_degrees_360(low)), float(
        wrap_degrees_360(low + width[start] * PATTERN.grid_step_deg)
    )


def whole_degrees(density: NDArray[np.float64]) -> NDArray[np.float64]:
    """Reduce a probability in steps of 0.25° (1440,) to whole degrees (360,) by sums around
    them.
    """
    per_degree = round(1.0 / PATTERN.grid_step_deg)
    halves = per_degree // 2
    total = sum(
        (0.5 if abs(shift) == halves else 1.0) * np.roll(density, -shift)[::per_degree]
        for shift in range(-halves, halves + 1)
    )
    return np.asarray(total, np.float64)


def blurred(density: NDArray[np.float64], sigma_deg: float) -> NDArray[np.float64]:
    """Convolve a probability on the circle with a normal distribution of the given standard
    deviation.
    """
    if sigma_deg <= 0.0:
        return density
    harmonics = np.fft.rfftfreq(len(density), 1.0 / len(density))
    damping = np.exp(-0.5 * (harmonics * np.radians(sigma_deg)) ** 2)
    blurred = np.maximum(np.fft.irfft(np.fft.rfft(density) * damping, len(density)), 0.0)
    return np.asarray(blurred / blurred.sum())


def log_mean_exp(values: NDArray[np.float64]) -> float:
    """Logarithm of the mean of exponentials, without overflow."""
    top = float(values.max())
    return top + float(np.log(np.mean(np.exp(values - top))))
