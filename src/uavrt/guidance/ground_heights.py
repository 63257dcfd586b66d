"""Heights of the ground around home, from an elevation map; no I/O.

The map is also compared with the autopilot's height of home. If they disagree, one is wrong.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import PlanError
from uavrt.guidance.safety import SAFETY

_Floats = NDArray[np.float64]
HeightsAt = Callable[[_Floats, _Floats], _Floats]
"""Function that returns the heights above sea level [m] at latitudes and longitudes; NaN if
unknown."""
STEP_M = 10.0
_MOST_SQUARES = 300


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GroundAround:
    """Heights of the ground around home, on a square grid."""

    home_amsl_m: float
    """Height of home above sea level in the map [m]."""
    reach_m: float
    step_m: float
    heights_m: _Floats
    """Heights of the ground above home [m], NaN if unknown; rows go north, columns east, from
    the south-west corner."""

    @classmethod
    def around(
        cls, heights_at: HeightsAt, plane: TangentPlane, reach_m: float
    ) -> "GroundAround":
        """Read the map around home. Raises `PlanError` if it does not contain home."""
        step = max(STEP_M, reach_m / _MOST_SQUARES)
        count = int(np.ceil(reach_m / step)) + 1
        along = step * np.arange(-count, count + 1)
        latitude, longitude = plane.to_geodetic(*np.meshgrid(along, along))
        home = float(
            heights_at(np.array([plane.latitude_deg]), np.array([plane.longitude_deg]))[0]
        )
        if not np.isfinite(home):
            raise PlanError(
                "the elevation map does not cover home",
                remedy="Add its tile to guidance.terrain, or remove the setting",
            )
        heights = heights_at(np.asarray(latitude), np.asarray(longitude)) - home
        return cls(home_amsl_m=home, reach_m=count * step, step_m=step, heights_m=heights)

    def above_home_m(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """Return the highest of the four grid points around each position, above home [m].

        NaN if one is unknown.
        """
        last = len(self.heights_m) - 1
        column = np.floor((east_m + self.reach_m) / self.step_m).astype(np.intp)
        row = np.floor((north_m + self.reach_m) / self.step_m).astype(np.intp)
        beyond = (column < 0) | (row < 0) | (column >= last) | (row >= last)
        c, r = np.clip(column, 0, last - 1), np.clip(row, 0, last - 1)
        high = self.heights_m[r, c]
        for down, right in ((0, 1), (1, 0), (1, 1)):
            high = np.maximum(high, self.heights_m[r + down, c + right])  # NaN stays
        return np.where(beyond, np.nan, high)

    def highest_home_m(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """Return the highest known ground from each position to home [m above home, ≥ 0]."""
        farthest = float(np.max(np.hypot(east_m, north_m), initial=0.0))
        shares = np.linspace(0.0, 1.0, int(farthest / self.step_m) + 2)[:, None]
        x, y = np.ravel(east_m), np.ravel(north_m)
        ground = np.nan_to_num(self.above_home_m(shares * x, shares * y), nan=0.0)
        return np.asarray(ground.max(axis=0, initial=0.0)).reshape(np.shape(east_m))

    def apart_m(self, home_amsl_m: float) -> float | None:
        """Return the autopilot's height of home minus that of the map [m].

        None if they differ by at most 15 m.
        """
        apart = home_amsl_m - self.home_amsl_m
        return apart if abs(apart) > SAFETY.home_height_error_m else None
