"""Maps of where a tag would be detected along a planned path, as by ``uavrt coverage PLAN``."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from uavrt.core.earth.geodesy import distance_m
from uavrt.core.errors import FormatError, NotFound, UsageError
from uavrt.core.messages import Tag
from uavrt.ground.link.page_values import number_between, places_in, power_in, whole_in
from uavrt.ground.store.estimates import AntennaChoice
from uavrt.ground.web.work.map_jobs import MapJobs, OnStep, Record, figures, map_record
from uavrt.localization.antenna import pattern_named
from uavrt.localization.terrain.elevation_files import open_elevation
from uavrt.planning.detectability.link_budget import LinkBudget

if TYPE_CHECKING:
    from uavrt.analysis.covered.coverage_maps import MapSize
    from uavrt.planning.detectability.detection_coverage import Coverage

_HEIGHT_M, _SPEED_M_S, _SPACING_M = 60.0, 8.0, 200.0
_LEVEL_SIGMA_DB = 3.0
"""Uncertainty of the tag's power [dB]; the default of `uavrt coverage`."""
_MOST_PLACES, _MOST_CORNERS, _MOST_HEIGHTS, _MOST_LINES = 2000, 500, 5, 1000
_FARTHEST_M = 50_000.0
"""Largest distance of a plan's points from its first point [m]."""
_MOST_CELLS = 45_000
"""Maximum number of a map's cells; smaller maps have 20 m cells and a margin of 2 km."""
_MOST_PULSES = 20_000
"""Maximum number of simulated pulses for the maps of all heights; more would take minutes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanMapRequest:
    """Request for coverage maps of a planned flight."""

    places: tuple[tuple[float, float], ...]
    """Latitude and longitude of each point [deg]."""
    spacing_m: float | None
    """Spacing of the lines over an area [m]; None: the points are a path."""
    heights_m: tuple[float, ...]
    """Flight heights above the ground, one per map [m]."""
    speed_m_s: float
    tag: Tag
    listed: bool
    """True for a tag of the table, False for an assumed tag."""
    tag_power_dbm: float
    antenna: AntennaChoice

    @classmethod
    def from_request(
        cls, wanted: dict[str, Any], tags: tuple[Tag, ...], antenna: AntennaChoice
    ) -> "PlanMapRequest":
        """Read a page's request; raises `FormatError` or `UsageError`."""
        from uavrt.analysis.covered.coverage_maps import assumed_tag

        asked = wanted.get("tag_id") is not None
        places, spacing_m = _plan_in(wanted)
        return cls(
            places=places,
            spacing_m=spacing_m,
            heights_m=_heights_in(wanted),
            speed_m_s=number_between(wanted, "speed_m_s", 0.5, 100.0, _SPEED_M_S),
            tag=_listed(whole_in(wanted, "tag_id"), tags) if asked else assumed_tag(),
            listed=asked,
            tag_power_dbm=power_in(wanted),
            antenna=antenna,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanMaps:
    """Coverage maps of a plan, one per height."""

    request: PlanMapRequest
    maps: "tuple[Coverage, ...]"
    best: int


def plan_map_jobs() -> MapJobs[PlanMapRequest, PlanMaps]:
    """Make the `MapJobs` that computes maps of plans."""
    return MapJobs(_made, _record, "map of a plan")


def _plan_in(wanted: dict[str, Any]) -> tuple[tuple[tuple[float, float], ...], float | None]:
    """Read the points of a path or an outline, and the spacing of an outline's lines [m]."""
    way, outline = wanted.get("way"), wanted.get("outline")
    if (way is None) == (outline is None):
        raise FormatError("a plan must be either a path or an outline, not both")
    given, least, most = (outline, 3, _MOST_CORNERS) if way is None else (way, 2, _MOST_PLACES)
    if not isinstance(given, list) or not least <= len(given) <= most:
        raise FormatError(f"a plan must have {least} to {most} points")
    places = places_in(given)
    if way is None and places[0] == places[-1]:
        places = places[:-1]
    farthest_m = max(distance_m(*places[0], *one) for one in places)
    if not farthest_m <= _FARTHEST_M:
        raise UsageError(
            f"the plan reaches {farthest_m / 1e3:.0f} km from its first point; "
            f"at most {_FARTHEST_M / 1e3:.0f} km are allowed",
            remedy=f"Plan a path of at most {_FARTHEST_M / 1e3:.0f} km",
        )
    if way is not None:
        return places, None
    return places, number_between(wanted, "spacing_m", 5.0, 1000.0, _SPACING_M)


def _heights_in(wanted: dict[str, Any]) -> tuple[float, ...]:
    given = wanted.get("heights_m", [_HEIGHT_M])
    if not isinstance(given, list) or not 1 <= len(given) <= _MOST_HEIGHTS:
        raise FormatError(f"heights_m must be a list of 1 to {_MOST_HEIGHTS} numbers")
    heights = {number_between({"heights_m": one}, "heights_m", 1.0, 20_000.0) for one in given}
    return tuple(sorted(heights))


def _listed(tag_id: int, tags: tuple[Tag, ...]) -> Tag:
    for one in tags:
        if one.tag_id == tag_id:
            return one
    raise NotFound(
        f"there is no tag {str(tag_id)[:20]} in the table",
        remedy="Choose a tag that is in the table",
    )


def _made(request: PlanMapRequest, on_step: OnStep) -> PlanMaps:
    # Loaded with the first question only, as in `_size`.
    from uavrt.analysis.covered import coverage_maps as coverage

    plane, corners = (
        coverage.corners_of_path(request.places)
        if request.spacing_m is None
        else coverage.corners_over_area(request.places, request.spacing_m, most=_MOST_LINES)
    )
    east, north = np.array(corners).T
    dem = request.antenna.dem
    size = _size(float(np.ptp(east)), float(np.ptp(north)))
    pulses = coverage.pulses_on(corners, request.tag, request.speed_m_s)
    if pulses * len(request.heights_m) > _MOST_PULSES:
        raise UsageError(
            f"the map needs {pulses:.0f} pulses at each of {len(request.heights_m)} heights; "
            f"at most {_MOST_PULSES} in total can be calculated",
            remedy="Choose fewer heights, a wider line spacing or a smaller area",
        )
    area = coverage.map_around(
        plane, east, north, open_elevation(Path(dem)) if dem else None, size
    )
    budget = LinkBudget(
        frequency_hz=request.tag.frequency_hz,
        pulse_width_s=request.tag.pulse_width_s,
        tag_eirp_dbm=request.tag_power_dbm,
        drone_height_m=request.heights_m[0],
    )
    maps = []
    for number, height_m in enumerate(request.heights_m):

        def on_pulse(done: int, total: int, number: int = number) -> None:
            on_step(number * total + done, len(request.heights_m) * total)

        maps.append(
            coverage.plan_coverage(
                area,
                corners,
                request.tag,
                budget,
                height_m=height_m,
                speed_m_s=request.speed_m_s,
                pattern=pattern_named(request.antenna.pattern),
                level_sigma_db=_LEVEL_SIGMA_DB,
                on_pulse=on_pulse,
            )
        )
    return PlanMaps(request=request, maps=tuple(maps), best=coverage.best_of(maps))


def _size(wide_m: float, high_m: float) -> "MapSize":
    """Choose the size of a map's cells: as `uavrt coverage`, or larger if too many."""
    from uavrt.analysis.covered.coverage_maps import MapSize

    size = MapSize()
    reach_m = 2.0 * size.margin_m
    least_m = math.sqrt((wide_m + reach_m) * (high_m + reach_m) / _MOST_CELLS)
    return replace(size, cell_m=max(size.cell_m, float(math.ceil(least_m))))


def _record(found: PlanMaps) -> Record:
    request = found.request
    return {
        "tag_id": request.tag.tag_id if request.listed else None,
        "tag_power_dbm": request.tag_power_dbm,
        **map_record(found.maps[found.best]),
        "height_m": request.heights_m[found.best],
        "heights": [
            {"height_m": height_m, **figures(one), "best": number == found.best}
            for number, (height_m, one) in enumerate(
                zip(request.heights_m, found.maps, strict=True)
            )
        ],
        "speed_m_s": request.speed_m_s,
        "antenna": request.antenna.pattern,
    }
