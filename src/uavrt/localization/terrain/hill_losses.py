"""Compute losses behind hills between a flight and possible tag positions, and cache them.

The losses from one drone position to all squares of the ground are computed together
(`uavrt.localization.terrain.viewshed`) and cached, since position estimates need the losses to
ten thousand positions for every pulse. Drone positions are rounded to a lattice as fine as the
squares. It is coarser for a flight with too many positions, which limits the computing time.
"""

from collections import OrderedDict
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.localization.terrain.elevation import Elevation
from uavrt.localization.terrain.squares import GroundGrid, ground_grid
from uavrt.localization.terrain.viewshed import terrain_loss_map

_Floats = NDArray[np.floating[Any]]
TAG_M = 0.5
"""Default height of a tag above the ground [m]."""
_LEAST_REACH_M = 500.0
_MOST_SIDE = 200
"""Maximum number of ground squares along each side of the terrain around the take-off."""
_ROUGH_SIDE = 64
"""Maximum number of ground squares along each side for rating candidate paths, at 1/30 of the
computing time."""
_FINEST_M = 15.0
_HEIGHT_STEP_M = 4.0
_LEAST_ABOVE_M = 1.0
_ROUGH_HEIGHT_STEP_M = 16.0
_MOST_PLACES = 100
"""Maximum number of drone positions for which losses are computed at once, 1.5 s on one
core."""
_ROUGH_MOST_PLACES = 40
_MOST_BYTES = 64_000_000
"""Maximum memory for cached maps of losses behind hills [bytes]."""

_Node = tuple[int, int, int]
"""Lattice point of drone positions: metres east, north, and above the ground at the
take-off."""


