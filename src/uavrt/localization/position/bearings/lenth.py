"""Estimate positions from bearings after Lenth (1981, Technometrics 23:149), in the local
plane.

Each estimator exists as UAV-RT computes it, so that published positions can be reproduced, and
in a corrected form.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.runtime.lean_scipy import special
from uavrt.localization.position.tuning import BEARING_FIX

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanePosition:
    """Position in the local plane, with covariance and weights of the bearings."""

    east_m: float
    north_m: float
    covariance_m2: _Floats | None
    """Covariance of east and north [m²], shape (2, 2); None if the bearings' scatter is
    unknown."""
    weights: _Floats
    """Weight of each bearing in the robust estimate, at most 1, shape (n,)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rays:
    """Stations in the local plane with their bearings to the tag."""

    east_m: _Floats
    north_m: _Floats
    bearing_deg: _Floats

    @property
    def angle_rad(self) -> _Floats:
        """Direction of each bearing counter-clockwise from east [rad], as in Lenth's paper,
        shape (n,).
        """
        return np.asarray(np.radians(90.0 - self.bearing_deg))


def maximum_likelihood(rays: Rays) -> PlanePosition | None:
    """Return Lenth's maximum-likelihood estimate, with the smallest von Mises deviation of all
    bearings; None if it diverges.
    """
    point = _start(rays, np.ones(len(rays.east_m)))
    weights = np.ones(len(rays.east_m))
    for _ in range(BEARING_FIX.iterations):
        if point is None:
            return None
        step = _solved(rays, weights, *_starred(rays, point))
        if step is None or not np.hypot(*step) < BEARING_FIX.diverged_m:
            return None
        moved = float(np.hypot(*(step - point)))
        point = step
        if moved < BEARING_FIX.converged_m:
            return _placed(rays, point, weights)
    return None


def m_estimate(rays: Rays, *, as_original: bool) -> PlanePosition | None:
    """Return Lenth's M-estimate with Andrews' psi, c = 1.5; None if it diverges.

    With `as_original`, kappa is 1 / A(C), A = I1/I0, as in uavrt_localize. It is then near 2.2
    for any bearings, and none is ever rejected. Otherwise kappa is the inverse function A⁻¹(C),
    as in Lenth's paper.
    """
    weights = np.ones(len(rays.east_m))
    point = _start(rays, weights)
    for _ in range(BEARING_FIX.iterations):
        if point is None:
            return None
        deviation = _deviation(rays, point)
        total = weights.sum()
        cosine = float(weights @ np.cos(deviation)) / total if total > 0.0 else 0.0
        kappa = 1.0 / _bessel_ratio(cosine) if as_original else concentration(cosine)
        t = np.sqrt(2.0 * kappa * (1.0 - np.cos(deviation)))
        weights = _andrews(t)
        step = _solved(rays, weights, *_starred(rays, point))
        if step is None or not np.hypot(*step) < BEARING_FIX.diverged_m:
            return None
        moved = float(np.hypot(*(step - point)))
        if moved < BEARING_FIX.converged_m:
            # The original returns the iterate before the last, less than a millimetre away.
            return _placed(rays, point, weights)
        point = step
    return None


def repeated_median(rays: Rays, *, as_original: bool) -> PlanePosition | None:
    """Return the repeated median of the bearings' crossings; None if no bearings cross.

    With `as_original`, crossings behind the stations are also used.
    """
    c, s = np.cos(rays.angle_rad), np.sin(rays.angle_rad)
    dx = rays.east_m[None, :] - rays.east_m[:, None]
    dy = rays.north_m[None, :] - rays.north_m[:, None]
    cross = c[:, None] * s[None, :] - s[:, None] * c[None, :]
    parallel = np.abs(cross) < 1e-9
    safe = np.where(parallel, 1.0, cross)
    along = (dx * s[None, :] - dy * c[None, :]) / safe
    valid = ~parallel
    if not as_original:
        valid &= (along > 0.0) & (along.T > 0.0)
    x = np.where(valid, rays.east_m[:, None] + along * c[:, None], np.nan)
    y = np.where(valid, rays.north_m[:, None] + along * s[:, None], np.nan)
    crossing = valid.any(axis=1)
    if not crossing.any():
        return None
    east = float(np.median(np.nanmedian(x[crossing], axis=1)))
    north = float(np.median(np.nanmedian(y[crossing], axis=1)))
    # The scatter exceeds the MLE's by a factor that depends on the geometry; no covariance is
    # given.
    return PlanePosition(
        east_m=east, north_m=north, covariance_m2=None, weights=np.ones(len(rays.east_m))
    )


