"""Compute a tag's probability in cells of the ground around a flight, and credible regions."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse, spatial
from scipy.sparse import csgraph

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.units import wrap_degrees_180, wrap_degrees_360
from uavrt.localization.tuning import FLIGHT
from uavrt.localization.whole_flight.tag_places import east_north
from uavrt.localization.whole_flight.tuning import PLACE

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """Connected part of a credible region."""

    latitude_deg: float
    longitude_deg: float
    radius95_m: float
    """Radius of the circle that contains 95 % of the probability of this part of a region
    [m]."""
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """Cells of the ground around the middle of a flight, with the tag's probability in each."""

    plane: TangentPlane
    bearing_deg: _Floats
    """Bearings of the cells' middles from the middle of the flight [deg], shape (cells,)."""
    range_m: _Floats
    width_deg: _Floats
    ratio: _Floats
    """Ratio of a cell's outer radius to its inner radius, shape (cells,)."""
    probability: _Floats
    by_fall: _Floats
    """Joint probability of a path loss exponent and a ground cell, shape (exponents, cells)."""

    @property
    def area(self) -> _Floats:
        """Relative area of each cell, shape (cells,)."""
        return _area(self.range_m, self.width_deg, self.ratio)

    def region(self, share: float) -> NDArray[np.bool_]:
        """True for cells of the region that contains `share`, whichever path loss exponent is
        true, shape (cells,).

        It is the union of each exponent's smallest regions of one common probability, so that
        the union contains `share`. After a single pass of the tag, the exponents cannot be
        distinguished, and the smallest joint region would ignore the less probable ones.
        """
        least = np.ones(len(self.range_m))
        for probability in self.by_fall:
            order = np.argsort(-probability / self.area, kind="stable")
            before = np.cumsum(probability[order]) - probability[order]
            least[order] = np.minimum(least[order], before)
        order = np.argsort(least, kind="stable")
        reached = int(np.searchsorted(np.cumsum(self.probability[order]), share))
        return np.asarray(least <= least[order[min(reached, len(order) - 1)]])

    def holds(self, east_m: float, north_m: float, share: float) -> bool:
        """True if a position is in the region that contains the probability `share`."""
        bearing = np.degrees(np.arctan2(east_m, north_m))
        turn_deg = np.abs(wrap_degrees_180(self.bearing_deg - bearing))
        apart = np.abs(np.log(np.hypot(east_m, north_m) / self.range_m))
        here = (turn_deg <= 0.5 * self.width_deg) & (apart <= 0.5 * np.log(self.ratio))
        return bool((here & self.region(share)).any())

    def outlines(self, share: float) -> list[list[tuple[float, float]]]:
        """Outlines, as rings of latitudes and longitudes, around each part of a region."""
        inside = self.region(share)
        parts = []
        keys = np.stack((np.log(self.range_m), np.log(self.ratio), self.width_deg), axis=1)
        for key in np.unique(np.round(keys[inside], 6), axis=0):
            ring = inside & np.all(np.abs(keys - key) < 1e-5, axis=1)
            half = 0.5 * key[2]
            near, far = np.exp(key[0] - 0.5 * key[1]), np.exp(key[0] + 0.5 * key[1])
            for low, high in _runs(np.sort(self.bearing_deg[ring]), key[2]):
                around = np.arange(low - half, high + half + 1e-6, half)
                bearing = np.concatenate((around, around[::-1], around[:1]))
                distance = np.concatenate(
                    (np.full(len(around), far), np.full(len(around), near), [far])
                )
                latitude, longitude = self.plane.to_geodetic(*east_north(bearing, distance))
                parts.append(list(zip(latitude.tolist(), longitude.tolist(), strict=True)))
        return parts

    def parts(self) -> "list[Part]":
        """Connected parts of the 95 % region, the most probable first."""
        inside = np.flatnonzero(self.region(0.95))
        found = [self._part(cells) for cells in self._connected(inside)]
        return sorted(found, key=lambda one: -one.probability)

    def _connected(self, inside: NDArray[np.intp]) -> list[NDArray[np.intp]]:
        bearing, half = self.bearing_deg[inside], 0.5 * self.width_deg[inside]
        away, deep = np.log(self.range_m[inside]), 0.5 * np.log(self.ratio[inside])
        pairs = []
        rows = PLACE.pair_rows  # All pairs at once would fill the memory.
        for low in range(0, len(inside), rows):
            some = np.s_[low : low + rows, np.newaxis]
            turn_deg = np.abs(wrap_degrees_180(bearing[some] - bearing))
            touching = turn_deg <= 1.01 * (half[some] + half)
            touching &= np.abs(away[some] - away) <= 1.01 * (deep[some] + deep)
            row, column = np.nonzero(touching)
            pairs.append((row + low, column))
        row, column = (np.concatenate(one) for one in zip(*pairs, strict=True))
        graph = sparse.coo_array((np.ones(len(row), bool), (row, column)), (len(inside),) * 2)
        count, which = csgraph.connected_components(graph, directed=False)
        return [inside[which == number] for number in range(count)]

    def _part(self, cells: NDArray[np.intp]) -> "Part":
        east, north = self.likeliest_m(cells)
        (radius95,) = self.radii_m(east, north, (0.95,), cells)
        latitude, longitude = self.plane.to_geodetic(east, north)
        return Part(
            latitude_deg=float(latitude),
            longitude_deg=float(longitude),
            radius95_m=radius95,
            probability=float(self.probability[cells].sum()),
        )

    def likeliest_m(self, cells: NDArray[np.intp]) -> tuple[float, float]:
        """East and north of the most likely position in some cells, relative to the flight's
        middle [m].

        It is a mean with most weight where the probability is densest. The plain mean of all
        cells would be farther away than the tag, because large distances are less certain. Next
        to a straight path each path loss exponent gives another distance.
        """
        area = self.area[cells]
        density = self.probability[cells] / area
        weight = area * (density / density.max()) ** PLACE.density_power
        weight /= weight.sum()
        east, north = east_north(self.bearing_deg[cells], self.range_m[cells])
        return float(weight @ east), float(weight @ north)

    def densest_m(self) -> tuple[float, float]:
        """East and north of the cell with the highest probability density [m]."""
        best = [int(np.argmax(self.probability / self.area))]
        east, north = east_north(self.bearing_deg[best], self.range_m[best])
        return float(east[0]), float(north[0])

    def middle_m(self) -> tuple[float, float]:
        """East and north of the most likely point of a dominant part [m]; without such a part,
        of the mean.
        """
        inside = np.flatnonzero(self.region(0.95))
        for part in self._connected(inside):
            if self.probability[part].sum() >= PLACE.alone:
                return self.likeliest_m(part)
        east, north = east_north(self.bearing_deg, self.range_m)
        return float(self.probability @ east), float(self.probability @ north)

    def radii_m(
        self,
        east_m: float,
        north_m: float,
        shares: Sequence[float],
        cells: NDArray[np.intp] | None = None,
    ) -> list[float]:
        """Radii of the circles around a position that contain given probabilities [m].

        Each cell's probability is spread evenly over its ground, as in `region`.
        """
        chosen = slice(None) if cells is None else cells
        parts = (np.arange(PLACE.points) + 0.5) / PLACE.points
        around, apart = (one.ravel() for one in np.meshgrid(parts - 0.5, parts))
        bearing = self.bearing_deg[chosen, np.newaxis]
        bearing = bearing + around * self.width_deg[chosen, np.newaxis]
        ratio = self.ratio[chosen, np.newaxis]
        # Evenly over the ground: squares of distances are even from the nearer border on.
        square = self.range_m[chosen, np.newaxis] ** 2 * ((1.0 - apart) / ratio + apart * ratio)
        east, north = east_north(bearing, np.sqrt(square))
        away = np.hypot(east - east_m, north - north_m).ravel()
        held = np.repeat(self.probability[chosen], len(around))
        order = np.argsort(away)
        sums = np.cumsum(held[order])
        last = np.searchsorted(sums, np.asarray(shares) * sums[-1])
        return [float(one) for one in away[order][np.minimum(last, len(order) - 1)]]

    def arc_deg(self, middle_deg: float, share: float) -> float:
        """Width of the arc around a bearing that contains a given probability [deg]."""
        # Each cell's probability lies evenly over its width.
        away = np.abs(wrap_degrees_180(self.bearing_deg - middle_deg)) - 0.5 * self.width_deg

        def held(tenth: int) -> float:
            within = np.clip((0.1 * tenth - away) / self.width_deg, 0.0, 1.0)
            return float(within @ self.probability)

        return 0.2 * bisect_left(range(1799), share, key=held)


