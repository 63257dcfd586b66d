"""Outlines of the regions that hold a tag with some probability, for maps."""

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.records import PositionGrid
from uavrt.localization.tangent_plane import TangentPlane

_Floats = NDArray[np.float64]
_Edge = tuple[int, int, int]
"""Row, column, and 0 for the edge to the next column, 1 for that to the next row."""


def region_outlines(grid: PositionGrid, share: float) -> list[_Floats]:
    """Outline of the smallest region that holds some share of a probability.

    Parameters
    ----------
    grid : PositionGrid
        A position's heat map.
    share : float
        0.5 or 0.95, say.

    Returns
    -------
    list of (k, 2) float64 arrays
        Closed rings of longitude and latitude [deg], the first place repeated at the end;
        outer rings counter-clockwise, holes clockwise (RFC 7946). A region that the search area
        cuts is closed along its edge.
    """
    ordered = np.sort(grid.probability.ravel())[::-1]
    place = int(np.searchsorted(np.cumsum(ordered), min(share, 1.0 - 1e-12)))
    level = float(ordered[min(place, len(ordered) - 1)])
    plane = TangentPlane(latitude_deg=grid.latitude_deg, longitude_deg=grid.longitude_deg)
    rings = []
    for rows, columns in _rings(np.pad(grid.probability, 1), level * (1.0 - 1e-9)):
        # Places between cells' centres; the added margin is one cell outside.
        east = _along(grid.east_m, columns - 1.0)
        north = _along(grid.north_m, rows - 1.0)
        latitude, longitude = plane.to_geodetic(east, north)
        rings.append(np.stack([longitude, latitude], axis=1))
    return rings


def _along(axis_m: _Floats, place: _Floats) -> _Floats:
    return np.asarray(axis_m[0] + place * (axis_m[1] - axis_m[0]))


def _rings(values: _Floats, level: float) -> list[tuple[_Floats, _Floats]]:
    """Closed contours of an array with a margin below the level: rows and columns of each.

    Marching squares. Around each cell, counter-clockwise, the edge over which one leaves the
    region leads back to the one over which one came; so rings have the region on their left.
    """
    after: dict[_Edge, _Edge] = {}
    inside = values >= level
    count = inside[:-1, :-1].astype(int) + inside[:-1, 1:] + inside[1:, :-1] + inside[1:, 1:]
    for row, column in zip(
        *map(np.ndarray.tolist, np.nonzero((count > 0) & (count < 4))), strict=True
    ):
        corners = ((row, column), (row, column + 1), (row + 1, column + 1), (row + 1, column))
        edges = (
            (row, column, 0),
            (row, column + 1, 1),
            (row + 1, column, 0),
            (row, column, 1),
        )
        within = [bool(inside[corner]) for corner in corners]
        turned = [*within[1:], within[0]]
        enters = [edge for edge, a, b in zip(edges, within, turned, strict=True) if b and not a]
        leaves = [edge for edge, a, b in zip(edges, within, turned, strict=True) if a and not b]
        if len(enters) == 2:
            # A saddle: its middle says whether the two corners hang together. Going round, each
            # corner is entered before it is left.
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
    """Row and column where the level lies on an edge."""
    row, column, down = edge
    here = float(values[row, column])
    there = float(values[row + down, column + 1 - down])
    part = (level - here) / (there - here) if there != here else 0.5
    return row + down * part, column + (1 - down) * part
