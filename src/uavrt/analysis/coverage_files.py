"""Write coverage maps as GeoTIFF and PNG."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from uavrt.analysis.covered.silence import SilentMap
from uavrt.analysis.export.geotiff_export import geotiff_bytes
from uavrt.flight.reading.flight_reader import Flight
from uavrt.formats.png import chance, png_bytes
from uavrt.formats.whole_file import write_whole
from uavrt.localization.results import PositionGrid
from uavrt.planning.detectability.detection_coverage import Coverage


def write_maps(
    directory: Path, name: str, coverage: Coverage, path: Sequence[tuple[float, float]]
) -> list[Path]:
    """Write a coverage map as `name`.tif (detection probabilities) and `name`.png, drawn as in
    a report or, without matplotlib, with only the map's cells.
    """
    ground = coverage.ground
    grid = PositionGrid(
        latitude_deg=ground.plane.latitude_deg,
        longitude_deg=ground.plane.longitude_deg,
        east_m=ground.east_m,
        north_m=ground.north_m,
        probability=coverage.heard.astype(np.float64),
    )
    files = {
        f"{name}.tif": geotiff_bytes(grid, "probability that a tag there is detected, uavrt"),
        f"{name}.png": _picture(coverage, path),
    }
    written = []
    for file, content in files.items():
        write_whole(directory / file, content)
        written.append(directory / file)
    return written


def _picture(coverage: Coverage, path: Sequence[tuple[float, float]]) -> bytes:
    if find_spec("matplotlib") is None:
        return png_bytes(chance(coverage.heard[::-1]))
    from uavrt.analysis.report.silences import coverage_png

    return coverage_png(coverage, path)


def write_silence(
    directory: Path, flight: Flight, maps: dict[int, SilentMap], tag_ids: Sequence[int]
) -> dict[int, list[Path]]:
    """Write GeoTIFF and PNG maps of tags that were not found, and remove outdated maps.

    `maps` come from `silent_maps`, by tag id. Map files of other tags in `tag_ids` are
    removed.
    """
    for tag_id in set(tag_ids) - set(maps):
        for ending in ("tif", "png"):
            (directory / f"{_map_name(tag_id)}.{ending}").unlink(missing_ok=True)
    path = [(pose.longitude_deg, pose.latitude_deg) for pose in flight.poses]
    return {
        tag_id: write_maps(directory, _map_name(tag_id), one.coverage, path)
        for tag_id, one in maps.items()
    }


def _map_name(tag_id: int) -> str:
    return f"coverage_tag_{tag_id}"
