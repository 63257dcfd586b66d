"""Search areas, fences and excluded areas, and checks of paths against them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import PlanError
from uavrt.localization.position.bayes_fix import Area
from uavrt.planning.tuning import PLANNING

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]
Ground = Callable[[_Floats, _Floats], _Floats]
"""Function that returns the height of the ground [m] at (east, north) [m]; the reference height
is arbitrary."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle:
    """A circular area, which the drone must avoid or must not leave."""

    east_m: float
    north_m: float
    radius_m: float
    name: str = ""
    """Name of the circle, shown in error messages."""

    def __post_init__(self) -> None:
        if not self.radius_m > 0.0:
            raise PlanError(
                f"the keep-out circle has the invalid radius of {self.radius_m:g} m",
                remedy="Give a radius above 0, or leave the circle out",
            )

    def contains(self, east_m: _Floats, north_m: _Floats) -> _Flags:
        """True for positions inside the circle."""
        off = np.hypot(east_m - self.east_m, north_m - self.north_m)
        return np.asarray(off < self.radius_m)

    def off_m(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """Return the distance of each position from the circle [m]; 0 inside."""
        off = np.hypot(east_m - self.east_m, north_m - self.north_m) - self.radius_m
        return np.asarray(np.maximum(off, 0.0))

    def path_distance_m(
        self, start_m: tuple[float, float], east_m: _Floats, north_m: _Floats
    ) -> _Floats:
        """Return the distance of straight paths from the circle [m]; 0 if they cross it."""
        off = _off_segment_m(self.east_m, self.north_m, start_m, (east_m, north_m))
        return np.asarray(np.maximum(off - self.radius_m, 0.0))

    def depth_m(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """Distance of positions from the circle's edge [m], positive inside."""
        off = np.hypot(east_m - self.east_m, north_m - self.north_m)
        return np.asarray(self.radius_m - off)

    def path_depth_m(
        self, start_m: tuple[float, float], east_m: _Floats, north_m: _Floats
    ) -> _Floats:
        """Shortest distance from the circle's edge to the ends of straight paths [m], positive
        if both ends are inside.
        """
        start = self.depth_m(*np.array([start_m]).T)
        return np.asarray(np.minimum(self.depth_m(east_m, north_m), start))


@dataclass(frozen=True, slots=True, kw_only=True)
class Polygon:
    """Outline of an area, whose sides must not cross each other.

    Raises `PlanError` for fewer than three corners, sides that cross, or hardly any area.
    """

    corners: tuple[tuple[float, float], ...]
    """East and north of each corner [m]; the last corner is joined to the first."""
    name: str = "polygon"
    """Name of the polygon, shown in error messages."""

    def __post_init__(self) -> None:
        if len(self.corners) < 3 or not np.all(np.isfinite(self.corners)):
            raise PlanError(
                f"the {self.name} needs three or more corners with finite coordinates",
                remedy="Draw the corners again",
            )
        crossing = self._crossing()
        if crossing is not None:
            first, second = crossing
            raise PlanError(
                f"the {self.name} crosses itself: its sides {first + 1} and {second + 1}",
                remedy="Draw the corners in their order along the outline",
            )
        if self.area_m2 < PLANNING.least_area_m2:
            raise PlanError(
                f"the {self.name} is too small: {self.area_m2:.0f} m²",
                remedy=f"Draw an area of {PLANNING.least_area_m2:.0f} m² or more",
            )

    @classmethod
    def rectangle(
        cls, west_m: float, east_m: float, south_m: float, north_m: float, name: str = "polygon"
    ) -> "Polygon":
        """Return the outline of a rectangle with sides along east and north."""
        corners = ((west_m, south_m), (east_m, south_m), (east_m, north_m), (west_m, north_m))
        return cls(corners=corners, name=name)

    @property
    def area_m2(self) -> float:
        """Area inside the outline [m²]."""
        x, y = np.array(self.corners).T
        return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0)

    @property
    def box(self) -> Area:
        """Smallest rectangle with sides along east and north that contains the outline."""
        x, y = np.array(self.corners).T
        return Area(
            west_m=float(x.min()),
            east_m=float(x.max()),
            south_m=float(y.min()),
            north_m=float(y.max()),
        )

    def _crossing(self) -> tuple[int, int] | None:
        """Return two sides that cross or touch but are not adjacent; None without any."""
        points = np.array(self.corners, np.float64)
        count = len(points)
        for first in range(count):
            for second in range(first + 1, count):
                near = second == first + 1 or (first == 0 and second == count - 1)
                sides = (
                    points[first],
                    points[(first + 1) % count],
                    points[second],
                    points[(second + 1) % count],
                )
                if (_overlap if near and count > 2 else _meet)(*sides):
                    return first, second
        return None

    def contains(self, east_m: _Floats, north_m: _Floats) -> _Flags:
        """True for positions inside the outline: a ray to the east crosses an odd number of
        sides.
        """
        x, y = np.asarray(east_m, np.float64), np.asarray(north_m, np.float64)
        inside = np.zeros(np.broadcast_shapes(x.shape, y.shape), bool)
        points = np.array(self.corners, np.float64)
        for (ax, ay), (bx, by) in zip(points, np.roll(points, -1, axis=0), strict=True):
            if ay == by:
                continue
            between = (ay > y) != (by > y)
            inside ^= between & (x < ax + (y - ay) / (by - ay) * (bx - ax))
        return inside

    @property
    def _sides(self) -> list[tuple[tuple[float, float], tuple[float, float]]]:
        return list(zip(self.corners, (*self.corners[1:], self.corners[0]), strict=True))

    def off_m(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """Return the distance of each position from the polygon [m]; 0 inside."""
        off = np.min([_off_segment_m(east_m, north_m, *side) for side in self._sides], axis=0)
        return np.asarray(np.where(self.contains(east_m, north_m), 0.0, off))

    def path_distance_m(
        self, start_m: tuple[float, float], east_m: _Floats, north_m: _Floats
    ) -> _Floats:
        """Return the distance of straight paths from the polygon [m]; 0 if they cross it."""
        edge = self._edge_distance_m(start_m, east_m, north_m)
        start = self.contains(*np.array([start_m]).T)
        return np.asarray(np.where(self.contains(east_m, north_m) | start, 0.0, edge))

    def depth_m(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """Return how far inside the polygon each position is [m]; 0 outside."""
        off = np.min([_off_segment_m(east_m, north_m, *side) for side in self._sides], axis=0)
        return np.asarray(np.where(self.contains(east_m, north_m), off, 0.0))

    def path_depth_m(
        self, start_m: tuple[float, float], east_m: _Floats, north_m: _Floats
    ) -> _Floats:
        """Shortest distance from the outline to straight paths inside it [m]; 0 for paths with
        an end outside.
        """
        edge = self._edge_distance_m(start_m, east_m, north_m)
        start = self.contains(*np.array([start_m]).T)
        return np.asarray(np.where(self.contains(east_m, north_m) & start, edge, 0.0))

    def _edge_distance_m(
        self, start_m: tuple[float, float], east_m: _Floats, north_m: _Floats
    ) -> _Floats:
        """Shortest distance of straight paths from the outline [m]; 0 if a path crosses it."""
        end = (east_m, north_m)
        off = [segment_distance_m(start_m, end, side) for side in self._sides]
        return np.asarray(np.min(off, axis=0))


_Place = tuple[float | _Floats, float | _Floats]


def _turn(a: _Place, b: _Place, c: _Place) -> _Floats:
    """Twice the signed area of the triangle a, b, c [m²]: positive if the path from a over b to
    c turns left.
    """
    return np.asarray((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _off_segment_m(x: float | _Floats, y: float | _Floats, a: _Place, b: _Place) -> _Floats:
    """Return the distance of each position from a line segment [m]."""
    along_x, along_y = b[0] - a[0], b[1] - a[1]
    length2 = np.maximum(along_x**2 + along_y**2, 1e-9)
    share = np.clip(((x - a[0]) * along_x + (y - a[1]) * along_y) / length2, 0.0, 1.0)
    return np.asarray(np.hypot(x - a[0] - share * along_x, y - a[1] - share * along_y))


def segment_distance_m(start: _Place, end: _Place, side: tuple[_Place, _Place]) -> _Floats:
    """Smallest distance of each straight path from a line segment [m]; 0 if they cross."""
    a, b = side
    ends = _off_segment_m(*end, a, b), _off_segment_m(*start, a, b)
    corners = _off_segment_m(*a, start, end), _off_segment_m(*b, start, end)
    off = np.minimum(np.minimum(*ends), np.minimum(*corners))
    # Ends on both sides of each other's lines: they cross.
    turns = _turn(a, b, start) * _turn(a, b, end), _turn(start, end, a) * _turn(start, end, b)
    return np.asarray(np.where((turns[0] < 0.0) & (turns[1] < 0.0), 0.0, off))


def _side(a: _Floats, b: _Floats, c: _Floats) -> float:
    return float(_turn((a[0], a[1]), (b[0], b[1]), (c[0], c[1])))


def _meet(a: _Floats, b: _Floats, c: _Floats, d: _Floats) -> bool:
    one, two = _side(a, b, c), _side(a, b, d)
    three, four = _side(c, d, a), _side(c, d, b)
    if one * two < 0.0 and three * four < 0.0:
        return True
    return any(
        turn == 0.0 and bool(np.all(np.minimum(p, q) <= r) and np.all(r <= np.maximum(p, q)))
        for turn, p, q, r in ((one, a, b, c), (two, a, b, d), (three, c, d, a), (four, c, d, b))
    )


def _overlap(a: _Floats, b: _Floats, c: _Floats, d: _Floats) -> bool:
    if np.array_equal(a, b) or np.array_equal(c, d):
        return True
    meeting, before, after = (b, a, d) if np.array_equal(b, c) else (a, b, c)
    straight = _side(before, meeting, after) == 0.0
    return straight and float((before - meeting) @ (after - meeting)) > 0.0


def flat_ground(east_m: _Floats, north_m: _Floats) -> _Floats:
    """Return the height of level ground, 0 m at all positions."""
    return np.zeros(np.broadcast_shapes(np.shape(east_m), np.shape(north_m)))


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchArea:
    """Area in which the animals are, and limits within which the drone may fly.

    Raises `PlanError` if the area reaches beyond the fence, if the minimum height exceeds the
    maximum, or if home is outside.
    """

    search: Polygon
    fence: Polygon | None = None
    """Fence that the drone must stay inside; None means no limit."""
    excluded: tuple[Circle | Polygon, ...] = ()
    """Excluded areas that the drone must not enter."""
    within: tuple[Circle | Polygon, ...] = ()
    """Areas that the drone must not leave, on the way out and on its return."""
    margin_m: float = 0.0
    """Distance kept from fence and excluded areas [m], for gusts and wide turns."""
    straight_home: bool = False
    """True if the straight return home from any position must also avoid the excluded areas."""
    lowest_m: float = 20.0
    """Minimum height of the drone above the ground below it [m]."""
    highest_m: float = 120.0
    ground: Ground = flat_ground
    ground_home: Ground | None = None
    """Function that returns the height of the highest ground along the straight return from
    given positions [m]."""
    home_m: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not 0.0 < self.lowest_m < self.highest_m:
            raise PlanError(
                f"the heights {self.lowest_m:g} to {self.highest_m:g} m are invalid",
                remedy="Give a lower and a higher height, both above 0",
            )
        if self.fence is None:
            return
        corners = np.array(self.search.corners)
        within = self.fence.contains(*_nudged(corners).T)
        if not np.all(within):
            outside = [str(n + 1) for n in np.flatnonzero(~within)]
            named, more = (
                ", ".join(outside[: PLANNING.listed_corners]),
                len(outside) - PLANNING.listed_corners,
            )
            named = f"s {named}" if len(outside) > 1 else f" {named}"
            named += f" and {more} more" if more > 0 else ""
            raise PlanError(
                f"the {self.search.name} lies beyond the fence at its corner{named}",
                remedy="Draw it inside, or widen the fence",
            )
        if not self.fence.contains(*np.array([self.home_m]).T).all():
            raise PlanError(
                "home is outside the fence", remedy="Set home or the vehicle's fence again"
            )

    def check_home(self) -> None:
        """Raise `PlanError` if home lies where the drone cannot take off or return, such as in
        an excluded area.
        """
        home = np.array([self.home_m]).T
        for zone in self.excluded:
            if float(zone.off_m(*home)[0]) <= self.margin_m:
                raise PlanError(
                    f"home lies in or at the edge of {_named(zone)}",
                    remedy=f"Take off more than {self.margin_m:.0f} m from it",
                )
        for area in self.within:
            if float(area.depth_m(*home)[0]) <= self.margin_m:
                raise PlanError(
                    f"home lies outside of {_named_within(area)}, or too close to its edge",
                    remedy=f"Take off more than {self.margin_m:.0f} m inside its edge, "
                    "or redraw it",
                )

    def entered_area(self, east_m: _Floats, north_m: _Floats) -> str | None:
        """Reason why excluded areas forbid a path, or the return home from it; None if they do
        not.

        The path is given as points, the first of which is its start; the segments between
        points are also checked.
        """
        x, y = _close_points(east_m, north_m)
        here = float(east_m[0]), float(north_m[0])
        return next((reason for _, reason in self._entered_areas(x[None], y[None], here)), None)

    def _entered_areas(
        self, x: _Floats, y: _Floats, start_m: tuple[float, float]
    ) -> list[tuple[int, str]]:
        """Return the number of each path that enters an excluded area, with the reason.

        A drone that a gust has blown into the margin may leave the margin, but not come closer
        to the area.
        """
        found: list[tuple[int, str]] = []
        here = np.array([start_m]).T
        for zone in self.excluded:
            bad = zone.contains(x, y)
            if self.margin_m > 0.0:
                margin = min(self.margin_m, float(zone.off_m(*here)[0]))
                bad = bad | (zone.off_m(x, y) < margin - 1e-6)
            legs = np.flatnonzero(bad.any(axis=-1))
            found.extend((int(leg), f"the path enters {_named(zone)}") for leg in legs)
            if not self.straight_home:
                continue
            least = min(self.margin_m, float(zone.path_distance_m(self.home_m, *here)[0]))
            off = zone.path_distance_m(self.home_m, x, y)
            legs = np.flatnonzero((off < max(least - 1e-6, 1e-6)).any(axis=-1))
            found.extend((int(leg), f"the path leads home over {_named(zone)}") for leg in legs)
        for area in self.within:
            least = max(0.0, min(self.margin_m, float(area.depth_m(*here)[0])) - 1e-6)
            legs = np.flatnonzero((area.depth_m(x, y) <= least).any(axis=-1))
            found.extend((int(leg), f"the path leaves {_named_within(area)}") for leg in legs)
            deep = float(area.path_depth_m(self.home_m, *here)[0])
            least = max(0.0, min(self.margin_m, deep) - 1e-6)
            off = area.path_depth_m(self.home_m, x, y)
            legs = np.flatnonzero((off <= least).any(axis=-1))
            found.extend(
                (int(leg), f"the path leads home out of {_named_within(area)}") for leg in legs
            )
        return found

    def refusal(
        self, east_m: _Floats, north_m: _Floats, height_m: _Floats | float
    ) -> str | None:
        """Reason why a path must not be flown at a height above home; None if it may.

        The path is given as points; the segments between them are also checked.
        """
        x, y = _close_points(east_m, north_m)
        here = float(east_m[0]), float(north_m[0])
        faults = self._faults(x[None], y[None], height_m, here)
        return next((reason for _, reason in faults), None)

    def refusals(
        self, state_m: tuple[float, float], east_m: _Floats, north_m: _Floats, height_m: float
    ) -> list[str | None]:
        """Reason why the straight path to each position must not be flown; None if it may."""
        longest = float(np.max(np.hypot(east_m - state_m[0], north_m - state_m[1]), initial=0))
        share = np.linspace(0.0, 1.0, max(2, int(np.ceil(longest / PLANNING.path_step_m)) + 1))[
            1:
        ]
        x = state_m[0] + (east_m - state_m[0])[:, None] * share
        y = state_m[1] + (north_m - state_m[1])[:, None] * share
        reasons: list[str | None] = [None] * len(east_m)
        for leg, reason in self._faults(x, y, height_m, state_m):
            reasons[leg] = reasons[leg] or reason
        return reasons

    def _faults(
        self, x: _Floats, y: _Floats, height_m: _Floats | float, start_m: tuple[float, float]
    ) -> list[tuple[int, str]]:
        """Return the number of each path that must not be flown, with the reason."""
        found: list[tuple[int, str]] = []

        def add(bad: _Flags, reason: str) -> None:
            found.extend((int(leg), reason) for leg in np.flatnonzero(bad.any(axis=-1)))

        if self.fence is not None:
            add(~self.fence.contains(x, y), "the path leaves the fence")
        found.extend(self._entered_areas(x, y, start_m))
        if self.ground is flat_ground:
            above = np.broadcast_to(height_m, x.shape)
        else:
            home = self.ground(*np.array([self.home_m]).T)
            above = height_m + float(home[0]) - self.ground(x, y)
        if self.ground_home is not None:
            home_above = height_m - self.ground_home(x, y)
            add(
                home_above < self.lowest_m - 1e-6,
                f"the path leads home below {self.lowest_m:g} m",
            )
        add(
            above < self.lowest_m - 1e-6,
            f"the path comes below {self.lowest_m:g} m above ground",
        )
        add(
            above > self.highest_m + 1e-6,
            f"the path goes above {self.highest_m:g} m above ground",
        )
        return found


def _named(void: Circle | Polygon) -> str:
    if void.name in ("", "polygon"):
        return "a keep-out area"
    return f"the keep-out {void.name!r}"


def _named_within(area: Circle | Polygon) -> str:
    return f"the {area.name or 'area to stay in'}"


def _nudged(corners: _Floats) -> _Floats:
    middle = corners.mean(axis=0)
    off = middle - corners
    return np.asarray(corners + 1e-3 * off / np.maximum(np.hypot(*off.T)[:, None], 1e-9))


def _close_points(east_m: _Floats, north_m: _Floats) -> tuple[_Floats, _Floats]:
    """Insert points into a path until they are at most `PLANNING.path_step_m` apart."""
    if len(east_m) < 2:
        return np.asarray(east_m, np.float64), np.asarray(north_m, np.float64)
    gone = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(east_m), np.diff(north_m)))])
    places = np.linspace(0.0, gone[-1], max(2, int(gone[-1] / PLANNING.path_step_m) + 2))
    places = np.union1d(places, gone)
    return np.interp(places, gone, east_m), np.interp(places, gone, north_m)


def check_reach(area: SearchArea, farthest_m: float) -> None:
    """Raise `PlanError` for a search area entirely farther than `farthest_m` from home."""
    corners = np.array(area.search.corners)
    if area.search.contains(*np.array([area.home_m]).T).all():
        return
    nearest = min(
        _distance_m(np.array(area.home_m), a, b)
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)
    )
    if nearest > farthest_m:
        raise PlanError(
            f"the {area.search.name} begins {nearest:.0f} m from home; the battery "
            f"allows {farthest_m:.0f} m and back",
            remedy="Start nearer, or draw a nearer area",
        )


