"""Compute the probability that a tag at each position is detected from a flown path."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.config.text_files import read_text
from uavrt.core.earth.tangent_plane import TangentPlane, plane_around
from uavrt.core.errors import UsageError
from uavrt.core.foreign import SHAPES
from uavrt.core.messages import Tag
from uavrt.guidance.files.area_text import area_in
from uavrt.guidance.files.path_text import path_in
from uavrt.localization.antenna import MONOPOLE, AntennaPattern
from uavrt.localization.terrain.elevation import Elevation
from uavrt.localization.terrain.squares import GroundGrid, ground_grid
from uavrt.planning.area import Polygon, survey_lines
from uavrt.planning.detectability.detection_coverage import (
    AntennaPath,
    Coverage,
    coverage_of,
    planned_antenna_path,
)
from uavrt.planning.detectability.link_budget import LinkBudget
from uavrt.planning.detectability.whole_flight_chance import MODEL

_Floats = NDArray[np.float64]
_Places = tuple[tuple[float, float], ...]
_ELSEWHERE_M = 50e3
"""Distance of an outline from the map above which its coordinates are presumed wrong [m]."""
MOST_PULSES = 20_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapArea:
    """Grid and terrain heights of a coverage map, and notes on missing elevation data."""

    ground: GroundGrid
    hills: bool
    limitations: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class MapSize:
    """Margin of a map around the flown path, and its cell size."""

    margin_m: float = 2000.0
    cell_m: float = 20.0


def read_places(path: Path, spacing_m: float) -> tuple[TangentPlane, list[tuple[float, float]]]:
    """Read a flight path, or an area over which survey lines are laid; return the local plane
    and the path's corners [m].
    """
    text = read_text(path, SHAPES)
    places = path_in(text, str(path))
    if places:
        return corners_of_path(places)
    return corners_over_area(area_in(text, str(path)), spacing_m)


def corners_of_path(places: _Places) -> tuple[TangentPlane, list[tuple[float, float]]]:
    """Project latitudes and longitudes [deg]; return the local plane and the (east, north)
    corners [m].
    """
    latitude, longitude = np.array(places, np.float64).T
    plane = plane_around(latitude, longitude)
    east, north = plane.to_local(latitude, longitude)
    return plane, list(zip(east.tolist(), north.tolist(), strict=True))


def corners_over_area(
    outline: _Places, spacing_m: float, *, most: int | None = None
) -> tuple[TangentPlane, list[tuple[float, float]]]:
    """Lay survey lines over an outline [deg]; return the local plane and the lines' corners
    [m]. Raises `PlanError` for more than `most` lines.
    """
    plane, corners = corners_of_path(outline)
    area = Polygon(corners=tuple(corners), name="area")
    return plane, survey_lines(area, spacing_m, most=most)


def assumed_tag(
    *,
    frequency_hz: float = 150e6,
    pulse_width_s: float = 0.020,
    interval_s: float = 1.254,
    k: int = 3,
) -> Tag:
    """Return a typical tag, for coverage maps without a tag list."""
    return Tag(
        tag_id=2,
        frequency_hz=frequency_hz,
        pulse_width_s=pulse_width_s,
        pulse_intervals_s=(interval_s,),
        interval_uncertainty_s=min(0.060, 0.05 * interval_s),
        interval_jitter_s=min(0.010, 0.1 * interval_s),
        k=k,
    )


def read_polygon(path: Path, plane: TangentPlane) -> Polygon:
    """Read one outline and convert it to plane coordinates [m]. Raises `FormatError` unless
    there is exactly one.
    """
    places = area_in(read_text(path, SHAPES), str(path))
    east, north = plane.to_local([one[0] for one in places], [one[1] for one in places])
    corners = tuple(zip(east.tolist(), north.tolist(), strict=True))
    return Polygon(corners=corners, name="area")


def inside(polygon: Polygon, ground: GroundGrid) -> NDArray[np.bool_]:
    """Mask of cells whose centre lies in a polygon. Raises `UsageError` if there is none."""
    cells = polygon.contains(ground.east_m[np.newaxis, :], ground.north_m[:, np.newaxis])
    if cells.any():
        return np.asarray(cells)
    half_m = 0.5 * ground.cell_m
    beyond = [
        along - np.clip(along, middles[0] - half_m, middles[-1] + half_m)
        for along, middles in zip(
            np.array(polygon.corners).T, (ground.east_m, ground.north_m), strict=True
        )
    ]
    away_m = float(np.hypot(*beyond).min())
    if not away_m:
        raise UsageError(
            f"the {polygon.name} is too small: it contains the centre of no map cell",
            remedy="Choose a smaller --cell",
        )
    if away_m > _ELSEWHERE_M:
        raise UsageError(
            f"the {polygon.name} lies {away_m / 1e3:,.0f} km beyond the map",
            remedy="Give an outline near the flight, and check that latitude and longitude "
            "are not swapped",
        )
    raise UsageError(
        f"the {polygon.name} lies {math.ceil(away_m):,} m beyond the map",
        remedy="Give a wider margin with --margin",
    )


def map_around(
    plane: TangentPlane,
    east_m: _Floats,
    north_m: _Floats,
    elevation: Elevation | None,
    size: MapSize,
) -> MapArea:
    """Create a map's grid and terrain around a path. Raises `UsageError` or `FormatError`."""
    area = {
        "west_m": float(east_m.min()) - size.margin_m,
        "east_m": float(east_m.max()) + size.margin_m,
        "south_m": float(north_m.min()) - size.margin_m,
        "north_m": float(north_m.max()) + size.margin_m,
        "cell_m": size.cell_m,
    }
    if elevation is None:
        said = (
            "without --dem, the ground is assumed to be level: hills reduce the detection range"
        )
        return MapArea(
            ground=ground_grid(None, plane, **area), hills=False, limitations=(said,)
        )
    ground = ground_grid(elevation, plane, **area)
    column = np.rint((east_m - ground.west_m) / size.cell_m).astype(np.intp)
    row = np.rint((north_m - ground.south_m) / size.cell_m).astype(np.intp)
    beneath = float(ground.known[row, column].mean())
    if not beneath:
        said = (
            "the elevation files do not cover the flight path; the ground is assumed to be "
            "level"
        )
        return MapArea(
            ground=ground_grid(None, plane, **area), hills=False, limitations=(said,)
        )
    limitations = []
    if beneath < 1.0:
        limitations.append(
            f"the elevation files have no height for {1.0 - beneath:.0%} of the flight path; "
            "the nearest height is used there"
        )
    if ground.unknown_share:
        limitations.append(
            f"the elevation files have no height for {ground.unknown_share:.1%} of the map; it "
            "is empty there"
        )
    limitations += elevation.cautions
    return MapArea(ground=ground, hills=True, limitations=tuple(limitations))