class HillLosses:
    """Ground around a take-off, and the losses behind hills on it.

    Heights of the drone are relative to the ground at the take-off, as autopilots report them.
    East and north are relative to the take-off, or to the origin given to `in_plane`.
    `frequency_hz` is the tags' frequency, `tag_m` their height above the ground. `limitations`
    are sentences on where the losses are not valid; `cautions` adds gaps in the files.
    """

    def __init__(
        self,
        elevation: Elevation,
        *,
        latitude_deg: float,
        longitude_deg: float,
        frequency_hz: float = 150e6,
        tag_m: float = TAG_M,
        limitations: tuple[str, ...] = (),
    ) -> None:
        plane = TangentPlane(latitude_deg=latitude_deg, longitude_deg=longitude_deg)
        self._squares = _Squares(elevation, plane)
        self._rough = _Squares(
            elevation,
            plane,
            most_side=_ROUGH_SIDE,
            most_places=_ROUGH_MOST_PLACES,
            height_step_m=_ROUGH_HEIGHT_STEP_M,
        )
        self.frequency_hz, self.tag_m = frequency_hz, tag_m
        self.limitations = limitations
        self.origin_m = (0.0, 0.0)

    @property
    def start_amsl_m(self) -> float:
        """Height of the ground at the take-off above sea level [m]; NaN where unknown."""
        return self._squares.start_m

    def __eq__(self, other: object) -> bool:
        """True if all losses and limitations are equal and computed from the same ground
        object.
        """
        return isinstance(other, HillLosses) and self._state == other._state

    def __hash__(self) -> int:
        return hash(self._state)

    @property
    def _state(self) -> tuple[object, ...]:
        own = self.frequency_hz, self.tag_m, self.limitations, self.origin_m
        return self._squares, *own

    @property
    def level(self) -> bool:
        """True if level ground is assumed, because the height of the ground at the take-off is
        unknown.
        """
        return not np.isfinite(self._squares.start_m)

    def at(self, frequency_hz: float) -> "HillLosses":
        """Return losses for tags of another frequency, which share the cache."""
        other = copy(self)
        other.frequency_hz = frequency_hz
        return other

    def in_plane(self, plane: TangentPlane) -> "HillLosses":
        """Return losses whose coordinates have another origin nearby; its axes are assumed
        parallel.
        """
        other = copy(self)
        east, north = self._squares.plane.to_local(plane.latitude_deg, plane.longitude_deg)
        other.origin_m = (float(east), float(north))
        return other

    def rough(self) -> "HillLosses":
        """Return losses on squares three times as large, for the many positions of a plan."""
        other = copy(self)
        other._squares = self._rough  # noqa: SLF001 - of a copy of its own
        return other

    def with_limitations(self, *limitations: str) -> "HillLosses":
        """Copy with further limitations of the ground model."""
        other = copy(self)
        other.limitations = (*self.limitations, *limitations)
        return other

    def cover(self, east_m: ArrayLike, north_m: ArrayLike) -> None:
        """Extend the ground so that it includes the given positions. Raises `FormatError`."""
        here = self.origin_m
        self._squares.reach(
            float(np.max(np.abs(np.asarray(east_m) + here[0]))),
            float(np.max(np.abs(np.asarray(north_m) + here[1]))),
        )

    def cautions(self) -> tuple[str, ...]:
        """Sentences on where the elevation files are incomplete, and on other limitations."""
        if self.level:
            return (
                *self.limitations,
                "the elevation files do not cover the flight: the ground is assumed to be "
                "level",
            )
        unknown = self._squares.unknown_share
        if not unknown:
            return self.limitations
        return (
            *self.limitations,
            f"the elevation files have no height for {max(unknown, 0.001):.1%} of the ground "
            "around the flight; the nearest height is used there",
        )

    def rise_m(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """Height of the ground at positions relative to the ground at the take-off [m], for
        arrays of any shape.
        """
        if self.level:
            return np.zeros(np.shape(east_m))
        squares = self._squares
        there = squares.grid(
            np.asarray(east_m + self.origin_m[0], np.float64),
            np.asarray(north_m + self.origin_m[1], np.float64),
        )
        return np.asarray(there - squares.start_m)

    def seen_from(
        self, drone_east_m: _Floats, drone_north_m: _Floats, drone_up_m: _Floats
    ) -> "LossesFrom":
        """Return losses from drone positions (n,); heights are relative to the ground at the
        take-off.
        """
        if self.level:
            none = np.zeros((1, 2, 2), np.float32)
            which = np.zeros(np.size(drone_east_m), np.intp)
            return LossesFrom(maps=none, which=which, west_m=0.0, south_m=0.0, cell_m=1.0)
        # Each tag of a search requests the same paths in turn.
        asked = np.stack((drone_east_m, drone_north_m, drone_up_m)).astype(np.float64)
        of = (self.frequency_hz, self.tag_m, self.origin_m)
        last = self._squares.last
        if last is not None and last[0] == of and np.array_equal(last[1], asked):
            return last[2]
        seen = self._seen_from(drone_east_m, drone_north_m, drone_up_m)
        self._squares.last = (of, asked, seen)
        return seen

    def _seen_from(self, east_m: _Floats, north_m: _Floats, up_m: _Floats) -> "LossesFrom":
        nodes, which = self._nodes(east_m, north_m, up_m)
        maps = [self._squares.map(node, self.frequency_hz, self.tag_m) for node in nodes]
        grid = self._squares.grid
        return LossesFrom(
            maps=maps[0][np.newaxis] if len(maps) == 1 else np.stack(maps),
            which=which,
            west_m=grid.west_m - self.origin_m[0],
            south_m=grid.south_m - self.origin_m[1],
            cell_m=grid.cell_m,
        )

    def loss_db(
        self, drone: tuple[float, float, float], east_m: _Floats, north_m: _Floats
    ) -> NDArray[np.float32]:
        """Loss in addition to that of level ground, from a drone at (east, north, up) to tags
        [dB].
        """
        seen = self.seen_from(*(np.array([one]) for one in drone))
        return seen.between(np.intp(0), east_m, north_m)

    def _nodes(
        self, east_m: _Floats, north_m: _Floats, up_m: _Floats
    ) -> tuple[list[_Node], NDArray[np.intp]]:
        """Return lattice points for drone positions, and for each position the index of the
        nearest point.
        """
        east, north = east_m + self.origin_m[0], north_m + self.origin_m[1]
        self._squares.reach(float(np.max(np.abs(east))), float(np.max(np.abs(north))))
        reach, coarser = self._squares.reach_m, 1.0
        while True:
            cell, height = self._squares.grid.cell_m, self._squares.height_step_m
            steps = coarser * np.array([cell, cell, height])
            lattice = np.rint(np.stack((east, north, up_m), axis=1) / steps) * steps
            lattice[:, :2] = np.clip(lattice[:, :2], -reach, reach)
            whole = np.rint(lattice).astype(np.int64)
            nodes, which = np.unique(whole, axis=0, return_inverse=True)
            if len(nodes) <= self._squares.most_places:
                found = [(int(e), int(n), int(u)) for e, n, u in nodes]
                return found, np.asarray(which, np.intp).ravel()
            coarser *= 2.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LossesFrom:
    """Losses from several drone positions to any tag position."""

    maps: NDArray[np.float32]
    """Loss from each lattice point to the ground squares [dB], shape (lattice, rows,
    columns)."""
    which: NDArray[np.intp]
    """Index of the lattice point (first axis of `maps`) nearest to each drone position, shape
    (n,)."""
    west_m: float
    south_m: float
    cell_m: float

    def __call__(self, east_m: _Floats, north_m: _Floats) -> NDArray[np.float32]:
        """Losses from the n drone positions to tag positions (places,) [dB], shape (places,
        n).
        """
        lattice = np.arange(len(self.maps))[np.newaxis]
        each = self.between(lattice, east_m[:, np.newaxis], north_m[:, np.newaxis])
        return np.asarray(each[:, self.which])

    def between(
        self, lattice: NDArray[np.intp] | np.intp, east_m: _Floats, north_m: _Floats
    ) -> NDArray[np.float32]:
        """Losses from lattice points to tag positions [dB], of broadcastable shapes."""
        _, rows, columns = self.maps.shape
        single = np.float32
        c = np.asarray((east_m - self.west_m) / self.cell_m, single)
        r = np.asarray((north_m - self.south_m) / self.cell_m, single)
        c = np.clip(c, single(0.0), single(columns - 1))
        r = np.clip(r, single(0.0), single(rows - 1))
        left = np.minimum(c.astype(np.int32), columns - 2)
        low = np.minimum(r.astype(np.int32), rows - 2)
        flat = self.maps.ravel()
        first = lattice * (rows * columns) + low * columns + left
        c, r = c - left, r - low
        south = flat[first] * (1 - c) + flat[first + 1] * c
        north = flat[first + columns] * (1 - c) + flat[first + columns + 1] * c
        return np.asarray(south * (1 - r) + north * r, single)


class _Squares:
    def __init__(
        self,
        elevation: Elevation,
        plane: TangentPlane,
        *,
        most_side: int = _MOST_SIDE,
        most_places: int = _MOST_PLACES,
        height_step_m: float = _HEIGHT_STEP_M,
    ) -> None:
        self._elevation, self.plane, self._most_side = elevation, plane, most_side
        self.most_places, self.height_step_m = most_places, height_step_m
        at = elevation.heights_m([plane.latitude_deg], [plane.longitude_deg])
        self.start_m = float(at[0])
        self.reach_m = 0.0
        self._grid: GroundGrid | None = None
        self._maps: OrderedDict[tuple[int, ...], NDArray[np.float32]] = OrderedDict()
        self.last: tuple[tuple[object, ...], _Floats, LossesFrom] | None = None
        """Tag height, drone positions and result of the last call."""

    @property
    def grid(self) -> GroundGrid:
        if self._grid is None:
            self.reach(0.0, 0.0)
        assert self._grid is not None
        return self._grid

    @property
    def unknown_share(self) -> float:
        return 0.0 if self._grid is None else self._grid.unknown_share

    def reach(self, east_m: float, north_m: float) -> None:
        """Extend the ground to at least these distances on all sides."""
        needed = max(max(east_m, north_m) + _FINEST_M, _LEAST_REACH_M)
        if needed <= self.reach_m or not np.isfinite(self.start_m):
            return
        # In steps of the root of two, so that a growing flight is not gridded at each pulse.
        steps = np.ceil(2.0 * np.log2(needed / _LEAST_REACH_M))
        self.reach_m = reach = float(_LEAST_REACH_M * 2.0 ** (0.5 * steps))
        self._grid = ground_grid(
            self._elevation,
            self.plane,
            west_m=-reach,
            east_m=reach,
            south_m=-reach,
            north_m=reach,
            cell_m=max(2.0 * reach / self._most_side, _FINEST_M),
        )
        self._maps.clear()
        self.last = None

    def map(self, node: _Node, frequency_hz: float, tag_m: float) -> NDArray[np.float32]:
        key = (*node, round(frequency_hz / 2e6), round(tag_m * 10.0))
        known = self._maps.get(key)
        if known is not None:
            self._maps.move_to_end(key)
            return known
        east, north, up = (float(one) for one in node)
        beneath = float(self.grid(np.array([east]), np.array([north]))[0]) - self.start_m
        losses = terrain_loss_map(
            self.grid,
            east_m=east,
            north_m=north,
            antenna_m=max(up - beneath, _LEAST_ABOVE_M),
            tag_m=tag_m,
            frequency_hz=frequency_hz,
        )
        self._maps[key] = losses
        while len(self._maps) * losses.nbytes > _MOST_BYTES and len(self._maps) > 1:
            self._maps.popitem(last=False)
        return losses
