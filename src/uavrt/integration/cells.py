"""Cells of the ground around a flight: their probability, and credible regions."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from uavrt.integration.places import east_north
from uavrt.integration.tuning import PLACE
from uavrt.tangent_plane import TangentPlane
from uavrt.units import wrap_degrees_180, wrap_degrees_360

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One of the places where a tag may be."""

    latitude_deg: float
    longitude_deg: float
    radius95_m: float
    """Radius that holds 95 % of this part's probability [m]."""
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """Parts of the ground around the middle of a flight, and how likely the tag is in each."""

    plane: TangentPlane
    bearing_deg: _Floats
    """(cells,) middles."""
    range_m: _Floats
    width_deg: _Floats
    ratio: _Floats
    """Ratio of a cell's outer radius to its inner one."""
    probability: _Floats
    by_fall: _Floats
    """Probability for each fall with distance, (falls, cells)."""

    @property
    def area(self) -> _Floats:
        """Relative area, (cells,)."""
        return _area(self.range_m, self.width_deg, self.ratio)

    def region(self, share: float) -> NDArray[np.bool_]:
        """Cells that hold a share of the probability, whichever fall with distance is true.

        For each fall they are the smallest such region. After one pass the falls cannot be
        distinguished, and a joint region would ignore the less probable ones.
        """
        area = self.area
        inside = np.zeros(len(area), bool)
        for probability in self.by_fall:
            order = np.argsort(-probability / area, kind="stable")
            before = np.cumsum(probability[order]) - probability[order]
            inside[order[before < share]] = True
        return inside

    def holds(self, east_m: float, north_m: float, share: float) -> bool:
        """Whether a place is in that region."""
        bearing = np.degrees(np.arctan2(east_m, north_m))
        turn_deg = np.abs(wrap_degrees_180(self.bearing_deg - bearing))
        apart = np.abs(np.log(np.hypot(east_m, north_m) / self.range_m))
        here = (turn_deg <= 0.5 * self.width_deg) & (apart <= 0.5 * np.log(self.ratio))
        return bool((here & self.region(share)).any())

    def outlines(self, share: float) -> list[list[tuple[float, float]]]:
        """Latitudes and longitudes around each part of a region, by rings."""
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

    def parts(self, share: float = 0.95) -> "list[Part]":
        """Connected parts of a region, the likeliest first."""
        inside = np.flatnonzero(self.region(share))
        found = [self._part(cells) for cells in self._connected(inside)]
        return sorted(found, key=lambda one: -one.probability)

    def _connected(self, inside: NDArray[np.intp]) -> list[NDArray[np.intp]]:
        """Group connected cells."""
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
        """The likeliest place in some cells, from the middle of the flight.

        It is the mean where the probability is densest. The mean of all lies farther away than
        the tag, because large distances are less certain, above all next to a straight path,
        where each fall with distance has its own.
        """
        area = self.area[cells]
        density = self.probability[cells] / area
        weight = area * (density / density.max()) ** PLACE.density_power
        weight /= weight.sum()
        east, north = east_north(self.bearing_deg[cells], self.range_m[cells])
        return float(weight @ east), float(weight @ north)

    def middle_m(self) -> tuple[float, float]:
        """Place of a tag in a single part of the ground; else the middle of all cells."""
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
        """Radii of circles around a place that hold shares of the probability.

        Each cell's is spread evenly over its ground, as in `region`: a single cell would have
        no radius otherwise.

        `east_m`, `north_m`: from the middle of the flight. `cells`: the share is of these; by
        default of all.
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
        """Width of the arc around a bearing that holds a share of the probability."""
        # Each cell's probability lies evenly over its width.
        away = np.abs(wrap_degrees_180(self.bearing_deg - middle_deg)) - 0.5 * self.width_deg

        def held(tenth: int) -> float:
            within = np.clip((0.1 * tenth - away) / self.width_deg, 0.0, 1.0)
            return float(within @ self.probability)

        return 0.2 * bisect_left(range(1799), share, key=held)


def _runs(bearings_deg: _Floats, step_deg: float) -> list[tuple[float, float]]:
    """First and last of consecutive bearings."""
    cuts = np.flatnonzero(np.diff(bearings_deg) > 1.5 * step_deg) + 1
    return [(float(one[0]), float(one[-1])) for one in np.split(bearings_deg, cuts)]


def _area(range_m: _Floats, width_deg: _Floats, ratio: _Floats) -> _Floats:
    """Relative area of cells, whose depth is a ratio of distances."""
    return np.asarray(range_m**2 * width_deg * np.sinh(np.log(ratio)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LikelyGround:
    """Cells of the ground, and the likelihoods at their middles."""

    bearing_deg: _Floats
    """(cells,) as of `Cells`."""
    range_m: _Floats
    width_deg: _Floats
    ratio: _Floats
    uneven: _Floats
    """Difference of log likelihoods among the parts of each cell's parent."""
    logs: _Floats
    """(falls, cells) over all levels."""
    level_db: _Floats
    """(falls, cells) mean level."""

    @property
    def area(self) -> _Floats:
        """(cells,) ground, relative."""
        return _area(self.range_m, self.width_deg, self.ratio)

    @property
    def held(self) -> _Floats:
        """Probabilities, in that shape."""
        held = np.exp(self.logs - self.logs.max()) * self.area
        return np.asarray(held / held.sum())

    def to_part(self) -> NDArray[np.intp]:
        """Cells to divide: those that hold nearly all, and the likeliest.

        Only where the likelihood varies, and the cells are wide enough.
        """
        probability = self.held.sum(axis=0)
        order = np.argsort(-probability, kind="stable")
        count = int(np.searchsorted(np.cumsum(probability[order]), PLACE.kept)) + 1
        likeliest = np.argsort(-self.logs.max(axis=0), kind="stable")[: PLACE.always_divided]
        which = np.union1d(order[: min(count, PLACE.most_divided)], likeliest)
        size_m = self.range_m * np.maximum(np.radians(self.width_deg), np.log(self.ratio))
        large, uneven = size_m[which] > PLACE.finest_m, self.uneven[which] > PLACE.even_log
        return np.asarray(which[large & uneven])

    def parts(self, which: NDArray[np.intp]) -> "LikelyGround":
        """Divide some cells; the parts have no likelihoods yet."""
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
        """Replace cells by their parts."""
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
