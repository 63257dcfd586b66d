"""Compute outlines of the regions that contain a tag with a given probability, for maps."""

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.localization.number_kinds import Resolution
from uavrt.localization.results import PositionGrid

_Floats = NDArray[np.float64]
_Edge = tuple[int, int, int]
"""Edge of the grid: row, column, and 0 for the edge towards the next column or 1 for that
towards the next row."""


def region_outlines(grid: PositionGrid, share: float) -> list[_Floats]:
    """Return the outline of the smallest region that contains a given probability.

    `grid` is the heat map of a position, `share` the probability, such as 0.5 or 0.95. Returns
    closed rings (k, 2) of longitude and latitude [deg], in which the last position repeats the
    first; outer rings are counter-clockwise, holes clockwise (RFC 7946). A region that the
    search area cuts is closed along its edge.
    """
    grid_east, grid_north, probability = refined(
        np.asarray(grid.east_m), np.asarray(grid.north_m), grid.probability
    )
    ordered = np.sort(probability.ravel())[::-1]
    place = int(np.searchsorted(np.cumsum(ordered), min(share, 1.0 - 1e-12)))
    level = float(ordered[min(place, len(ordered) - 1)])
    plane = TangentPlane(latitude_deg=grid.latitude_deg, longitude_deg=grid.longitude_deg)
    rings = []
    for rows, columns in _rings(np.pad(probability, 1), level * (1.0 - 1e-9)):
        # Places between cells' centres; the added margin is one cell outside.
        east = _along(grid_east, columns - 1.0)
        north = _along(grid_north, rows - 1.0)
        latitude, longitude = plane.to_geodetic(east, north)
        rings.append(np.stack([longitude, latitude], axis=1))
    return rings


def refined(
    x: _Floats, y: _Floats, probability: _Floats, times: Resolution[int] = 4
) -> tuple[_Floats, _Floats, _Floats]:
    """Interpolate a probability on a finer grid, cubic in its logarithm; return x, y and
    values.
    """
    # Nothing is drawn below 1e-12 of the peak; zero has no logarithm.
    logs = np.log(np.maximum(probability, 1e-12 * probability.max()))
    fine = np.exp(_cubic(_cubic(logs, times).T, times).T)
    return (
        np.linspace(x[0], x[-1], times * (len(x) - 1) + 1),
        np.linspace(y[0], y[-1], times * (len(y) - 1) + 1),
        fine / fine.sum(),
    )


def _cubic(values: _Floats, times: int) -> _Floats:
    """Interpolate along the last axis by Catmull-Rom splines, which are continued linearly at
    the ends.
    """
    first = 2.0 * values[:, :1] - values[:, 1:2]
    last = 2.0 * values[:, -1:] - values[:, -2:-1]
    p = np.concatenate([first, values, last], axis=1)
    p0, p1, p2, p3 = (p[:, place : place + values.shape[1] - 1] for place in range(4))
    t = (np.arange(times) / times)[None, None, :]
    p0, p1, p2, p3 = (part[:, :, None] for part in (p0, p1, p2, p3))
    between = 0.5 * (
        2.0 * p1
        + (p2 - p0) * t
        + (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3) * t**2
        + (3.0 * p1 - p0 - 3.0 * p2 + p3) * t**3
    )
    return np.concatenate([between.reshape(len(values), -1), values[:, -1:]], axis=1)


def _along(axis_m: _Floats, place: _Floats) -> _Floats:
    return np.asarray(axis_m[0] + place * (axis_m[1] - axis_m[0]))


def _rings(values: _Floats, level: float) -> list[tuple[_Floats, _Floats]]:
    """Return closed contours of an array at a level, as rows and columns; the values at its
    margin must be below the level.

    The contours are found by marching squares. Around each cell, counter-clockwise, the edge at
    which a contour leaves the region is linked to the edge at which it enters, so the region is
    on the contour's left.
    """
    after: dict[_Edge, _Edge] = {}
    inside = values >= level
    count = inside[:-1, :-1].astype(int) + inside[:-1, 1:] + inside[1:, :-1] + inside[1:, 1:]
    for row, column in zip(
        *map(np.ndarray.tolist, np.nonzero((count > 0) & (count < 4))), strict=True
    ):
        corners = ((row, column), (row, column + 1), (row + 1, column + 1), (row + 1, column))
        edges = ((row, column, 0), (row, column + 1, 1), (row + 1, column, 0), (row, column, 1))
        within = [bool(inside[corner]) for corner in corners]
        turned = [*within[1:], within[0]]
        enters = [edge for edge, a, b in zip(edges, within, turned, strict=True) if b and not a]
        leaves = [edge for edge, a, b in zip(edges, within, turned, strict=True) if a and not b]
        if len(enters) == 2:
            # A saddle: the value in its middle decides if the two corners are connected. On the
            # way around, each corner is entered before it is left.
            first = edges.index(enters[0]) < edges.index(leaves[0])
            together = np.mean([values[corner] for corner in corners]) >= level
            if first == together:
                enters.reverse()
        after.update(zip(leaves, enters, strict=True))
    rings = []
    while after:
        start, edge = after.popitem()
        ring = [start]
        while edge != start:
            ring.append(edge)
            edge = after.pop(edge)
        ring.append(start)
        places = np.array([_crossing(values, level, one) for one in ring])
        rings.append((places[:, 0], places[:, 1]))
    return rings


def _crossing(values: _Floats, level: float, edge: _Edge) -> tuple[float, float]:
    row, column, down = edge
    here = float(values[row, column])
    there = float(values[row + down, column + 1 - down])
    part = (level - here) / (there - here) if there != here else 0.5
    return row + down * part, column + (1 - down) * part
