"""Write coverage maps as GeoTIFF and PNG."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from uavrt.analysis.export.geotiff import geotiff_bytes
from uavrt.analysis.export.png import chance, png_bytes
from uavrt.analysis.silence import SilentMap
from uavrt.localization.results import PositionGrid
from uavrt.planning.coverage import Coverage
from uavrt.recording.flight_reader import Flight
from uavrt.recording.formats.whole_file import write_whole


def write_maps(
    directory: Path, name: str, coverage: Coverage, way: Sequence[tuple[float, float]]
) -> list[Path]:
    """Write a map as GeoTIFF (probabilities) and PNG (picture).

    The picture looks as in a report; without matplotlib it shows the map's squares alone.

    `directory`, `name`: folder, and file name without ending.
    `way`: longitude and latitude of each corner of the flown path [deg].
    Raises `RecordingError`: they cannot be written.
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
        f"{name}.tif": geotiff_bytes(grid, "probability that a tag there is heard, uavrt"),
        f"{name}.png": _picture(coverage, way),
    }
    written = []
    for file, content in files.items():
        write_whole(directory / file, content)
        written.append(directory / file)
    return written


def _picture(coverage: Coverage, way: Sequence[tuple[float, float]]) -> bytes:
    if find_spec("matplotlib") is None:
        return png_bytes(chance(coverage.heard[::-1]))
    from uavrt.analysis.report.silences import coverage_png

    return coverage_png(coverage, way)


def write_silence(
    directory: Path, flight: Flight, maps: dict[int, SilentMap], tag_ids: Sequence[int]
) -> dict[int, list[Path]]:
    """Write coverage maps of tags not found as GeoTIFF and PNG; remove files of other judged
    tags.

    `flight`: whose path is drawn.
    `maps`: from `silent_maps`, by tag.
    `tag_ids`: all judged tags.
    Raises `RecordingError`: they cannot be written.
    """
    for tag_id in set(tag_ids) - set(maps):
        for ending in ("tif", "png"):
            (directory / f"{_map_name(tag_id)}.{ending}").unlink(missing_ok=True)
    way = [(pose.longitude_deg, pose.latitude_deg) for pose in flight.poses]
    return {
        tag_id: write_maps(directory, _map_name(tag_id), one.coverage, way)
        for tag_id, one in maps.items()
    }


def _map_name(tag_id: int) -> str:
    return f"coverage_tag_{tag_id}"
