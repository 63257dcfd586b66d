"""Compute the loss over hills on one or many profiles, by Recommendation ITU-R P.526-15.

The loss of a single edge is its equation 31. Bullington's edge (§4.5.1) represents a whole
profile, with 4/3 of the earth's radius. Level ground also weakens the signal of a low tag; this
is already part of the model of the reflected ray
(`uavrt.planning.detectability.ground_propagation.GroundReflection`). The terrain's loss is
therefore the difference between its profile and a level one, as in §4.5.2:

terrain loss = max(0, Bullington(profile) - Bullington(level ground))
"""

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.floating]
EARTH_M = 8_500_000.0
"""Effective earth radius for which rays are straight [m], 4/3 of the true radius (P.526-15)."""
_LEAST = -1e12


def knife_edge_db(nu: _Floats) -> _Floats:
    """Loss of one edge with parameter ν [dB], 6 dB at grazing incidence (P.526-15, equation
    31).
    """
    above = np.maximum(nu, -0.78) - 0.1
    loss = 6.9 + 20.0 * np.log10(np.sqrt(above * above + 1.0) + above)
    return np.asarray(np.where(nu > -0.78, loss, 0.0))


def bullington_db(nu: _Floats, distance_m: _Floats) -> _Floats:
    """Loss of a profile whose equivalent edge has parameter ν [dB] (P.526-15, equation 58)."""
    edge = knife_edge_db(nu)
    return np.asarray(edge - np.expm1(-edge / 6.0) * (10.0 + 2e-5 * distance_m))


def beyond_level_db(
    nu: _Floats, distance_m: _Floats, *, antenna_m: float, tag_m: float, wavelength_m: float
) -> _Floats:
    """Loss of a profile in addition to that of level ground [dB], by its edge's parameter ν.

    Over level ground ν is greatest where the ray to the mirrored antenna meets the ground: -2
    √(2 a b / (λ d)) for antennas at heights a and b and a distance d.
    """
    height = np.sqrt(2.0 * antenna_m * tag_m / wavelength_m)
    level = -2.0 * height / np.sqrt(np.maximum(distance_m, 1.0))
    loss = bullington_db(nu, distance_m) - bullington_db(level, distance_m)
    return np.asarray(np.maximum(loss, 0.0))


def edge_parameters(
    x: _Floats,
    ground: _Floats,
    far: _Floats,
    antenna: _Floats,
    tag: _Floats,
    wavelength_m: float,
) -> _Floats:
    """Parameter ν of the equivalent edge of each profile (P.526-15, equations 53 to 57); -10
    for an unobstructed path.

    `x` (paths, points): distances from the drone [m]; points at or beyond `far` are ignored.
    `ground`: heights minus the earth's bulge, x² / (2 · 8500 km). `far`, `antenna`, `tag`
    (paths,): distance to the tag, and heights of both antennas minus the bulge.
    """
    if not x.shape[1]:
        return np.full(far.shape, -10.0)
    far2, antenna2, tag2 = far[:, np.newaxis], antenna[:, np.newaxis], tag[:, np.newaxis]
    inside = x < far2 - 1e-3
    left = np.where(inside, far2 - x, 1.0)
    from_drone = np.where(inside, (ground - antenna2) / x, _LEAST).max(axis=1)
    from_tag = np.where(inside, (ground - tag2) / left, _LEAST).max(axis=1)
    straight = (tag - antenna) / far
    ray = antenna2 + straight[:, np.newaxis] * x
    seen = np.where(
        inside, (ground - ray) * np.sqrt(2.0 * far2 / (wavelength_m * x * left)), -10.0
    ).max(axis=1)
    hidden = hidden_parameter(from_drone, from_tag, far, antenna, tag, wavelength_m)
    return np.asarray(np.where(from_drone < straight, seen, hidden))


def hidden_parameter(
    from_drone: _Floats,
    from_tag: _Floats,
    far: _Floats,
    antenna: _Floats,
    tag: _Floats,
    wavelength_m: float,
) -> _Floats:
    """Parameter ν of the edge where the horizon rays with slopes `from_drone` and `from_tag`
    intersect.
    """
    both = np.maximum(from_drone + from_tag, 1e-9)
    at = np.clip((tag - antenna + from_tag * far) / both, 1e-3 * far, 0.999 * far)
    above = antenna + from_drone * at - (antenna * (far - at) + tag * at) / far
    return np.asarray(above * np.sqrt(2.0 * far / (wavelength_m * at * (far - at))))