def concentration(cosine: float) -> float:
    """Concentration kappa of a von Mises density with a given mean cosine, by Lenth's
    formula.
    """
    c = min(max(cosine, 1e-3), 1.0 - 1e-12)
    inverse = 2.0 * (1.0 - c) + (1.0 - c) ** 2 * (0.48794 - 0.82905 * c - 1.3915 * c * c) / c
    return 1.0 / max(inverse, 1e-12)


def fisher_information(rays: Rays, point: _Floats, kappa: _Floats) -> _Floats:
    """Fisher information of bearings about a point: sum of kappa A(kappa) n nᵀ / r², shape (2,
    2).
    """
    dx, dy = point[0] - rays.east_m, point[1] - rays.north_m
    strength = (
        kappa * (special.i1e(kappa) / special.i0e(kappa)) / np.maximum(dx**2 + dy**2, 1e-6) ** 2
    )
    mixed = -float(strength @ (dx * dy))
    return np.array([[float(strength @ dy**2), mixed], [mixed, float(strength @ dx**2)]])


def _placed(rays: Rays, point: _Floats, weights: _Floats) -> PlanePosition:
    covariance = None
    if np.count_nonzero(weights > 0.0) > 2:
        cosine = float(weights @ np.cos(_deviation(rays, point)) / weights.sum())
        kappa = np.full(len(weights), concentration(cosine)) * weights
        information = fisher_information(rays, point, kappa)
        if np.linalg.cond(information) < 1e12:
            covariance = np.asarray(np.linalg.inv(information), np.float64)
    return PlanePosition(
        east_m=float(point[0]),
        north_m=float(point[1]),
        covariance_m2=covariance,
        weights=weights,
    )


def _bessel_ratio(kappa: float) -> float:
    return max(float(special.i1e(kappa) / special.i0e(kappa)), 1e-6)


def _andrews(t: _Floats) -> _Floats:
    """Weight psi(t) / t of Andrews' estimator: 1 at t = 0, and 0 beyond 1.5 π."""
    safe = np.maximum(t, 1e-9)
    weight = np.where(
        safe < BEARING_FIX.andrews * np.pi,
        BEARING_FIX.andrews * np.sin(safe / BEARING_FIX.andrews) / safe,
        0.0,
    )
    return np.asarray(weight)


def _deviation(rays: Rays, point: _Floats) -> _Floats:
    towards = np.arctan2(point[1] - rays.north_m, point[0] - rays.east_m)
    return np.asarray(rays.angle_rad - towards)


def _starred(rays: Rays, point: _Floats) -> tuple[_Floats, _Floats]:
    dx, dy = point[0] - rays.east_m, point[1] - rays.north_m
    cubed = np.maximum(np.hypot(dx, dy), 1e-3) ** 3
    return dy / cubed, dx / cubed


def _start(rays: Rays, weights: _Floats) -> _Floats | None:
    return _solved(rays, weights, np.sin(rays.angle_rad), np.cos(rays.angle_rad))


def _solved(rays: Rays, weights: _Floats, s_star: _Floats, c_star: _Floats) -> _Floats | None:
    s, c = np.sin(rays.angle_rad), np.cos(rays.angle_rad)
    z = s * rays.east_m - c * rays.north_m
    s_star, c_star = weights * s_star, weights * c_star
    matrix = np.array([[s @ s_star, -(c @ s_star)], [-(s @ c_star), c @ c_star]])
    # Parallel rays, or none that counts: relative to the matrix, its determinant vanishes.
    if abs(np.linalg.det(matrix)) <= 1e-12 * float(np.abs(matrix).max()) ** 2:
        return None
    return np.linalg.solve(matrix, np.array([s_star @ z, -(c_star @ z)]))
