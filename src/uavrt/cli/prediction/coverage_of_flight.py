"""``uavrt coverage`` after a flight: coverage maps for each tag."""

from pathlib import Path

from uavrt.analysis.coverage_files import write_maps
from uavrt.analysis.covered.coverage_maps import inside, read_polygon
from uavrt.analysis.covered.silence import ListenedFlight
from uavrt.cli.options.inputs import chosen_tags
from uavrt.cli.prediction.coverage_records import (
    CoverageOptions,
    MappedTag,
    mean_inside,
)
from uavrt.cli.shown.progress_bars import progress_bar
from uavrt.config.tags.tag_files import read_tags
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.planning.detectability.detection_coverage import absence


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
    cells = None
    if asked.outline is not None:
        ground = listened.area.ground
        cells = inside(read_polygon(asked.outline, ground.plane), ground)
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
        silence = None
        if cells is not None and not found.heard:
            silence = absence(one, cells, asked.prior)
        name = f"coverage_tag_{tag.tag_id}"
        files = () if asked.output is None else write_maps(asked.output, name, one, way)
        mapped.append(
            MappedTag(
                tag=tag,
                height_m=None,
                coverage=one,
                in_area=None if cells is None else mean_inside(one, cells),
                absence=silence,
                heard=found.heard_pulses,
                in_hindsight=found.in_hindsight,
                noise=found.noise,
                antenna=found.antenna,
                silent=None if found.heard else found.around,
                files=tuple(files),
            )
        )
    return mapped
