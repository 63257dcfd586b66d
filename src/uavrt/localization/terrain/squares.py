"""Interpolate ground heights on a grid of squares around a point."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import UsageError
from uavrt.localization.terrain.elevation import Elevation

_Floats = NDArray[np.float64]
_MOST_CELLS = 16_000_000
_ROWS = 400


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GroundGrid:
    """Heights at the centres of squares, in metres around a point."""

    plane: TangentPlane
    west_m: float
    south_m: float
    cell_m: float
    known: NDArray[np.bool_]
    """True where elevation files contain the height, shape (rows, columns), southern row
    first."""
    height_m: NDArray[np.float32]
    """Heights [m], shape (rows, columns); unknown heights are copied from the nearest known
    cell."""

    @classmethod
    def of_heights(cls, height_m: NDArray[np.float32]) -> "GroundGrid":
        """Create a grid from known heights, with squares of one metre and an arbitrary position
        on the earth.
        """
        return cls(
            plane=TangentPlane(latitude_deg=0.0, longitude_deg=0.0),
            west_m=0.0,
            south_m=0.0,
            cell_m=1.0,
            known=np.ones(height_m.shape, bool),
            height_m=height_m,
        )

    @property
    def east_m(self) -> _Floats:
        """East coordinates of the cells' centres [m], shape (columns,)."""
        return np.asarray(self.west_m + self.cell_m * np.arange(self.height_m.shape[1]))

    @property
    def north_m(self) -> _Floats:
        """North coordinates of the cells' centres [m], shape (rows,)."""
        return np.asarray(self.south_m + self.cell_m * np.arange(self.height_m.shape[0]))

    @property
    def unknown_share(self) -> float:
        """Share of the cells whose height is unknown."""
        return float(1.0 - self.known.mean())

    def __call__(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """Heights interpolated between the cells' centres [m]; beyond the grid, the heights at
        its edge.
        """
        return self.at(
            (east_m - self.west_m) / self.cell_m, (north_m - self.south_m) / self.cell_m
        )

    def at(self, column: NDArray[np.floating], row: NDArray[np.floating]) -> _Floats:
        """Heights interpolated at fractional columns and rows [m]."""
        rows, columns = self.height_m.shape
        c = np.clip(column, 0.0, columns - 1.0)
        r = np.clip(row, 0.0, rows - 1.0)
        left = np.minimum(c.astype(np.int32), columns - 2)
        low = np.minimum(r.astype(np.int32), rows - 2)
        flat, first = self.height_m.ravel(), low * columns + left
        c, r = c - left, r - low
        south = flat[first] * (1.0 - c) + flat[first + 1] * c
        north = flat[first + columns] * (1.0 - c) + flat[first + columns + 1] * c
        return np.asarray(south * (1.0 - r) + north * r)


def ground_grid(
    elevation: Elevation | None,
    plane: TangentPlane,
    *,
    west_m: float,
    east_m: float,
    south_m: float,
    north_m: float,
    cell_m: float,
) -> GroundGrid:
    """Create a grid of heights on squares over an area; without `elevation`, all heights are
    0.
    """
    columns = max(2, math.ceil((east_m - west_m) / cell_m) + 1)
    rows = max(2, math.ceil((north_m - south_m) / cell_m) + 1)
    if rows * columns > _MOST_CELLS:
        raise UsageError(
            f"the area has {rows * columns:,} squares of {cell_m:g} m; at most {_MOST_CELLS:,} "
            "are allowed",
            remedy="Choose larger map cells, or a smaller area",
        )
    east = west_m + cell_m * np.arange(columns)
    height = np.zeros((rows, columns), np.float32)
    for first in range(0, rows if elevation is not None else 0, _ROWS):
        north = south_m + cell_m * np.arange(first, min(first + _ROWS, rows))
        assert elevation is not None
        places = plane.to_geodetic(east[np.newaxis, :], north[:, np.newaxis])
        height[first : first + len(north)] = elevation.heights_m(*places)
    known = np.isfinite(height)
    if not known.all():
        height = _filled(height, known)
    return GroundGrid(
        plane=plane, west_m=west_m, south_m=south_m, cell_m=cell_m, known=known, height_m=height
    )


def _filled(height: NDArray[np.float32], known: NDArray[np.bool_]) -> NDArray[np.float32]:
    if not known.any():
        return np.zeros_like(height)
    from scipy.ndimage import distance_transform_edt  # Only for ground with gaps: 2 MB.

    rows, columns = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(height[rows, columns])
