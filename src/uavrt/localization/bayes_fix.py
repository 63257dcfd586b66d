"""The default position estimator: a posterior on a grid that closes in on where it matters.

Specified in reference/localization.md §2.2. The point is the most probable one; the mean lies
outward of it for weak geometry. A bearing that contradicts the others is not followed but
reported: each may be an outlier with some probability.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.records import Ellipse

_Floats = NDArray[np.float64]

LogLikelihood = Callable[[_Floats, _Floats, float], _Floats]
"""East and north (places,) and the cell's width [m] to the log-likelihood (places,)."""

_KEEP_NATS = 15.0
_MAX_LEVELS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Area:
    """Where to search: a rectangle in the local plane."""

    west_m: float
    east_m: float
    south_m: float
    north_m: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GridPosterior:
    """Probability of the cells of a rectangle, and what follows from it."""

    east_m: _Floats
    """(x,) centres of the cells."""
    north_m: _Floats
    """(y,)."""
    log_density: _Floats
    """(y, x), up to a constant."""
    probability: _Floats
    """(y, x); sums to 1."""
    at_edge: bool
    """The search area cuts the probability."""

    @property
    def cell_m(self) -> float:
        """Width of a cell."""
        return float(self.east_m[1] - self.east_m[0])

    def places(self) -> tuple[_Floats, _Floats]:
        """East and north of all cells, flat, in the order of ``probability.ravel()``."""
        north, east = np.meshgrid(self.north_m, self.east_m, indexing="ij")
        return east.ravel(), north.ravel()

    def most_probable(self) -> tuple[float, float]:
        """East and north [m] of the maximum, refined by parabolas."""
        row, column = np.unravel_index(int(np.argmax(self.log_density)), self.log_density.shape)
        return (
            _refined(self.east_m, self.log_density[row, :], int(column)),
            _refined(self.north_m, self.log_density[:, column], int(row)),
        )

    def mean(self) -> tuple[float, float]:
        """East and north [m] of the point with the least expected squared error."""
        east, north = self.places()
        weight = self.probability.ravel()
        return float(weight @ east), float(weight @ north)

    def radius_m(self, share: float, point: tuple[float, float]) -> float:
        """Radius of the circle around a point that holds some share."""
        east, north = self.places()
        x, y = point
        distance = np.hypot(east - x, north - y)
        order = np.argsort(distance)
        held = np.cumsum(self.probability.ravel()[order])
        return float(np.interp(share, held, distance[order]))

    def threshold(self, share: float) -> float:
        """Least cell probability inside the smallest region that holds some share."""
        ordered = np.sort(self.probability.ravel())[::-1]
        place = int(np.searchsorted(np.cumsum(ordered), share))
        return float(ordered[min(place, len(ordered) - 1)])

    def ellipse(self, share: float = 0.95) -> Ellipse:
        """Ellipse of the posterior's covariance, scaled as for a normal law."""
        east, north = self.places()
        weight = self.probability.ravel()
        centred = np.stack([east - weight @ east, north - weight @ north])
        return ellipse_of((centred * weight) @ centred.T, share)


def ellipse_of(covariance_m2: _Floats, share: float = 0.95) -> Ellipse:
    """Ellipse that holds some share of a normal law, from its (2, 2) covariance."""
    values, vectors = np.linalg.eigh(covariance_m2)
    scale = -2.0 * np.log(1.0 - share)
    minor, major = np.sqrt(np.maximum(values, 0.0) * scale)
    direction = np.degrees(np.arctan2(vectors[0, 1], vectors[1, 1])) % 180.0
    return Ellipse(
        semi_major_m=float(major),
        semi_minor_m=float(minor),
        orientation_deg=float(direction) if direction < 180.0 else 0.0,
    )


