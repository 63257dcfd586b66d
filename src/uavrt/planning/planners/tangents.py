"""Compute paths to a circle around an animal: to its edge, and past it on both sides."""

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]


def tangents(
    state_m: tuple[float, float], place_m: tuple[float, float], radius_m: float
) -> tuple[_Floats, _Floats]:
    """Ends of three paths: to a circle's nearest edge, and to its two tangent points."""
    dx, dy = place_m[0] - state_m[0], place_m[1] - state_m[1]
    distance = max(float(np.hypot(dx, dy)), 1e-6)
    course = np.arctan2(dx, dy)
    if distance <= radius_m:
        # Inside: straight away from the middle.
        out = radius_m - distance
        return (
            np.array([state_m[0] - out * np.sin(course)]),
            np.array([state_m[1] - out * np.cos(course)]),
        )
    off = np.arcsin(min(1.0, radius_m / distance))
    touching = np.sqrt(distance**2 - radius_m**2)
    angles = np.array([course, course - off, course + off])
    lengths = np.array([distance - radius_m, touching, touching])
    return state_m[0] + lengths * np.sin(angles), state_m[1] + lengths * np.cos(angles)
