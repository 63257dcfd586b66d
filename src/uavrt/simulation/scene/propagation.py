"""Propagation from a tag to the antenna: spreading, reflections, water, fading.

Every path is a straight ray from the tag or from one of its mirror images. The rays add as
complex amplitudes, each weighted by the antenna's gain and polarization in the ray's direction.
"""

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from uavrt.simulation.scene import geometry
from uavrt.simulation.scene.antenna import Antenna, pattern_db, polarization_db, transverse_axes
from uavrt.simulation.scene.counter_random import smooth_normal, stream_key
from uavrt.simulation.scene.record import ScenarioRecord

SPEED_OF_LIGHT_M_S = 299_792_458.0
_REFRACTIVE_INDEX_OF_WATER = 9.0  # √81, fresh water near 150 MHz
_IMPEDANCE_OF_FREE_SPACE_OHM = 376.73
_MINIMUM_DISTANCE_M = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Wall(ScenarioRecord):
    """A long flat vertical reflector: a building front, a cliff."""

    north_m: float
    """Position of a point on the wall: distance north of home [m]."""
    east_m: float
    facing_deg: float
    """Compass direction of the wall's normal [°]; only that side reflects."""
    reflection: Annotated[float, Ge(-1), Le(1)] = -0.5
    """Ratio of the amplitudes of the reflected and the arriving wave."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fading(ScenarioRecord):
    """Random change of a tag's level with time; it is equal for all rays of the tag."""

    kind: Literal["none", "lognormal", "rician"] = "none"
    sigma_db: Annotated[float, Ge(0), Le(20)] = 2.0
    """Standard deviation of lognormal fading [dB]."""
    k_factor_db: Annotated[float, Ge(-20), Le(40)] = 12.0
    """Ratio of steady to scattered power in Rician fading [dB]."""
    correlation_time_s: Annotated[float, Gt(0)] = 1.0
    """Time after which the correlation of the underlying normal process is 1/e [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Propagation(ScenarioRecord):
    """Settings of a scenario for the propagation of waves: spreading, reflections, fading."""

    model: Literal["log_distance", "two_ray"] = "log_distance"
    exponent: Annotated[float, Ge(1), Le(6)] = 2.0
    """Exponent with which power decreases with distance beyond 1 m; 2 in free space."""
    ground_permittivity: Annotated[float, Ge(1)] = 15.0
    ground_conductivity_s_m: Annotated[float, Ge(0)] = 5e-3
    doppler: bool = True
    """True to shift the frequency by the closing speed (5 Hz at 10 m/s)."""
    wall: tuple[Wall, ...] = ()
    fading: Fading = field(default_factory=Fading)


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """Properties of the path of one pulse from tag to antenna."""

    distance_m: float
    bearing_deg: float
    """Compass direction from the antenna to the tag, true [°]."""
    elevation_deg: float
    """Elevation of the tag from the antenna [°]; negative below."""
    off_boresight_deg: float
    gain_db: float
    """Received over radiated power [dB]: spreading, reflections, antenna and polarization."""


def ground_reflection(
    propagation: Propagation, grazing_rad: float, frequency_hz: float, *, horizontal: bool
) -> complex:
    """Fresnel reflection coefficient of the ground, for horizontal or vertical polarization.

    The permittivity is ε - j·18·10⁹·σ/f.
    """
    permittivity = complex(
        propagation.ground_permittivity,
        -18e9 * propagation.ground_conductivity_s_m / frequency_hz,
    )
    root = cmath.sqrt(permittivity - math.cos(grazing_rad) ** 2)
    sine = math.sin(grazing_rad) * (1.0 if horizontal else permittivity)
    return (sine - root) / (sine + root)


def water_loss_db(depth_m: float, conductivity_s_m: float) -> float:
    """Loss [dB] of a tag under fresh water, for a wave that travels straight up.

    Water absorbs 8.69·σ·Z₀/(2n) dB/m, which is 1.8 dB/m at 10 mS/m. The surface of the water
    costs 10 log10((n+1)²/4n) = 4.4 dB with n = 9.
    """
    if depth_m <= 0.0:
        return 0.0
    index = _REFRACTIVE_INDEX_OF_WATER
    absorption = (
        20 / math.log(10) * conductivity_s_m * _IMPEDANCE_OF_FREE_SPACE_OHM / (2 * index)
    )
    return absorption * depth_m - 10.0 * math.log10(4 * index / (index + 1) ** 2)


def fading_db(fading: Fading, seed: int, tag_id: int, elapsed_s: float) -> float:
    """Level change of a tag by fading at a time [dB]: a smooth random function."""
    if fading.kind == "none":
        return 0.0
    position = elapsed_s / fading.correlation_time_s
    first = smooth_normal(stream_key(seed, "fading", tag_id), position)
    if fading.kind == "lognormal":
        return fading.sigma_db * first
    second = smooth_normal(stream_key(seed, "fading quadrature", tag_id), position)
    k_factor = 10.0 ** (fading.k_factor_db / 10.0)
    field = math.sqrt(k_factor) + complex(first, second) / math.sqrt(2.0)
    return 10.0 * math.log10(abs(field) ** 2 / (k_factor + 1.0))


def _mirror_in_wall(
    wall: Wall, tag: geometry.Vector, antenna: geometry.Vector
) -> geometry.Vector | None:
    facing = math.radians(wall.facing_deg)
    normal = (math.cos(facing), math.sin(facing), 0.0)
    foot = (wall.north_m, wall.east_m, 0.0)
    tag_before = geometry.dot(geometry.subtract(tag, foot), normal)
    antenna_before = geometry.dot(geometry.subtract(antenna, foot), normal)
    if tag_before <= 0.0 or antenna_before <= 0.0:
        return None
    return geometry.subtract(tag, geometry.scale(normal, 2.0 * tag_before))


def _rays(
    propagation: Propagation,
    tag: geometry.Vector,
    antenna: geometry.Vector,
    frequency_hz: float,
    heights_m: tuple[float, float],
    *,
    horizontal: bool,
) -> Iterator[tuple[geometry.Vector, complex]]:
    """Position of the tag and of its mirror images, each with its reflection factor.

    The reflecting ground is a plane through the ground points beneath tag and antenna.
    """
    yield tag, 1.0
    if propagation.model == "two_ray":
        over_ground = math.hypot(tag[0] - antenna[0], tag[1] - antenna[1])
        grazing = math.atan2(sum(heights_m), max(over_ground, 1e-9))
        straight = math.hypot(over_ground, heights_m[0] - heights_m[1])
        longer = math.hypot(over_ground, sum(heights_m)) - straight
        # The image farther away by that path, straight beneath the tag.
        away = geometry.length(geometry.subtract(tag, antenna)) + longer
        image = (tag[0], tag[1], antenna[2] + math.sqrt(max(away**2 - over_ground**2, 0.0)))
        yield (
            image,
            ground_reflection(propagation, grazing, frequency_hz, horizontal=horizontal),
        )
    for wall in propagation.wall:
        mirrored = _mirror_in_wall(wall, tag, antenna)
        if mirrored is not None:
            yield mirrored, wall.reflection


def link(
    propagation: Propagation,
    antenna: Antenna,
    *,
    tag_ned_m: geometry.Vector,
    antenna_ned_m: geometry.Vector,
    antenna_quaternion_wxyz: geometry.Quaternion,
    polarization_deg: float,
    frequency_hz: float,
    heights_m: tuple[float, float] | None = None,
) -> Link:
    """Compute the link from a tag to the antenna, without fading.

    Positions are relative to home [m], both at least 0.1 m above level ground.
    `polarization_deg`: tilt of the tag's electric field from vertical; 90 is horizontal.
    `heights_m`: heights of antenna and tag above the ground, if the ground is not level.
    """
    tag, place = tag_ned_m, antenna_ned_m
    if heights_m is None:
        tag = (tag_ned_m[0], tag_ned_m[1], min(tag_ned_m[2], -0.1))
        place = (antenna_ned_m[0], antenna_ned_m[1], min(antenna_ned_m[2], -0.1))
        heights_m = (-place[2], -tag[2])
    wavelength = SPEED_OF_LIGHT_M_S / frequency_hz
    tilt = math.radians(polarization_deg)
    total = 0j
    for source, factor in _rays(
        propagation,
        tag,
        place,
        frequency_hz,
        heights_m,
        horizontal=abs(math.sin(tilt)) > math.sqrt(0.5),
    ):
        ray = geometry.subtract(source, place)
        distance = max(geometry.length(ray), _MINIMUM_DISTANCE_M)
        direction = geometry.scale(ray, 1.0 / max(geometry.length(ray), 1e-9))
        across, upright = transverse_axes(direction, (0.0, 0.0, 1.0))
        field = geometry.add(
            geometry.scale(upright, math.cos(tilt)), geometry.scale(across, math.sin(tilt))
        )
        body = geometry.unrotate(antenna_quaternion_wxyz, direction)
        level_db = pattern_db(antenna, body) + polarization_db(
            antenna, body, geometry.unrotate(antenna_quaternion_wxyz, field)
        )
        spread = wavelength / (4 * math.pi) * distance ** (-propagation.exponent / 2)
        # Phases relative to the direct ray; the common one is random for each pulse anyway.
        path_m = distance - geometry.length(geometry.subtract(tag, place))
        phase = cmath.exp(-2j * math.pi * path_m / wavelength)
        total += factor * spread * 10.0 ** (level_db / 20.0) * phase
    return _link(antenna, tag, place, antenna_quaternion_wxyz, abs(total) ** 2)


def _link(
    antenna: Antenna,
    tag: geometry.Vector,
    place: geometry.Vector,
    rotation: geometry.Quaternion,
    power: float,
) -> Link:
    ray = geometry.subtract(tag, place)
    distance = max(geometry.length(ray), _MINIMUM_DISTANCE_M)
    boresight = geometry.rotate(rotation, (1.0, 0.0, 0.0))
    cosine = geometry.dot(ray, boresight) / distance
    return Link(
        distance_m=distance,
        bearing_deg=math.degrees(math.atan2(ray[1], ray[0])) % 360.0,
        elevation_deg=-math.degrees(math.asin(max(-1.0, min(1.0, ray[2] / distance)))),
        off_boresight_deg=math.degrees(math.acos(max(-1.0, min(1.0, cosine)))),
        gain_db=antenna.gain_dbi + 10.0 * float(np.log10(max(power, 1e-30))),
    )
