"""Compute a position's posterior on square cells that are small near its peaks (default
estimator).

Cells with much probability are quartered, so that both narrow peaks and long tails, such as
those of a possible outlier, are resolved. The reported point is the most probable one, because
the mean is farther away than the tag for weak geometry. A bearing that contradicts the others
is reported and hardly moves the point, since each bearing may be an outlier with some
probability.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.number_kinds import Fixed
from uavrt.localization.position.tuning import GRID
from uavrt.localization.results import Ellipse
from uavrt.localization.tuning import FLIGHT

_Floats = NDArray[np.float64]

LogLikelihood = Callable[[_Floats, _Floats, _Floats], _Floats]
"""Function from east, north and cell width [m] (places,) to the log-likelihood of a tag there
(places,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Area:
    """Rectangle in the local plane in which a tag is searched for."""

    west_m: float
    east_m: float
    south_m: float
    north_m: float

    def touches(self, east_m: _Floats, north_m: _Floats, half_m: _Floats) -> NDArray[np.bool_]:
        """True for squares around the given positions that overlap the area, shape (n,)."""
        return np.asarray(
            (east_m + half_m > self.west_m)
            & (east_m - half_m < self.east_m)
            & (north_m + half_m > self.south_m)
            & (north_m - half_m < self.north_m)
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """Posterior on squares of different sizes that cover an area, and values derived from
    it.
    """

    east_m: _Floats
    north_m: _Floats
    width_m: _Floats
    log_density: _Floats
    """Logarithm of the posterior density in each cell, up to a constant, shape (n,)."""
    probability: _Floats
    """Posterior probability of each cell, shape (n,); the sum is 1."""
    log_evidence: float
    """Logarithm of the likelihood's integral over the area."""
    at_edge: bool
    rough: NDArray[np.bool_]
    """True where the posterior density may vary strongly within a cell, shape (n,)."""

    def mean(self) -> tuple[float, float]:
        """East and north of the mean [m], which has the smallest expected squared error."""
        return float(self.probability @ self.east_m), float(self.probability @ self.north_m)

    def likely_mean(self, log_likelihood: LogLikelihood) -> tuple[float, float]:
        """East and north of the mean [m]; if the mean is unlikely, the nearest likely
        position.
        """
        east, north = self.mean()
        order = np.argsort(-self.log_density)
        kept = order[: int(np.searchsorted(np.cumsum(self.probability[order]), 0.5)) + 1]
        one = np.array([east]), np.array([north]), self.width_m[order[:1]]
        if log_likelihood(*one)[0] >= self.log_density[kept[-1]]:
            return east, north
        nearest = np.argmin(np.hypot(self.east_m[kept] - east, self.north_m[kept] - north))
        return float(self.east_m[kept[nearest]]), float(self.north_m[kept[nearest]])

    def radius_m(self, share: float, point: tuple[float, float], sigma_m: float) -> float:
        """Radius around a point that contains the probability `share` [m]; `sigma_m` is an
        error common to all positions.
        """
        distance = np.hypot(self.east_m - point[0], self.north_m - point[1])
        # Four parts of each cell, for the cell that holds the point itself reaches from 0.
        parts = (np.arange(4) - 1.5) / 4.0
        spread = np.abs(distance[:, None] + parts * self.width_m[:, None]).ravel()
        order = np.argsort(spread)
        held = np.cumsum(np.repeat(self.probability / 4.0, 4)[order])
        return shifted_m(float(np.interp(share, held, spread[order], left=0.0)), share, sigma_m)

    def ellipse(self, sigma_m: float) -> Ellipse:
        """Return the 95 % ellipse of a normal distribution with the posterior's covariance.

        `sigma_m` is the standard deviation of an error common to all positions, which is added
        [m].
        """
        x, y = self.mean()
        centred = np.stack([self.east_m - x, self.north_m - y])
        covariance = (centred * self.probability) @ centred.T
        return ellipse_of(covariance + sigma_m**2 * np.eye(2))

    def map(self, count: int, sigma_m: float) -> tuple[_Floats, _Floats, _Floats]:
        """Return the probability on a regular grid: east (x,), north (y,), and values (y, x).

        Each cell's probability is spread over its width, and by an error common to all
        positions.
        """
        east, north, step = _even_axes(self.around(GRID.map_share), count, 2.5 * sigma_m)
        density = np.zeros((len(north), len(east)))
        for width_m in np.unique(self.width_m):
            own = np.flatnonzero(self.width_m == width_m)
            own = own[np.argsort(self.north_m[own])]
            # Cells of one width lie in few rows and columns of a grid.
            rows, starts = np.unique(self.north_m[own], return_index=True)
            columns, column = np.unique(self.east_m[own], return_inverse=True)
            one_m = float(np.sqrt(width_m**2 / 12.0 + sigma_m**2 + step**2 / 12.0))
            across = self.probability[own, None] * _normal(columns, east, one_m)[column]
            density += _normal(rows, north, one_m).T @ np.add.reduceat(across, starts)
        return east, north, np.asarray(density / density.sum())

    def around(self, share: float) -> Area:
        """Rectangle around the smallest set of cells that contains a given probability."""
        density = self.probability / self.width_m**2
        order = np.argsort(-density)
        count = int(np.searchsorted(np.cumsum(self.probability[order]), share)) + 1
        kept = order[:count]
        half = 0.5 * self.width_m[kept]
        east, north = self.east_m[kept], self.north_m[kept]
        return Area(
            west_m=float((east - half).min()),
            east_m=float((east + half).max()),
            south_m=float((north - half).min()),
            north_m=float((north + half).max()),
        )


def ellipse_of(covariance_m2: _Floats) -> Ellipse:
    """Ellipse that contains 95 % of a normal distribution with the given covariance (2, 2)
    [m²].
    """
    values, vectors = np.linalg.eigh(covariance_m2)
    scale = -2.0 * np.log(1.0 - 0.95)
    minor, major = np.sqrt(np.maximum(values, 0.0) * scale)
    direction = np.degrees(np.arctan2(vectors[0, 1], vectors[1, 1])) % 180.0
    return Ellipse(
        semi_major_m=float(major),
        semi_minor_m=float(minor),
        orientation_deg=float(direction) if direction < 180.0 else 0.0,
    )


def normal_radius_m(covariance_m2: _Floats, share: float) -> float:
    """Radius of the centred circle that contains the probability `share` of a normal
    distribution [m].
    """
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


def shifted_m(radius_m: float, share: float, sigma_m: float = FLIGHT.place_sigma_m) -> float:
    """Radius that still contains the probability `share` if all positions may be shifted
    together [m].

    The radii are added as squares, which is exact for circular normal distributions.
    """
    return float(np.hypot(radius_m, sigma_m * np.sqrt(-2.0 * np.log(1.0 - share))))


def cells_posterior(
    log_likelihood: LogLikelihood,
    area: Area,
    *,
    first_cells: int = GRID.first_cells,
    held: float = GRID.held,
    growth: Fixed[float] = 1.0,
    within: Area | None = None,
    shows_m: float = np.inf,
) -> Cells:
    """Evaluate a likelihood on squares, and again on the quarters of probable squares.

    `log_likelihood`: receives the width of each cell, so that it can include a bearing line
    narrower than the cell. `first_cells`: number of cells along the longer side at the start.
    `held`: probability above which a cell is quartered. `growth`: factor by which, at each
    quartering, the probability increases above which a rough cell is quartered, since the
    slopes of a resolved peak contain little probability. `within`: area in which cells wider
    than `shows_m` are always quartered, since the middle of a wide cell may be a hundred nats
    less likely than a peak within it. `shows_m`: cell width that misses no peak [m].
    """
    east, north, width = _squares(area, first_cells)
    density = log_likelihood(east, north, width)
    rough = np.ones(len(east), bool)
    return _quartered(
        log_likelihood, east, north, width, density, rough, held, growth, within, shows_m
    )


def cells_refined(log_likelihood: LogLikelihood, cells: Cells, density: _Floats) -> Cells:
    """Refine the cells of an earlier posterior for a likelihood that includes further data.

    `density` is the new log-likelihood at the cells. If it differs from the earlier one only by
    a constant, no cell is quartered again.
    """
    added = density - cells.log_density
    rough = cells.rough | (added - np.median(added) > GRID.added_nats)
    return _quartered(
        log_likelihood, cells.east_m, cells.north_m, cells.width_m, density, rough
    )


def _quartered(
    log_likelihood: LogLikelihood,
    east: _Floats,
    north: _Floats,
    width: _Floats,
    density: _Floats,
    rough: NDArray[np.bool_],
    held: float = GRID.held,
    growth: Fixed[float] = 1.0,
    within: Area | None = None,
    shows_m: float = np.inf,
) -> Cells:
    at_edge = _edge_share(east, north, width, density) > GRID.edge_share
    widest = float(width.max())
    for _ in range(GRID.rounds):
        probability, _ = _normalised(density, width)
        worth = GRID.held_rough * growth ** np.log2(widest / width)
        split = (probability > held) | (rough & (probability > worth))
        split &= width > GRID.least_width_m
        if within is not None:
            split |= (width > shows_m) & within.touches(east, north, 0.5 * width)
        if within is not None and not split.any():
            split = _overlooked(log_likelihood, east, north, width, density, shows_m, within)
        if not split.any():
            break
        quarter = 0.25 * width[split]
        corners = ((-1, -1), (-1, 1), (1, -1), (1, 1))
        new_east = np.concatenate([east[split] + x * quarter for x, _ in corners])
        new_north = np.concatenate([north[split] + y * quarter for _, y in corners])
        new_width = np.tile(2.0 * quarter, 4)
        new_density = log_likelihood(new_east, new_north, new_width)
        varies = np.ptp(new_density.reshape(4, -1), axis=0) > GRID.rough_nats
        varies |= (
            np.abs(new_density.reshape(4, -1).max(axis=0) - density[split]) > GRID.rough_nats
        )
        rough = np.concatenate([rough[~split], np.tile(varies, 4)])
        east, north = (
            np.concatenate([old[~split], new])
            for old, new in ((east, new_east), (north, new_north))
        )
        width = np.concatenate([width[~split], new_width])
        density = np.concatenate([density[~split], new_density])
    probability, log_evidence = _normalised(density, width)
    return Cells(
        east_m=east,
        north_m=north,
        width_m=width,
        log_density=density,
        probability=probability,
        log_evidence=log_evidence,
        at_edge=at_edge,
        rough=rough,
    )


def _overlooked(
    log_likelihood: LogLikelihood,
    east: _Floats,
    north: _Floats,
    width: _Floats,
    density: _Floats,
    shows_m: float,
    within: Area,
) -> NDArray[np.bool_]:
    """True for wide cells that must be quartered because one of their corners is likely."""
    found = np.zeros(len(east), bool)
    half = 0.5 * width
    wide = np.flatnonzero((width > 0.5 * shows_m) & within.touches(east, north, half))
    if not wide.size:
        return found
    corner_e, corner_n = east[wide] + half[wide], north[wide] + half[wide]
    likely = (
        log_likelihood(corner_e, corner_n, width[wide]) > density.max() - GRID.overlooked_nats
    )
    for x, y in zip(corner_e[likely], corner_n[likely], strict=True):
        reach = 1.01 * half[wide]
        found[wide] |= (np.abs(east[wide] - x) < reach) & (np.abs(north[wide] - y) < reach)
    return found


def most_probable(cells: Cells, log_likelihood: LogLikelihood) -> tuple[float, float]:
    """Return east and north of the likelihood's maximum [m].

    An even grid covers the more likely half, and parabolas refine the maximum. The cells
    themselves differ in size and therefore in blur, so their values cannot be compared
    accurately enough.
    """
    east, north, step = _even_axes(cells.around(0.5), GRID.peak_cells)
    y, x = (one.ravel() for one in np.meshgrid(north, east, indexing="ij"))
    values = log_likelihood(x, y, np.full(x.size, step)).reshape(len(north), len(east))
    row, column = np.unravel_index(int(np.argmax(values)), values.shape)
    return (
        _refined(east, values[row, :], int(column)),
        _refined(north, values[:, column], int(row)),
    )


def _even_axes(
    around: Area, count: int, margin_m: float = 0.0
) -> tuple[_Floats, _Floats, float]:
    """Return east (x,) and north (y,) of an even grid over an area and its margin, and the
    grid's step [m].
    """
    wide = around.east_m - around.west_m + 2.0 * margin_m
    high = around.north_m - around.south_m + 2.0 * margin_m
    step = max(wide, high) / (count - 4)
    across, along = (max(8, round(side / step) + 4) for side in (wide, high))
    east = 0.5 * (around.west_m + around.east_m) + (np.arange(across) - (across - 1) / 2) * step
    north = (
        0.5 * (around.south_m + around.north_m) + (np.arange(along) - (along - 1) / 2) * step
    )
    return np.asarray(east), np.asarray(north), step


def _normal(centres: _Floats, axis: _Floats, sigma_m: float) -> _Floats:
    """Normal density around each centre at each point of an axis, without its constant factor,
    shape (centres, axis).
    """
    away = (axis - centres[:, None]) / sigma_m
    return np.asarray(np.exp(-0.5 * away**2) / sigma_m)


def _squares(area: Area, count: int) -> tuple[_Floats, _Floats, _Floats]:
    wide, high = area.east_m - area.west_m, area.north_m - area.south_m
    step = max(wide, high) / count
    across, along = (max(4, round(side / step)) for side in (wide, high))
    east = 0.5 * (area.west_m + area.east_m) + (np.arange(across) - (across - 1) / 2) * step
    north = 0.5 * (area.south_m + area.north_m) + (np.arange(along) - (along - 1) / 2) * step
    places_north, places_east = np.meshgrid(north, east, indexing="ij")
    return places_east.ravel(), places_north.ravel(), np.full(places_east.size, step)


def _normalised(density: _Floats, width: _Floats) -> tuple[_Floats, float]:
    value = density + 2.0 * np.log(width)
    top = float(value.max())
    probability = np.exp(value - top)
    total = float(probability.sum())
    return probability / total, top + float(np.log(total))


def _edge_share(east: _Floats, north: _Floats, width: _Floats, density: _Floats) -> float:
    probability, _ = _normalised(density, width)
    margin, half = 0.99 * float(width.max()), 0.5 * width
    border = np.zeros(len(east), bool)
    for axis in (east, north):
        low, high = float((axis - half).min()), float((axis + half).max())
        border |= (axis - low < margin) | (high - axis < margin)
    return float(probability[border].sum())


def _refined(axis: _Floats, values: _Floats, top: int) -> float:
    if 0 < top < len(axis) - 1:
        left, middle, right = values[top - 1], values[top], values[top + 1]
        bend = 2.0 * middle - left - right
        if bend > 1e-12:
            shift = float(np.clip(0.5 * (right - left) / bend, -0.5, 0.5))
            return float(axis[top] + shift * (axis[1] - axis[0]))
    return float(axis[top])