def plan_coverage(
    area: MapArea,
    corners_m: list[tuple[float, float]],
    tag: Tag,
    budget: LinkBudget,
    *,
    height_m: float,
    speed_m_s: float,
    pattern: AntennaPattern | None,
    level_sigma_db: float,
    on_pulse: Callable[[int, int], None] | None = None,
) -> Coverage:
    """Compute a tag's detection probability along a planned path. Raises `UsageError` if the
    path is too long.
    """
    _check_pulses(pulses_on(corners_m, tag, speed_m_s), tag)
    way = planned_antenna_path(
        corners_m,
        height_m=height_m,
        speed_m_s=speed_m_s,
        interval_s=tag.pulse_intervals_s[0],
        nose_first=has_boresight(pattern),
    )
    return covered_by(area, way, tag, budget, pattern, level_sigma_db, 500.0, on_pulse)


def pulses_on(corners_m: list[tuple[float, float]], tag: Tag, speed_m_s: float) -> float:
    """Approximate number of pulses that a tag sends during a path flown at a given speed."""
    length_m = float(np.hypot(*np.diff(np.array(corners_m, np.float64), axis=0).T).sum())
    return length_m / (speed_m_s * tag.pulse_intervals_s[0]) + 1.0


def _check_pulses(count: float, tag: Tag) -> None:
    if count > MOST_PULSES:
        raise UsageError(
            f"tag {tag.tag_id} would send more than {MOST_PULSES} pulses on this path",
            remedy="Choose a shorter path",
        )


def has_boresight(pattern: AntennaPattern | None) -> bool:
    """True for an antenna that is directional in azimuth, False for an upright whip."""
    return pattern is not None and pattern.name != MONOPOLE


def covered_by(
    area: MapArea,
    way: AntennaPath,
    tag: Tag,
    budget: LinkBudget,
    pattern: AntennaPattern | None,
    level_sigma_db: float,
    window_hz: float,
    on_pulse: Callable[[int, int], None] | None,
    *,
    whole_flight: bool = False,
    most_drift: float = 0.0,
) -> Coverage:
    """Compute a tag's detection probability along the antenna's path. Raises `UsageError` if
    the path is too long.
    """
    _check_pulses(len(way.time_s), tag)
    own = replace(budget, frequency_hz=tag.frequency_hz, pulse_width_s=tag.pulse_width_s)
    found = coverage_of(
        area.ground,
        way,
        tag,
        own,
        pattern=pattern,
        level_sigma_db=level_sigma_db,
        frequency_window_hz=window_hz,
        hills=area.hills,
        whole_flight=whole_flight,
        most_drift=most_drift,
        on_pulse=on_pulse,
    )
    limitations = area.limitations
    least = MODEL.least_pulses if whole_flight else tag.k
    if not found.groups:
        limitations = (
            *limitations,
            f"the path is shorter than {least} pulses of the tag: nothing can be detected",
        )
    return replace(found, limitations=limitations)


def best_of(covered: Sequence[Coverage]) -> int:
    """Index of the coverage map with the greatest mean detection probability."""
    return int(np.argmax([one.mean for one in covered]))