def normal_radius_m(covariance_m2: _Floats, share: float) -> float:
    """Radius of the centred circle that holds some share of a normal law in the plane."""
    angle = np.radians(np.arange(0.5, 360.0))
    across = np.stack([np.cos(angle), np.sin(angle)])
    q = np.einsum("ia,ij,ja->a", across, np.linalg.inv(covariance_m2), across)
    low, high = 0.0, 10.0 * float(np.sqrt(np.trace(covariance_m2)))
    mass = 2.0 * np.pi * np.sqrt(np.linalg.det(covariance_m2))
    for _ in range(50):
        middle = 0.5 * (low + high)
        inside = np.mean((1.0 - np.exp(-0.5 * middle**2 * q)) / q) * 2.0 * np.pi / mass
        low, high = (middle, high) if inside < share else (low, middle)
    return 0.5 * (low + high)


def grid_posterior(
    log_likelihood: LogLikelihood, area: Area, *, cells: int = 100
) -> GridPosterior:
    """Evaluate a likelihood on a grid, and again on the part that matters, until it is fine.

    Parameters
    ----------
    log_likelihood : callable
        Sees the width of a cell, so that a ray narrower than it is not missed.
    area : Area
        Uniform prior.
    cells : int
        Cells in each direction.
    """
    whole = area
    at_edge = False
    for level in range(_MAX_LEVELS):
        grid = _evaluated(log_likelihood, area, cells, at_edge)
        if level == 0:
            at_edge = _edge_share(grid.probability) > 0.005
        inner, finer = _closed_in(grid, area, whole)
        if not finer:
            break
        area = inner
    return _evaluated(log_likelihood, area, cells, at_edge) if level == 0 else grid


def _evaluated(
    log_likelihood: LogLikelihood, area: Area, cells: int, at_edge: bool
) -> GridPosterior:
    width = max(area.east_m - area.west_m, area.north_m - area.south_m)
    across = max(8, round(cells * (area.east_m - area.west_m) / width))
    along = max(8, round(cells * (area.north_m - area.south_m) / width))
    east = area.west_m + (np.arange(across) + 0.5) * (area.east_m - area.west_m) / across
    north = area.south_m + (np.arange(along) + 0.5) * (area.north_m - area.south_m) / along
    places_north, places_east = np.meshgrid(north, east, indexing="ij")
    value = log_likelihood(places_east.ravel(), places_north.ravel(), float(east[1] - east[0]))
    log_density = value.reshape(along, across)
    probability = np.exp(log_density - log_density.max())
    return GridPosterior(
        east_m=east,
        north_m=north,
        log_density=log_density,
        probability=probability / probability.sum(),
        at_edge=at_edge,
    )


def _edge_share(probability: _Floats) -> float:
    border = np.concatenate(
        [probability[0], probability[-1], probability[1:-1, 0], probability[1:-1, -1]]
    )
    return float(border.sum())


def _closed_in(grid: GridPosterior, area: Area, whole: Area) -> tuple[Area, bool]:
    """Part of an area that holds what is probable, and whether looking there is finer."""
    likely = grid.log_density > grid.log_density.max() - _KEEP_NATS
    rows, columns = np.flatnonzero(likely.any(axis=1)), np.flatnonzero(likely.any(axis=0))
    step_x, step_y = grid.cell_m, float(grid.north_m[1] - grid.north_m[0])
    inner = Area(
        west_m=max(whole.west_m, float(grid.east_m[columns[0]]) - 1.5 * step_x),
        east_m=min(whole.east_m, float(grid.east_m[columns[-1]]) + 1.5 * step_x),
        south_m=max(whole.south_m, float(grid.north_m[rows[0]]) - 1.5 * step_y),
        north_m=min(whole.north_m, float(grid.north_m[rows[-1]]) + 1.5 * step_y),
    )
    before = max(area.east_m - area.west_m, area.north_m - area.south_m)
    after = max(inner.east_m - inner.west_m, inner.north_m - inner.south_m)
    return inner, after < 0.7 * before and before > 1.0


def _refined(axis: _Floats, values: _Floats, top: int) -> float:
    if 0 < top < len(axis) - 1:
        left, middle, right = values[top - 1], values[top], values[top + 1]
        bend = 2.0 * middle - left - right
        if bend > 1e-12:
            shift = float(np.clip(0.5 * (right - left) / bend, -0.5, 0.5))
            return float(axis[top] + shift * (axis[1] - axis[0]))
    return float(axis[top])
