"""Export a flight or an old log to the file formats of other tools."""

import sqlite3
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from uavrt.analysis.export import burst_files as bursts
from uavrt.analysis.export import csv_tables as tables
from uavrt.analysis.export.geojson import geojson_text
from uavrt.analysis.export.geopackage import write_geopackage
from uavrt.analysis.export.geotiff_export import geotiff_bytes
from uavrt.analysis.export.gpx import gpx_text
from uavrt.analysis.export.kmz import kml_text, kmz_bytes
from uavrt.analysis.survey import Survey
from uavrt.core.atomic_file import make_directories, replacing
from uavrt.core.errors import RecordingError, UsageError
from uavrt.formats.bearings_csv import write_bearing_file
from uavrt.formats.positions_csv import write_position_file
from uavrt.formats.whole_file import write_whole


@dataclass(frozen=True, slots=True)
class OneFile:
    """An export format of a single file, which the web page offers for download."""

    media_type: str
    content: Callable[[Survey], str | bytes]


ONE_FILE: dict[str, OneFile] = {
    "geojson": OneFile("application/geo+json", geojson_text),
    "kmz": OneFile("application/vnd.google-earth.kmz", kmz_bytes),
    "kml": OneFile("application/vnd.google-earth.kml+xml", kml_text),
    "gpx": OneFile("application/gpx+xml", gpx_text),
}
"""Single-file formats by name; the name is also the file extension."""


def export_survey(
    survey: Survey, directory: Path, formats: Sequence[str] | None = None
) -> list[Path]:
    """Write a survey in the requested formats; files of the same name are replaced.

    `formats` may be: ``csv`` (pulses, track, positions; paths of moving tags and marks where
    there are any), ``uavrt`` (the original UAV-RT's bearings.csv, positions.csv and pulse
    CSV), ``geojson``, ``kmz``, ``kml`` (without pictures), ``gpx``, ``geopackage``,
    ``movebank``, ``geotiff`` (a heat map for each tag; for a monopole survey the signal
    strength, also by height layer), ``motus`` (bursts and beeps for SensorGnome and find_tags).
    None means all.
    Returns the written files. Raises `RecordingError` if a file cannot be written, and
    `UsageError` for a log without pulses.
    """
    if survey.kind != "flight" and not survey.pulse_poses:
        raise UsageError(
            f"{survey.name} contains no pulse, so nothing was exported",
            remedy="Name a log that contains pulses",
        )
    chosen = EXPORT_FORMATS if formats is None else formats
    return [path for form in chosen for path in _WRITERS[form](survey, directory)]


def _one_file(name: str) -> Callable[[Survey, Path], list[Path]]:
    return lambda survey, to: _written(to, {f"flight.{name}": ONE_FILE[name].content(survey)})


def _csv(survey: Survey, directory: Path) -> list[Path]:
    moved = any(one.position is not None and one.position.track for one in survey.positions)
    return _written(
        directory,
        {
            "pulses.csv": tables.pulses_csv(survey),
            "track.csv": tables.track_csv(survey),
            "fixes.csv": tables.fixes_csv(survey),
        },
    ) + _where_any(
        directory,
        {
            "ways.csv": tables.tag_paths_csv(survey) if moved else None,
            "marks.csv": tables.marks_csv(survey) if survey.marks else None,
        },
    )


def _where_any(directory: Path, files: Mapping[str, str | None]) -> list[Path]:
    """Write files by name; a file whose content is None is deleted if it exists."""
    for name, content in files.items():
        if content is None:
            (directory / name).unlink(missing_ok=True)
    return _written(directory, {n: text for n, text in files.items() if text is not None})


def _uavrt(survey: Survey, directory: Path) -> list[Path]:
    name = "Pulse-uavrt.csv"
    written = _written(directory, {name: tables.tagtracker_csv(survey)})
    bearings, positions = directory / "bearings.csv", directory / "positions.csv"
    for path in (bearings, positions):
        path.unlink(missing_ok=True)  # those of an earlier export have other rows
    write_bearing_file(bearings, tables.bearing_rows(survey, name))
    write_position_file(positions, tables.position_rows(survey, bearings.name))
    return [*written, bearings, positions]


def _geopackage(survey: Survey, directory: Path) -> list[Path]:
    target = directory / "flight.gpkg"
    try:
        make_directories(directory)
        with replacing(target) as part:
            write_geopackage(survey, part)
    except (OSError, sqlite3.Error) as error:
        raise RecordingError(
            f"cannot write {target}: {error}", remedy="Choose a writable directory"
        ) from error
    return [target]


def _geotiff(survey: Survey, directory: Path) -> list[Path]:
    files: dict[str, str | bytes] = {}
    for one in survey.positions:
        if one.position is not None and one.position.grid is not None:
            text = f"probability of tag {one.tag_id} in each cell, uavrt, {survey.name}"
            files[f"heat_tag_{one.tag_id}.tif"] = geotiff_bytes(one.position.grid, text)
    for signal in survey.signals:
        text = f"SNR of tag {signal.tag_id} [dB], the tag is not at the strongest, uavrt"
        name = f"signal_tag_{signal.tag_id}"
        if signal.surface is not None:
            files[f"{name}.tif"] = geotiff_bytes(signal.surface, text)
        for layer in signal.layers:
            if layer.surface is not None:
                heights = f"{layer.low_m:.0f}-{layer.high_m:.0f}m"
                content = geotiff_bytes(layer.surface, f"{text}, heights {heights}")
                files[f"{name}_{heights}.tif"] = content
    return _written(directory, files)


def _motus(survey: Survey, directory: Path) -> list[Path]:
    """Write pulses and bursts for Motus; a flight without any gets no file."""
    if not bursts.has_bursts(survey):
        return []
    files = {
        "sensorgnome.txt": bursts.sensorgnome_text(survey),
        "detections.csv": bursts.detections_csv(survey),
    }
    return _written(directory, files)


def _written(directory: Path, files: Mapping[str, str | bytes]) -> list[Path]:
    for name, content in files.items():
        write_whole(directory / name, content)
    return [directory / name for name in files]


_WRITERS: dict[str, Callable[[Survey, Path], list[Path]]] = {
    "csv": _csv,
    "uavrt": _uavrt,
    **{name: _one_file(name) for name in ONE_FILE},
    "geopackage": _geopackage,
    "movebank": lambda survey, to: _written(
        to,
        {
            "movebank.csv": tables.movebank_csv(survey),
            "movebank-reference-data.csv": tables.movebank_reference_csv(survey),
        },
    ),
    "geotiff": _geotiff,
    "motus": _motus,
}
EXPORT_FORMATS = tuple(_WRITERS)
