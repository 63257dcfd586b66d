"""Quaternions and a local tangent plane for the simulation.

This module and `uavrt.localization.pose` are independent, so that each can be checked against
the other.
"""

import math
from dataclasses import dataclass

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]

_WGS84_SEMI_MAJOR_M = 6_378_137.0
_WGS84_ECCENTRICITY_SQUARED = 6.694_379_990_141e-3


def multiply(first: Quaternion, second: Quaternion) -> Quaternion:
    """Compose two rotations: first `second` is applied, then the other."""
    a, b, c, d = first
    e, f, g, h = second
    return (
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )


def from_euler_deg(roll_deg: float, pitch_deg: float, yaw_deg: float) -> Quaternion:
    """Quaternion of the rotation by yaw, then pitch, then roll [°], from body to parent."""
    roll, pitch, yaw = (math.radians(angle) / 2 for angle in (roll_deg, pitch_deg, yaw_deg))
    about_x = (math.cos(roll), math.sin(roll), 0.0, 0.0)
    about_y = (math.cos(pitch), 0.0, math.sin(pitch), 0.0)
    about_z = (math.cos(yaw), 0.0, 0.0, math.sin(yaw))
    return multiply(about_z, multiply(about_y, about_x))


def rotate(rotation: Quaternion, vector: Vector) -> Vector:
    """Transform a vector from the body frame to the parent frame."""
    w, x, y, z = rotation
    turned = multiply(multiply(rotation, (0.0, *vector)), (w, -x, -y, -z))
    return turned[1:]


def unrotate(rotation: Quaternion, vector: Vector) -> Vector:
    """Transform a vector from the parent frame to the body frame."""
    w, x, y, z = rotation
    return rotate((w, -x, -y, -z), vector)


def dot(first: Vector, second: Vector) -> float:
    """Scalar product of two vectors."""
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


def subtract(first: Vector, second: Vector) -> Vector:
    """Vector from `second` to `first`."""
    return (first[0] - second[0], first[1] - second[1], first[2] - second[2])


def add(first: Vector, second: Vector) -> Vector:
    """Sum of two vectors."""
    return (first[0] + second[0], first[1] + second[1], first[2] + second[2])


def scale(vector: Vector, factor: float) -> Vector:
    """Vector times a number."""
    return (vector[0] * factor, vector[1] * factor, vector[2] * factor)


def length(vector: Vector) -> float:
    """Euclidean length of a vector."""
    return math.sqrt(dot(vector, vector))


def cross(first: Vector, second: Vector) -> Vector:
    """Vector product of two vectors."""
    return (
        first[1] * second[2] - first[2] * second[1],
        first[2] * second[0] - first[0] * second[2],
        first[0] * second[1] - first[1] * second[0],
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TangentPlane:
    """North and east metres around a point; within some kilometres, 1 ppm from WGS84."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float

    def _metres_per_degree(self) -> tuple[float, float]:
        sine = math.sin(math.radians(self.latitude_deg))
        root = 1.0 - _WGS84_ECCENTRICITY_SQUARED * sine * sine
        meridian = _WGS84_SEMI_MAJOR_M * (1.0 - _WGS84_ECCENTRICITY_SQUARED) / root**1.5
        prime_vertical = _WGS84_SEMI_MAJOR_M / math.sqrt(root)
        north = math.radians(meridian + self.altitude_amsl_m)
        east = math.radians(prime_vertical + self.altitude_amsl_m)
        return north, east * math.cos(math.radians(self.latitude_deg))

    def to_geodetic(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Latitude and longitude [°] of a position; the longitude wraps at 180°."""
        north, east = self._metres_per_degree()
        longitude = self.longitude_deg + east_m / east
        return self.latitude_deg + north_m / north, (longitude + 180.0) % 360.0 - 180.0

    def to_local(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """Distances north and east of the origin [m] for a latitude and longitude."""
        north, east = self._metres_per_degree()
        difference = (longitude_deg - self.longitude_deg + 180.0) % 360.0 - 180.0
        return (latitude_deg - self.latitude_deg) * north, difference * east
