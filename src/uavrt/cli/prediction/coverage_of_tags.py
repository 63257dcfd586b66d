"""Coverage maps of each tag, for a plan or an area before a flight, or of a flight after it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.coverage_files import write_maps
from uavrt.analysis.covered.coverage_maps import (
    MapSize,
    best_of,
    inside,
    map_around,
    plan_coverage,
    read_places,
    read_polygon,
)
from uavrt.analysis.covered.silence import ListenedFlight
from uavrt.cli.options.inputs import chosen_tags
from uavrt.cli.shown.progress_bars import progress_bar
from uavrt.config.tags.tag_files import read_tags
from uavrt.core.messages import Tag
from uavrt.flight.integrated import SilentAround
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.localization.antenna import MONOPOLE, pattern_named
from uavrt.localization.terrain.elevation import Elevation
from uavrt.localization.terrain.squares import GroundGrid
from uavrt.planning.detectability.detection_coverage import Absence, Coverage, absence
from uavrt.planning.detectability.link_budget import LinkBudget

_CELL_M = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CoverageOptions:
    """All command-line arguments of ``uavrt coverage`` in one record."""

    source: Path
    elevation: Elevation | None
    outline: Path | None
    prior: float | None
    heights_m: tuple[float, ...]
    speed_m_s: float
    spacing_m: float
    margin_m: float
    cell_m: float | None
    antenna: str | None
    level_sigma_db: float
    budget: LinkBudget
    output: Path | None

    def cells_of_area(self, ground: GroundGrid) -> NDArray[np.bool_] | None:
        """Mask of the map cells in the outline of --area; None if no area is given."""
        if self.outline is None:
            return None
        return inside(read_polygon(self.outline, ground.plane), ground)

    def write(
        self, name: str, coverage: Coverage, way: Sequence[tuple[float, float]]
    ) -> tuple[Path, ...]:
        """Write a map with the path (longitude, latitude) into --output, if it is given."""
        return (
            () if self.output is None else tuple(write_maps(self.output, name, coverage, way))
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MappedTag:
    """Coverage map of one tag at one height, with values computed from it."""

    tag: Tag
    height_m: float | None
    """Flight height above ground [m]; None: heights of the actual flight."""
    coverage: Coverage
    best: bool = True
    in_area: float | None = None
    """Mean detection probability within the outline of --area; None if no area is given."""
    absence: Absence | None = None
    heard: int = 0
    antenna: str
    in_hindsight: bool = False
    """True if ``uavrt integrate`` found the tag in the whole flight."""
    silent: SilentAround | None = None
    """Area where an undetected tag would be detected; None for plans and detected tags."""
    noise: str | None = None
    files: tuple[Path, ...] = ()


def maps_of_flight(
    asked: CoverageOptions, tags: Path | None, ids: tuple[int, ...]
) -> list[MappedTag]:
    """Compute the coverage map of a flight for each tag."""
    flight = read_flight(asked.source)
    way = [(pose.longitude_deg, pose.latitude_deg) for pose in flight.poses]
    known = flight.info.tags if tags is None else read_tags(tags)
    listened = ListenedFlight.read(
        asked.source, flight, asked.elevation, margin_m=asked.margin_m, cell_m=asked.cell_m
    )
    cells = asked.cells_of_area(listened.area.ground)
    mapped = []
    for tag in chosen_tags(known, ids):
        with progress_bar(f"tag {tag.tag_id}") as on_pulse:
            found = listened.silent_map(
                tag,
                asked.budget,
                antenna=asked.antenna,
                level_sigma_db=asked.level_sigma_db,
                on_pulse=on_pulse,
            )
        one = found.coverage
        mapped.append(
            MappedTag(
                tag=tag,
                height_m=None,
                coverage=one,
                in_area=_mean_inside(one, cells),
                absence=None
                if cells is None or found.heard
                else absence(one, cells, asked.prior),
                heard=found.heard_pulses,
                in_hindsight=found.in_hindsight,
                noise=found.noise,
                antenna=found.antenna,
                silent=None if found.heard else found.around,
                files=asked.write(f"coverage_tag_{tag.tag_id}", one, way),
            )
        )
    return mapped


def maps_of_plan(asked: CoverageOptions, tags: Sequence[Tag]) -> list[MappedTag]:
    """Compute the coverage map of a plan for each tag and height."""
    antenna = asked.antenna or MONOPOLE
    plane, corners = read_places(asked.source, asked.spacing_m)
    east, north = np.array(corners).T
    latitude, longitude = plane.to_geodetic(east, north)
    way = list(zip(longitude.tolist(), latitude.tolist(), strict=True))
    size = MapSize(margin_m=asked.margin_m, cell_m=asked.cell_m or _CELL_M)
    area = map_around(plane, east, north, asked.elevation, size)
    cells = asked.cells_of_area(area.ground)
    mapped = []
    for tag in tags:
        maps = []
        for height_m in asked.heights_m:
            with progress_bar(f"tag {tag.tag_id} from {height_m:g} m") as on_pulse:
                maps.append(
                    plan_coverage(
                        area,
                        corners,
                        tag,
                        asked.budget,
                        height_m=height_m,
                        speed_m_s=asked.speed_m_s,
                        pattern=pattern_named(antenna),
                        level_sigma_db=asked.level_sigma_db,
                        on_pulse=on_pulse,
                    )
                )
        best = best_of(maps)
        mapped += [
            MappedTag(
                tag=tag,
                height_m=height_m,
                coverage=one,
                best=number == best,
                in_area=_mean_inside(one, cells),
                antenna=antenna,
                files=asked.write(f"coverage_tag_{tag.tag_id}_{height_m:g}m", one, way),
            )
            for number, (height_m, one) in enumerate(zip(asked.heights_m, maps, strict=True))
        ]
    return mapped


def _mean_inside(one: Coverage, cells: NDArray[np.bool_] | None) -> float | None:
    """Mean detection probability over the cells of known ground height in an outline."""
    if cells is None:
        return None
    known = one.heard[cells & np.isfinite(one.heard)]
    return float(known.mean()) if known.size else math.nan
