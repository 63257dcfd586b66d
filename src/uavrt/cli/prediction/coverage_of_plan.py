"""``uavrt coverage`` before a flight: maps of a plan or an area, for each tag and height."""

import numpy as np

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
from uavrt.cli.prediction.coverage_records import CoverageOptions, MappedTag, mean_inside
from uavrt.cli.shown.progress_bars import progress_bar
from uavrt.core.messages import Tag
from uavrt.localization.antenna import MONOPOLE, pattern_named

_CELL_M = 20.0


def maps_of_plan(asked: CoverageOptions, tags: "list[Tag]") -> list[MappedTag]:
    """Compute the coverage map of a plan for each tag and height."""
    antenna = asked.antenna or MONOPOLE
    pattern = pattern_named(antenna)
    plane, corners = read_places(asked.source, asked.spacing_m)
    east, north = np.array(corners).T
    latitude, longitude = plane.to_geodetic(east, north)
    way = list(zip(longitude.tolist(), latitude.tolist(), strict=True))
    size = MapSize(margin_m=asked.margin_m, cell_m=asked.cell_m or _CELL_M)
    area = map_around(plane, east, north, asked.elevation, size)
    cells = None
    if asked.outline is not None:
        cells = inside(read_polygon(asked.outline, plane), area.ground)
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
                        pattern=pattern,
                        level_sigma_db=asked.level_sigma_db,
                        on_pulse=on_pulse,
                    )
                )
        best = best_of(maps)
        for number, (height_m, one) in enumerate(zip(asked.heights_m, maps, strict=True)):
            name = f"coverage_tag_{tag.tag_id}_{height_m:g}m"
            files = () if asked.output is None else write_maps(asked.output, name, one, way)
            mapped.append(
                MappedTag(
                    tag=tag,
                    height_m=height_m,
                    coverage=one,
                    best=number == best,
                    in_area=None if cells is None else mean_inside(one, cells),
                    antenna=antenna,
                    files=tuple(files),
                )
            )
    return mapped
