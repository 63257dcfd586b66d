"""Convert bearings and positions to lines and areas in WGS 84, for any map."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.units import wrap_degrees_360
from uavrt.localization.estimates.flight_estimates import TagBearing
from uavrt.localization.position.regions import region_outlines
from uavrt.localization.results import Position, PositionGrid

Point = tuple[float, float]
"""Longitude and latitude [deg], in the order of GeoJSON."""


class Located(Protocol):
    """Interface of records with latitude and longitude [deg]."""

    @property
    def latitude_deg(self) -> float: ...  # noqa: D102
    @property
    def longitude_deg(self) -> float: ...  # noqa: D102


RAY_M = 1500.0
REGION_SHARES = (50, 95)
_STEP_DEG = 5.0


def point_of(one: Located) -> Point:
    """Longitude and latitude of a record."""
    return one.longitude_deg, one.latitude_deg


def ray_length_m(bearing: TagBearing, position: Position | None) -> float:
    """Drawn length of a bearing [m]: a fifth beyond the tag or, if unknown, `RAY_M`."""
    if position is None:
        return RAY_M
    plane = _plane(bearing)
    east, north = plane.to_local(position.latitude_deg, position.longitude_deg)
    return max(100.0, 1.2 * math.hypot(float(east), float(north)))


def ray(bearing: TagBearing, length_m: float) -> list[Point]:
    """Return the line from a bearing's origin in its direction."""
    towards = (0.0, length_m)
    return [_at(bearing, distance, bearing.bearing.bearing_deg) for distance in towards]


def wedge(bearing: TagBearing, length_m: float) -> list[Point] | None:
    """Closed outline of a bearing's 90 % sector, counter-clockwise; None if unknown."""
    if bearing.bearing.interval90_deg is None:
        return None
    low, high = bearing.bearing.interval90_deg
    width = wrap_degrees_360(high - low)
    steps = max(2, math.ceil(width / _STEP_DEG) + 1)
    arc = [_at(bearing, length_m, high - width * step / (steps - 1)) for step in range(steps)]
    start = _at(bearing, 0.0, 0.0)
    return [start, *arc, start]


def region95(position: Position) -> list[Point] | None:
    """Closed outline of the 95 % ellipse or circle, counter-clockwise; None if unknown."""
    if position.ellipse95 is not None:
        ellipse = position.ellipse95
        long_m, short_m = ellipse.semi_major_m, ellipse.semi_minor_m
        turned = math.radians(ellipse.orientation_deg)
    elif position.radius95_m is not None:
        long_m = short_m = position.radius95_m
        turned = 0.0
    else:
        return None
    plane = TangentPlane(
        latitude_deg=position.latitude_deg, longitude_deg=position.longitude_deg
    )
    points = []
    for step in range(73):
        angle = -2.0 * math.pi * (step % 72) / 72.0
        along, across = long_m * math.cos(angle), short_m * math.sin(angle)
        north = along * math.cos(turned) - across * math.sin(turned)
        east = along * math.sin(turned) + across * math.cos(turned)
        points.append(_point(plane, east, north))
    return points


def path_points(position: Position | None) -> list[Point]:
    """Path of a moving tag as points; empty for a resting tag."""
    track = () if position is None else position.track
    return list(map(point_of, track))


def region_lines(position: Position, share: int) -> list[list[Point]]:
    """Outlines of the smallest region that contains the tag with a probability of `share`
    percent, cut at the 180° meridian.
    """
    if position.grid is None:
        return []
    rings = _outlines(position.grid, share / 100.0)
    return [part for ring in rings for part in split_at_date_line(ring)]


def rings95(position: Position) -> list[list[Point]]:
    """Outlines of the smallest 95 % region; without a probability grid, the 95 % ellipse or
    circle.

    They are for local maps and are not cut at the 180° meridian.
    """
    if position.grid is not None:
        return _outlines(position.grid, 0.95)
    area = region95(position)
    return [] if area is None else [area]


def _outlines(grid: PositionGrid, share: float) -> list[list[Point]]:
    rings = region_outlines(grid, share)
    return [[(float(lon), float(lat)) for lon, lat in ring] for ring in rings]


def split_at_date_line(points: Sequence[Point]) -> list[list[Point]]:
    """Cut a line where it crosses the 180° meridian (RFC 7946 §3.1.9)."""
    parts: list[list[Point]] = [[]]
    for point in points:
        if parts[-1]:
            before = parts[-1][-1]
            if abs(point[0] - before[0]) > 180.0:
                side = math.copysign(180.0, before[0])
                step = point[0] + 2 * side - before[0]
                share = (side - before[0]) / step if step else 0.0
                latitude = before[1] + share * (point[1] - before[1])
                parts[-1].append((side, latitude))
                parts.append([(-side, latitude)])
        parts[-1].append(point)
    return [part for part in parts if len(part) > 1] or [list(points)]


def split_area_at_date_line(ring: Sequence[Point]) -> list[list[Point]]:
    """Cut an area where it crosses the 180° meridian (RFC 7946 §3.1.9).

    `ring` is closed: its last point equals its first. If its longitudes run once round the
    earth, the area extends to the pole. The returned rings are closed, keep the direction of
    rotation, and have longitudes in [-180, 180].
    """
    run_on = [ring[0]]
    for longitude, latitude in ring[1:]:
        before = run_on[-1][0]
        run_on.append((before + math.remainder(longitude - before, 360.0), latitude))
    if abs(run_on[-1][0] - run_on[0][0]) > 180.0:
        pole = math.copysign(90.0, sum(latitude for _, latitude in ring))
        run_on += [(run_on[-1][0], pole), (run_on[0][0], pole), run_on[0]]
    elif all(abs(longitude) <= 180.0 for longitude, _ in run_on):
        return [run_on]
    first = math.floor((min(point[0] for point in run_on) + 180.0) / 360.0)
    last = math.floor((max(point[0] for point in run_on) + 180.0) / 360.0)
    parts = []
    for turn in range(first, last + 1):
        part = [(longitude - 360.0 * turn, latitude) for longitude, latitude in run_on]
        for side in (-180.0, 180.0):
            part = _this_side(part, side)
        longitudes = {longitude for longitude, _ in part}
        if len(part) > 3 and len(longitudes) > 1:
            parts.append(part)
    return parts or [list(ring)]


def _this_side(ring: list[Point], side_deg: float) -> list[Point]:
    """Clip a closed ring at longitude `side_deg`, ±180 (Sutherland and Hodgman 1974)."""
    kept: list[Point] = []
    for before, point in pairwise(ring):
        inside = [abs(one[0]) <= 180.0 or one[0] * side_deg < 0.0 for one in (before, point)]
        if inside[0] != inside[1]:
            share = (side_deg - before[0]) / (point[0] - before[0])
            kept.append((side_deg, before[1] + share * (point[1] - before[1])))
        if inside[1]:
            kept.append(point)
    return [*kept, kept[0]] if kept else []


def _plane(bearing: TagBearing) -> TangentPlane:
    return TangentPlane(latitude_deg=bearing.latitude_deg, longitude_deg=bearing.longitude_deg)


def _at(bearing: TagBearing, distance_m: float, direction_deg: float) -> Point:
    angle = math.radians(direction_deg)
    return _point(_plane(bearing), distance_m * math.sin(angle), distance_m * math.cos(angle))


def _point(plane: TangentPlane, east_m: float, north_m: float) -> Point:
    latitude, longitude = plane.to_geodetic(east_m, north_m)
    return float(longitude), float(latitude)
