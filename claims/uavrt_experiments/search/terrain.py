"""Artificial hills, because the height models of the papers are not available."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.localization.terrain.elevation import Elevation, Raster
from uavrt.localization.terrain.hill_losses import HillLosses

_Floats = NDArray[np.float64]
Heights = Callable[[_Floats, _Floats], _Floats]
PLANE = TangentPlane(latitude_deg=47.0, longitude_deg=8.0)
_MAP_ERROR_M = 3.0
"""Standard deviation of each height of the map [m] (Copernicus GLO-30: 90 % within 4 m)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hills:
    """Ground as a sum of waves in all directions, drawn from a seed.

    `relief_m`: approximate height from the lowest valley to the highest top [m].
    `lengths_m`: shortest and longest wave [m].
    """

    seed: int
    relief_m: float = 200.0
    lengths_m: tuple[float, float] = (400.0, 1600.0)

    def __call__(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """Height of the ground [m]; long waves have the largest amplitude."""
        rng = np.random.default_rng(self.seed)
        length = np.geomspace(*self.lengths_m, 12)
        course, phase = rng.uniform(0.0, 2.0 * np.pi, (2, 12))
        along = np.multiply.outer(east_m, np.sin(course) / length)
        along = along + np.multiply.outer(north_m, np.cos(course) / length)
        waves = np.sin(2.0 * np.pi * along + phase) @ length
        # Heights of many waves are nearly normal: five sigmas from valley to top.
        return np.asarray(self.relief_m / 5.0 * waves / np.sqrt(0.5 * (length**2).sum()))


def elevation_of(
    heights: Heights, *, reach_m: float = 3000.0, step_m: float = 30.0
) -> Elevation:
    """Put heights around `PLANE`'s origin into a map of one raster."""
    count = int(np.ceil(reach_m / step_m))
    per_lat = step_m / 111_200.0
    per_lon = per_lat / np.cos(np.radians(PLANE.latitude_deg))
    lat = PLANE.latitude_deg + per_lat * np.arange(count, -count - 1, -1)
    lon = PLANE.longitude_deg + per_lon * np.arange(-count, count + 1)
    east, north = PLANE.to_local(*np.meshgrid(lat, lon, indexing="ij"))
    points = heights(east, north).astype(np.float32)
    raster = Raster(
        name="hills",
        epsg=4326,
        x=float(lon[0]),
        y=float(lat[0]),
        step_x=per_lon,
        step_y=per_lat,
        rows=len(lat),
        columns=len(lon),
        datum="EGM96",
        read=lambda window: points[window[0] : window[1], window[2] : window[3]],
    )
    return Elevation(rasters=(raster,))


def mapped(
    ground: Heights,
    *,
    east_m: float,
    north_m: float,
    start_m: tuple[float, float],
    tag_m: float,
    frequency_hz: float,
) -> HillLosses:
    """A searcher's map of hills: a height every 30 m, each with an error.

    `ground`: gives heights of places, east and north [m].
    `east_m`, `north_m`: size of the area, from the origin [m].
    `start_m`: take-off, east and north [m].
    `tag_m`, `frequency_hz`: height [m] and frequency [Hz] of the tags.
    """
    rng = np.random.default_rng(1)

    def heights(east: _Floats, north: _Floats) -> _Floats:
        return ground(east, north) + rng.normal(0.0, _MAP_ERROR_M, east.shape)

    latitude, longitude = PLANE.to_geodetic([start_m[0]], [start_m[1]])
    losses = HillLosses(
        elevation_of(heights),
        latitude_deg=float(latitude[0]),
        longitude_deg=float(longitude[0]),
        frequency_hz=frequency_hz,
        tag_m=tag_m,
    )
    losses = losses.in_plane(PLANE)
    losses.cover([0.0, east_m], [0.0, north_m])
    return losses
