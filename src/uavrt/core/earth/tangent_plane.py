"""Convert between latitude and longitude and metres east and north of a point (WGS 84)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavrt.core.earth.geodesy import (
    ECCENTRICITY2,
    SECOND_ECCENTRICITY2,
    SEMI_MAJOR_M,
    SEMI_MINOR_M,
)
from uavrt.core.units import wrap_degrees_180

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TangentPlane:
    """Plane that touches the ellipsoid at a point, with axes east and north in metres.

    A straight line of sight is straight in this plane. At a distance of 10 km the earth's
    surface is 8 m below the plane, which does not affect bearings.
    """

    latitude_deg: float
    longitude_deg: float

    def to_local(
        self, latitude_deg: ArrayLike, longitude_deg: ArrayLike
    ) -> tuple[_Floats, _Floats]:
        """Convert positions on the ground [°] to east and north [m]; arrays of any shape."""
        x, y, z = _geocentric(latitude_deg, longitude_deg)
        x0, y0, z0 = _geocentric(self.latitude_deg, self.longitude_deg)
        dx, dy, dz = x - x0, y - y0, z - z0
        sin_lat, cos_lat, sin_lon, cos_lon = self._axes()
        east = -sin_lon * dx + cos_lon * dy
        north = -sin_lat * cos_lon * dx - sin_lat * sin_lon * dy + cos_lat * dz
        return east, north

    def to_geodetic(self, east_m: ArrayLike, north_m: ArrayLike) -> tuple[_Floats, _Floats]:
        """Convert east and north [m] to latitude and longitude [°], within ±180°."""
        east, north = np.asarray(east_m, np.float64), np.asarray(north_m, np.float64)
        x0, y0, z0 = _geocentric(self.latitude_deg, self.longitude_deg)
        sin_lat, cos_lat, sin_lon, cos_lon = self._axes()
        x = x0 - sin_lon * east - sin_lat * cos_lon * north
        y = y0 + cos_lon * east - sin_lat * sin_lon * north
        z = z0 + cos_lat * north
        # Bowring 1976, one step: exact to nanometres near the ground.
        distance = np.hypot(x, y)
        beta = np.arctan2(z * SEMI_MAJOR_M, distance * SEMI_MINOR_M)
        latitude = np.arctan2(
            z + SECOND_ECCENTRICITY2 * SEMI_MINOR_M * np.sin(beta) ** 3,
            distance - ECCENTRICITY2 * SEMI_MAJOR_M * np.cos(beta) ** 3,
        )
        longitude = np.degrees(np.arctan2(y, x))
        return np.degrees(latitude), np.remainder(longitude + 180.0, 360.0) - 180.0

    def _axes(self) -> tuple[float, float, float, float]:
        latitude, longitude = np.radians(self.latitude_deg), np.radians(self.longitude_deg)
        return (
            float(np.sin(latitude)),
            float(np.cos(latitude)),
            float(np.sin(longitude)),
            float(np.cos(longitude)),
        )


def plane_around(latitude_deg: _Floats, longitude_deg: _Floats) -> TangentPlane:
    """Tangent plane at the middle of some positions [°], even across the 180° meridian."""
    first = float(longitude_deg[0])
    turned = np.remainder(longitude_deg - first + 180.0, 360.0) - 180.0
    longitude = wrap_degrees_180(first + float(np.mean(turned)))
    return TangentPlane(latitude_deg=float(np.mean(latitude_deg)), longitude_deg=longitude)


def _geocentric(
    latitude_deg: ArrayLike, longitude_deg: ArrayLike
) -> tuple[_Floats, _Floats, _Floats]:
    latitude = np.radians(np.asarray(latitude_deg, np.float64))
    longitude = np.radians(np.asarray(longitude_deg, np.float64))
    radius = SEMI_MAJOR_M / np.sqrt(1.0 - ECCENTRICITY2 * np.sin(latitude) ** 2)
    return (
        radius * np.cos(latitude) * np.cos(longitude),
        radius * np.cos(latitude) * np.sin(longitude),
        radius * (1.0 - ECCENTRICITY2) * np.sin(latitude),
    )
