"""Compute the loss behind hills at every position around a drone.

Each cell has its own profile, whose points are as far apart as the cells, and its loss is
computed as in `uavrt.localization.terrain.diffraction`. Compiled kernels take a hundredth of
the time of NumPy.
"""

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import UsageError
from uavrt.core.runtime.native import kernels
from uavrt.core.units import SPEED_OF_LIGHT_M_S
from uavrt.localization.terrain.diffraction import EARTH_M, beyond_level_db, edge_parameters
from uavrt.localization.terrain.squares import GroundGrid

_Floats = NDArray[np.float64]
_TOGETHER = 100_000
"""Maximum number of terrain profile points, or ground cells, computed at once."""


def terrain_loss_map(
    ground: GroundGrid,
    *,
    east_m: float,
    north_m: float,
    antenna_m: float,
    tag_m: float,
    frequency_hz: float,
) -> NDArray[np.float32]:
    """Loss in addition to that of level ground, from a drone to tags at all cells [dB].

    `antenna_m` and `tag_m` are heights of the antenna and the tags above the ground below
    them.
    """
    height = ground.height_m
    rows, columns = height.shape
    column = (east_m - ground.west_m) / ground.cell_m
    row = (north_m - ground.south_m) / ground.cell_m
    if not (0.0 <= column <= columns - 1 and 0.0 <= row <= rows - 1):
        raise UsageError(
            f"the drone, {east_m:.0f} m east and {north_m:.0f} m north, is not over the map",
            remedy="Choose a map that covers the whole path",
        )
    drone_m = float(ground.at(np.array([column]), np.array([row]))[0]) + antenna_m
    # One column and row more, for points between cells at the edge of the map.
    over = np.pad(height - np.float32(drone_m), ((0, 1), (0, 1)), mode="edge")
    over = np.ascontiguousarray(over)
    wavelength = SPEED_OF_LIGHT_M_S / frequency_hz
    loss = np.empty((rows, columns), np.float32)
    band = max(1, _TOGETHER // columns)
    for first in range(0, rows, band):
        part = loss[first : first + band]
        y, x = np.mgrid[first : first + len(part), :columns]
        x, y = x - column, y - row
        far_m = np.hypot(x, y) * ground.cell_m
        nu = _parameters(over, column, row, tag_m, ground.cell_m, wavelength, first, x, y)
        part[:] = beyond_level_db(
            nu, far_m, antenna_m=antenna_m, tag_m=tag_m, wavelength_m=wavelength
        )
        part[far_m < 1.0] = 0.0
    return loss


def _parameters(
    over: NDArray[np.float32],
    column: float,
    row: float,
    tag_m: float,
    cell_m: float,
    wavelength_m: float,
    first: int,
    x: _Floats,
    y: _Floats,
) -> NDArray[np.float32]:
    """Diffraction parameter ν at the cells of several rows, for a given position of the
    drone.
    """
    compiled = getattr(kernels(), "edges", None)
    nu = np.full(x.shape, -10.0, np.float32)
    if compiled is not None:
        bulge = 0.5 / EARTH_M
        compiled(
            *(over, over.shape[1], column, row, tag_m, cell_m, wavelength_m, bulge, first, nu)
        )
        return nu
    grid = GroundGrid.of_heights(over)
    feet = over[first : first + len(x), :-1].ravel().astype(np.float64)
    x, y, flat = x.ravel(), y.ravel(), nu.ravel()
    far = np.hypot(x, y)
    order = np.argsort(far)
    done = 0
    while done < len(order):
        size = max(16, int(_TOGETHER / max(8.0, float(far[order[done]]))))
        some = order[done : done + size]
        done += size
        points = np.maximum(np.ceil(far[some]), 1.0)[:, np.newaxis]
        share = np.arange(1, int(points.max())) / points
        profile = grid.at(column + x[some, None] * share, row + y[some, None] * share)
        far_m = np.maximum(far[some] * cell_m, 1.0)
        distance = share * far_m[:, np.newaxis]
        flat[some] = edge_parameters(
            distance,
            profile - distance * distance / (2.0 * EARTH_M),
            far_m,
            np.zeros(len(some)),
            feet[some] - far_m * far_m / (2.0 * EARTH_M) + tag_m,
            wavelength_m,
        )
    return nu