def _runs(bearings_deg: _Floats, step_deg: float) -> list[tuple[float, float]]:
    cuts = np.flatnonzero(np.diff(bearings_deg) > 1.5 * step_deg) + 1
    return [(float(one[0]), float(one[-1])) for one in np.split(bearings_deg, cuts)]


def _area(range_m: _Floats, width_deg: _Floats, ratio: _Floats) -> _Floats:
    return np.asarray(range_m**2 * width_deg * np.sinh(np.log(ratio)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LikelyGround:
    """Cells of the ground, with likelihoods at their middles; likely cells are divided."""

    bearing_deg: _Floats
    """Bearings of the cells' middles from the middle of the flight [deg], shape (cells,)."""
    range_m: _Floats
    width_deg: _Floats
    ratio: _Floats
    uneven: _Floats
    """Range of log-likelihood among the parts of the cell from which each cell was divided
    last, shape (cells,)."""
    logs: _Floats
    """Log-likelihood by path loss exponent, integrated over tag levels, shape (exponents,
    cells)."""
    level_db: _Floats
    """Mean level of the tag [dB] by path loss exponent, shape (exponents, cells)."""

    @property
    def area(self) -> _Floats:
        """Relative area of each cell, shape (cells,)."""
        return _area(self.range_m, self.width_deg, self.ratio)

    @property
    def held(self) -> _Floats:
        """Posterior probability of a path loss exponent and a cell, shape (exponents,
        cells).
        """
        held = np.exp(self.logs - self.logs.max()) * self.area
        return np.asarray(held / held.sum())

    @property
    def shifted(self) -> _Floats:
        """Probability as in `held`, with an error common to all positions of the drone.

        Each cell's probability is spread by a normal distribution over the cells around it.
        Cells that are wider than the distribution keep it.
        """
        sigma_m = FLIGHT.place_sigma_m
        tree = spatial.KDTree(np.stack(east_north(self.bearing_deg, self.range_m), axis=1))
        near = tree.sparse_distance_matrix(tree, 4.0 * sigma_m, output_type="coo_matrix")
        weight = np.exp(-0.5 * (near.data / sigma_m) ** 2) * self.area[near.col]
        spread = sparse.csr_array((weight, (near.row, near.col)), shape=near.shape)
        each: _Floats = np.asarray(spread.sum(axis=1))
        return np.asarray((self.held / each) @ spread)

    def to_part(self) -> NDArray[np.intp]:
        """Indices of the cells that must be divided: wide, uneven and likely cells."""
        probability = self.held.sum(axis=0)
        order = np.argsort(-probability, kind="stable")
        count = int(np.searchsorted(np.cumsum(probability[order]), PLACE.kept)) + 1
        likeliest = np.argsort(-self.logs.max(axis=0), kind="stable")[: PLACE.always_divided]
        which = np.union1d(order[: min(count, PLACE.most_divided)], likeliest)
        size_m = self.range_m * np.maximum(np.radians(self.width_deg), np.log(self.ratio))
        large, uneven = size_m[which] > PLACE.finest_m, self.uneven[which] > PLACE.even_log
        return np.asarray(which[large & uneven])

    def parts(self, which: NDArray[np.intp]) -> "LikelyGround":
        """Divide some cells; the resulting parts have no likelihoods yet."""
        steps = (np.arange(PLACE.parts) - 0.5 * (PLACE.parts - 1)) / PLACE.parts
        around, apart = (one.ravel() for one in np.meshgrid(steps, steps))
        width, ratio = self.width_deg[which, np.newaxis], self.ratio[which, np.newaxis]
        bearing = self.bearing_deg[which, np.newaxis] + around * width
        distance = self.range_m[which, np.newaxis] * ratio**apart
        return LikelyGround(
            bearing_deg=wrap_degrees_360(bearing.ravel()),
            range_m=distance.ravel(),
            width_deg=np.repeat(width / PLACE.parts, len(around)),
            ratio=np.repeat(ratio ** (1.0 / PLACE.parts), len(around)),
            uneven=np.zeros(distance.size),
            logs=np.zeros((len(self.logs), distance.size)),
            level_db=np.zeros((len(self.logs), distance.size)),
        )

    def with_parts(self, which: NDArray[np.intp], parts: "LikelyGround") -> "LikelyGround":
        """Return a copy in which the divided cells are replaced by their parts."""
        rest = np.setdiff1d(np.arange(len(self.range_m)), which)
        best = parts.logs.max(axis=0).reshape(len(which), PLACE.parts * PLACE.parts)
        uneven = np.repeat(np.ptp(best, axis=1), PLACE.parts * PLACE.parts)
        return LikelyGround(
            bearing_deg=np.concatenate((parts.bearing_deg, self.bearing_deg[rest])),
            range_m=np.concatenate((parts.range_m, self.range_m[rest])),
            width_deg=np.concatenate((parts.width_deg, self.width_deg[rest])),
            ratio=np.concatenate((parts.ratio, self.ratio[rest])),
            uneven=np.concatenate((uneven, self.uneven[rest])),
            logs=np.concatenate((parts.logs, self.logs[:, rest]), axis=1),
            level_db=np.concatenate((parts.level_db, self.level_db[:, rest]), axis=1),
        )