def _distance_m(point: _Floats, a: _Floats, b: _Floats) -> float:
    along = b - a
    share = float(np.clip((point - a) @ along / max(float(along @ along), 1e-9), 0.0, 1.0))
    return float(np.hypot(*(point - a - share * along)))


def survey_lines(
    polygon: Polygon, spacing_m: float, *, most: int | None = None
) -> list[tuple[float, float]]:
    """Return the end points of parallel survey lines along a polygon's longest side, flown back
    and forth. Raises `PlanError` for more than `most` lines.
    """
    if not spacing_m > 0.0:
        raise PlanError(
            f"the line spacing of {spacing_m:g} m is not positive",
            remedy="Give a distance above 0",
        )
    corners = np.array(polygon.corners)
    sides = np.roll(corners, -1, axis=0) - corners
    longest = sides[int(np.argmax(np.hypot(*sides.T)))]
    along = longest / np.hypot(*longest)
    across = np.array([-along[1], along[0]])
    low, high = (corners @ across).min(), (corners @ across).max()
    count = max(1, int(np.ceil((high - low) / spacing_m)))
    if most is not None and count > most:
        raise PlanError(
            f"the survey has {count} lines; at most {most} are allowed",
            remedy="Widen the spacing or shrink the area",
        )
    way: list[tuple[float, float]] = []
    for number in range(count):
        offset = low + (number + 0.5) * (high - low) / count
        ends = _cut(corners, along, across, offset)
        for end in ends if number % 2 == 0 else ends[::-1]:
            way.append((float(end[0]), float(end[1])))  # noqa: PERF401
    return way


def _cut(corners: _Floats, along: _Floats, across: _Floats, offset: float) -> Sequence[_Floats]:
    crossings = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        x, y = float(a @ across) - offset, float(b @ across) - offset
        if (x > 0.0) != (y > 0.0):
            crossings.append(float((a + (b - a) * x / (x - y)) @ along))
    return [where * along + offset * across for where in (min(crossings), max(crossings))]
