"""Maps of where a tag is heard: before a flight of its plan, after it of its poses."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.flight_noise import FlightNoise
from uavrt.analysis.flown_with import antenna_poses, flight_settings
from uavrt.analysis.listening import Stretch, missing_in_words, within
from uavrt.config.text_files import read_text
from uavrt.errors import RecordingError, UsageError
from uavrt.foreign import SHAPES
from uavrt.guidance.area_text import area_in
from uavrt.guidance.way_text import way_in
from uavrt.localization.antenna import MONOPOLE, AntennaPattern
from uavrt.localization.headings import Headings
from uavrt.localization.heard import PoseColumns, apart_in_words
from uavrt.messages import Tag
from uavrt.planning.area import Polygon, survey_lines
from uavrt.planning.coverage import Coverage, ListeningWay, coverage_of, listening_way
from uavrt.planning.link_budget import LinkBudget
from uavrt.planning.whole_flight import LEAST_PULSES
from uavrt.recording.flight_reader import Flight
from uavrt.recording.integrated import SearchedFor
from uavrt.tangent_plane import TangentPlane, plane_around
from uavrt.terrain.elevation import Elevation
from uavrt.terrain.squares import GroundGrid, ground_grid
from uavrt.units import NANOSECONDS_PER_SECOND

_Floats = NDArray[np.float64]
_Places = tuple[tuple[float, float], ...]
_LEAST_HEIGHT_M = 1.0
_ELSEWHERE_M = 50e3
"""An outline so far beyond the map is not of this ground."""
MOST_PULSES = 20_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MapArea:
    """The map: its ground, and what the elevation files do not tell of it."""

    ground: GroundGrid
    hills: bool
    limitations: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class MapSize:
    """How far a map reaches beyond a way, and its cells."""

    margin_m: float = 2000.0
    cell_m: float = 20.0


def read_places(path: Path, spacing_m: float) -> tuple[TangentPlane, list[tuple[float, float]]]:
    """Read the way of a plan; of an area, the lines of its survey.

    Returns
    -------
    plane : TangentPlane
    corners : list of (east, north)
        In the plane [m].

    Raises
    ------
    FormatError
        The file holds neither.
    PlanError
        The area cannot be surveyed.
    """
    text = read_text(path, SHAPES)
    places = way_in(text, str(path))
    if places:
        return corners_of_way(places)
    return corners_over_area(area_in(text, str(path)), spacing_m)


def corners_of_way(places: _Places) -> tuple[TangentPlane, list[tuple[float, float]]]:
    """Lay a way, of latitudes and longitudes [deg], in a plane; returns as `read_places`."""
    latitude, longitude = np.array(places, np.float64).T
    plane = plane_around(latitude, longitude)
    east, north = plane.to_local(latitude, longitude)
    return plane, list(zip(east.tolist(), north.tolist(), strict=True))


def corners_over_area(
    outline: _Places, spacing_m: float, *, most: int | None = None
) -> tuple[TangentPlane, list[tuple[float, float]]]:
    """Lay the lines of a survey over an outline; returns as `read_places`.

    Parameters
    ----------
    outline : tuple of (latitude, longitude)
        Its corners [deg].
    spacing_m : float
        Between the lines.
    most : int, optional
        Lines.

    Raises
    ------
    PlanError
        The area cannot be surveyed, or takes more lines.
    """
    plane, corners = corners_of_way(outline)
    area = Polygon(corners=tuple(corners), name="area")
    return plane, survey_lines(area, spacing_m, most=most)


def assumed_tag(
    *,
    frequency_hz: float = 150e6,
    pulse_width_s: float = 0.020,
    interval_s: float = 1.254,
    k: int = 3,
) -> Tag:
    """Make a tag for maps of a plan without a list."""
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
    """Read an outline into a plane.

    Raises
    ------
    FormatError
        The file holds none, or several.
    """
    places = area_in(read_text(path, SHAPES), str(path))
    east, north = plane.to_local([one[0] for one in places], [one[1] for one in places])
    corners = tuple(zip(east.tolist(), north.tolist(), strict=True))
    return Polygon(corners=corners, name="area")


def inside(polygon: Polygon, ground: GroundGrid) -> NDArray[np.bool_]:
    """Cells of a map in a polygon.

    Raises
    ------
    UsageError
        There are none.
    """
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
            f"the {polygon.name} holds the middle of no square of the map",
            remedy="Choose smaller squares with --cell",
        )
    if away_m > _ELSEWHERE_M:
        raise UsageError(
            f"the {polygon.name} lies {away_m / 1e3:,.0f} km beyond the map",
            remedy="Name an outline of this ground; maybe its coordinates are swapped",
        )
    raise UsageError(
        f"the {polygon.name} lies {math.ceil(away_m):,} m beyond the map",
        remedy="Give a wider --margin",
    )


def map_around(
    plane: TangentPlane,
    east_m: _Floats,
    north_m: _Floats,
    elevation: Elevation | None,
    size: MapSize,
) -> MapArea:
    """Lay a map around a way.

    Raises
    ------
    UsageError
        It has too many cells.
    FormatError
        A file of heights is damaged.
    """
    area = {
        "west_m": float(east_m.min()) - size.margin_m,
        "east_m": float(east_m.max()) + size.margin_m,
        "south_m": float(north_m.min()) - size.margin_m,
        "north_m": float(north_m.max()) + size.margin_m,
        "cell_m": size.cell_m,
    }
    if elevation is None:
        said = "without --dem the ground is taken as level: hills shorten what is heard"
        return MapArea(
            ground=ground_grid(None, plane, **area), hills=False, limitations=(said,)
        )
    ground = ground_grid(elevation, plane, **area)
    column = np.rint((east_m - ground.west_m) / size.cell_m).astype(np.intp)
    row = np.rint((north_m - ground.south_m) / size.cell_m).astype(np.intp)
    beneath = float(ground.known[row, column].mean())
    if not beneath:
        said = "the elevation files do not cover the way: the ground is taken as level"
        return MapArea(
            ground=ground_grid(None, plane, **area), hills=False, limitations=(said,)
        )
    limitations = []
    if beneath < 1.0:
        limitations.append(
            f"the elevation files do not tell the ground beneath {1.0 - beneath:.0%} of the "
            "way: there it is taken from the nearest place"
        )
    if ground.unknown_share:
        limitations.append(
            f"the elevation files do not tell {ground.unknown_share:.1%} of the map: it has no "
            "figure there"
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
    """Compute what a way would hear that is flown at one height above the ground.

    Raises
    ------
    UsageError
        The way is too long.
    """
    _check_pulses(pulses_on(corners_m, tag, speed_m_s), tag)
    way = listening_way(
        corners_m,
        height_m=height_m,
        speed_m_s=speed_m_s,
        interval_s=tag.pulse_intervals_s[0],
        nose_first=_has_boresight(pattern),
    )
    return _covered(area, way, tag, budget, pattern, level_sigma_db, 500.0, on_pulse)


def pulses_on(corners_m: list[tuple[float, float]], tag: Tag, speed_m_s: float) -> float:
    """About how many pulses of a tag come along a way that is flown at a speed."""
    length_m = float(np.hypot(*np.diff(np.array(corners_m, np.float64), axis=0).T).sum())
    return length_m / (speed_m_s * tag.pulse_intervals_s[0]) + 1.0


def _check_pulses(count: float, tag: Tag) -> None:
    if count > MOST_PULSES:
        raise UsageError(
            f"tag {tag.tag_id} would send more than {MOST_PULSES} pulses on this way",
            remedy="Choose a shorter way",
        )


def flight_coverage(
    area: MapArea,
    flight: Flight,
    tag: Tag,
    budget: LinkBudget,
    *,
    noise: FlightNoise | None,
    pattern: AntennaPattern | None,
    level_sigma_db: float,
    whole_flight: bool = False,
    searched: SearchedFor | None = None,
    listened: Sequence[Stretch] = (),
    on_pulse: Callable[[int, int], None] | None = None,
) -> Coverage:
    """Compute what a flight would have heard of a tag, in groups of pulses or in all together.

    Pulses outside of `listened`, where that is told, were heard by nobody. All together are
    judged as they were `searched`, where that is told.

    Raises
    ------
    UsageError
        The flight is too long.
    """
    way, limitations = flown_way(area, flight, tag, noise, listened)
    window_hz = frequency_window_hz(flight)
    if whole_flight and searched is not None:
        window_hz = searched.frequency_window_hz
    if not _has_boresight(pattern):
        way = replace(way, headings=None)
    found = _covered(
        area,
        way,
        tag,
        budget,
        pattern,
        level_sigma_db,
        window_hz,
        on_pulse,
        whole_flight=whole_flight,
        most_drift=0.0 if searched is None else searched.most_drift,
    )
    return replace(found, limitations=(*found.limitations, *limitations))


def _has_boresight(pattern: AntennaPattern | None) -> bool:
    """Whether the heading matters: not to an upright whip."""
    return pattern is not None and pattern.name != MONOPOLE


def frequency_window_hz(flight: Flight) -> float:
    """Half-width of the search that the flight's detectors made around a tag's frequency."""
    settings = flight_settings(flight)
    return 500.0 if settings is None else settings.detection.frequency_window_hz


def flight_plane(flight: Flight) -> tuple[TangentPlane, _Floats, _Floats]:
    """Plane around a flight, and its way in it.

    Raises
    ------
    RecordingError
        It has no poses.
    """
    poses = PoseColumns.of(flight.poses)
    if len(poses.time_ns) < 2:
        raise RecordingError(
            f"{flight.info.directory} has no poses",
            remedy="Attach those of an autopilot's log with uavrt attach",
        )
    plane = plane_around(poses.latitude_deg, poses.longitude_deg)
    return (plane, *plane.to_local(poses.latitude_deg, poses.longitude_deg))


def flown_way(
    area: MapArea,
    flight: Flight,
    tag: Tag,
    noise: FlightNoise | None,
    listened: Sequence[Stretch] = (),
) -> tuple[ListeningWay, tuple[str, ...]]:
    """Lay a tag's pulses along a flight, one for each interval, at heights above the ground.

    Only those of the time that was listened to, where that is told.
    """
    poses = PoseColumns.of(antenna_poses(flight))
    begin = max(int(poses.time_ns[0]), flight.info.start_time_ns)
    interval_ns = tag.pulse_intervals_s[0] * NANOSECONDS_PER_SECOND
    count = max(1, int((int(poses.time_ns[-1]) - begin) / interval_ns))
    time_ns = begin + np.rint(np.arange(min(count, MOST_PULSES + 1)) * interval_ns)
    missed: tuple[str, ...] = ()
    if listened:
        heard = within(time_ns, listened)
        missed = missing_in_words(float(heard.mean()))
        time_ns = time_ns[heard] if heard.any() else time_ns[:1]
    known = poses.time_ns.astype(np.float64)
    place = area.ground.plane.to_local(poses.latitude_deg, poses.longitude_deg)
    east, north = (np.interp(time_ns, known, one) for one in place)
    told = np.interp(time_ns, known, np.nan_to_num(poses.height_m, nan=0.0))
    height, limitations = _above_ground(area, flight, east, north, told)
    after = np.clip(np.searchsorted(known, time_ns), 1, len(known) - 1)
    nearest = after - (time_ns - known[after - 1] <= known[after] - time_ns)
    return (
        ListeningWay(
            time_s=(time_ns - begin) / NANOSECONDS_PER_SECOND,
            east_m=east,
            north_m=north,
            height_m=height,
            headings=Headings.from_quaternions(poses.quaternion_wxyz[nearest]),
            noise_db=None if noise is None else noise.at(tag.tag_id, time_ns.astype(np.int64)),
        ),
        (*missed, *limitations),
    )


def _above_ground(
    area: MapArea, flight: Flight, east: _Floats, north: _Floats, told_m: _Floats
) -> tuple[_Floats, tuple[str, ...]]:
    """Heights above the ground beneath, from those above the take-off."""
    ground = area.ground
    limitations: list[str] = []
    first = flight.poses[0]
    at = ground.plane.to_local([first.latitude_deg], [first.longitude_deg])
    start_m = float(ground(*at)[0])
    height = start_m + told_m - ground(east, north)
    if area.hills:
        said_m = first.altitude_amsl_m - first.altitude_relative_m
        limitations += apart_in_words(start_m, said_m)
    below = float(np.mean(height < 0.0))
    if below > 0.02:
        limitations.append(
            f"{below:.0%} of the flight lies below the ground of the elevation files: it is "
            f"taken {_LEAST_HEIGHT_M:g} m above it"
        )
    return np.maximum(height, _LEAST_HEIGHT_M), tuple(limitations)


def _covered(
    area: MapArea,
    way: ListeningWay,
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
    least = LEAST_PULSES if whole_flight else tag.k
    if not found.groups:
        limitations = (
            *limitations,
            f"the way is shorter than {least} pulses of the tag: nothing can be heard",
        )
    return replace(found, limitations=limitations)


def best_of(covered: Sequence[Coverage]) -> int:
    """Number of the map with the greatest mean probability."""
    return int(np.argmax([one.mean for one in covered]))
