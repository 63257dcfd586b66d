"""Export an archive: one folder per flight, and GeoParquet files of all flights."""

import json
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from uavrt.analysis.archive.parquet.months import quoted
from uavrt.analysis.archive.parquet.parquet_tables import (
    BEARINGS,
    POSITIONS,
    SCHEMA_VERSION,
    encoded,
    pulse_of,
)
from uavrt.analysis.archive.parquet.questions import ask
from uavrt.analysis.archive.steps.flight_work import PATH_FIELDS
from uavrt.analysis.export.written import EXPORT_FORMATS, export_survey
from uavrt.analysis.survey import Survey
from uavrt.core.atomic_file import make_directories, replacing
from uavrt.core.errors import FormatError, NotFound, RecordingError, os_errors_as
from uavrt.core.messages import FlightInfo, Pose, PulsePose
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.localization.estimates.flight_estimates import TagBearing, TagPosition
from uavrt.localization.results import Bearing, Caution, Ellipse, Position, TrackPoint

if TYPE_CHECKING:
    import pyarrow as pa

GEOPARQUET = "geoparquet"
FORMATS = (*(name for name in EXPORT_FORMATS if name != "geotiff"), GEOPARQUET)
"""Export formats of an archive; GeoTIFF is not one, as no heat maps are stored."""
_IN_NAMES = " !#$&'()+,;=@[]{}~"
_Rows = list[dict[str, Any]]


def export_archive(
    archive: Path,
    directory: Path,
    formats: Sequence[str] | None = None,
    flights: Sequence[str] | None = None,
) -> list[Path]:
    """Write flights in the formats of `uavrt export`, and all of them as GeoParquet.

    Parameters
    ----------
    archive : Path
        Output of a batch.
    directory : Path
        Gets a folder for each flight, and the GeoParquet files.
    formats : sequence of str, optional
        From `FORMATS`; None: all.
    flights : sequence of str, optional
        Names of the flights to write; None: all.

    Returns
    -------
    list of Path
        The written files.

    Raises
    ------
    FormatError
        There is no archive.
    RecordingError
        A file cannot be written.
    UsageError
        There is no such format or flight.
    """
    chosen = FORMATS if formats is None else formats
    if unknown := sorted(set(chosen) - set(FORMATS)):
        raise NotFound(
            f"there is no format {', '.join(unknown)}",
            remedy=f"Choose from {', '.join(FORMATS)}",
        )
    known = flights_in(archive)
    if flights is not None and (missing := sorted(set(flights) - set(known))):
        raise NotFound(
            f"the archive has no flight {missing[0]}",
            remedy="List the flights with uavrt archive list",
        )
    names = known if flights is None else list(flights)
    written = []
    if each := [name for name in chosen if name != GEOPARQUET]:
        for name in names:
            survey = survey_of(archive, name)
            if survey.pulse_poses:
                written += export_survey(survey, folder_for(directory, name), each)
    if GEOPARQUET in chosen:
        written += [
            _geoparquet(archive, table, names if flights else None, directory)
            for table in (BEARINGS, POSITIONS)
        ]
    return written


def folder_for(directory: Path, flight: str) -> Path:
    """Folder for a flight in `directory`; its name is valid on all operating systems."""
    parts = (encoded(one, _IN_NAMES) for one in flight.split("/"))
    return directory.joinpath(
        *(one if one.strip(".") else one.replace(".", "%2E") for one in parts)
    )


def flights_in(archive: Path) -> list[str]:
    """Names of the flights that have pulses; raises `FormatError` if there is no archive."""
    rows = ask(archive, "SELECT DISTINCT flight FROM pulses ORDER BY flight")
    names: list[str] = rows["flight"].to_pylist()
    return names


def survey_of(archive: Path, flight: str) -> Survey:
    """Collect a flight's data from an archive's tables, and its track if the flight's directory
    still exists.

    Raises `FormatError` if there is no archive.
    """
    which = f"WHERE flight = {quoted(flight)}"
    pulses = _pulse_poses(
        ask(
            archive, f"SELECT * FROM pulses {which} ORDER BY start_time_ns, tag_id"
        ).to_pylist(),
        ask(archive, f"SELECT * FROM poses {which}").to_pylist(),
    )
    bearings = ask(archive, f"SELECT * FROM bearings {which} ORDER BY start_time_ns, tag_id")
    positions = ask(archive, f"SELECT * FROM positions {which} ORDER BY tag_id")
    about = ask(archive, f"SELECT path, antenna FROM flights {which}").to_pylist()
    info, track = _flown(about)
    return Survey(
        name=flight,
        kind="flight",
        antenna=about[0]["antenna"] if about else "",
        pulse_poses=pulses,
        track=track or tuple(one.pose for one in pulses if one.pose is not None),
        bearings=tuple(map(_bearing, bearings.to_pylist())),
        positions=tuple(map(_position, positions.to_pylist())),
        info=info,
    )


def _flown(about: _Rows) -> tuple[FlightInfo | None, tuple[Pose, ...]]:
    for row in about:
        if FlightLayout(Path(row["path"])).database.is_file():
            try:
                flight = read_flight(row["path"])
            except FormatError:
                continue  # the tables suffice
            return flight.info, flight.poses
    return None, ()


def _pulse_poses(pulses: _Rows, poses: _Rows) -> tuple[PulsePose, ...]:
    at = {(row["recording"], row["tag_id"], row["start_time_ns"]): row for row in poses}
    found = []
    for row in pulses:
        where = at.get((row["recording"], row["tag_id"], row["start_time_ns"]))
        pose = None
        if where is not None:
            wxyz = tuple(where["quaternion_wxyz"])
            pose = Pose(**_shared(Pose, where) | {"quaternion_wxyz": wxyz})
        found.append(PulsePose(pulse=pulse_of(row), pose=pose))
    return tuple(found)


def _bearing(row: dict[str, Any]) -> TagBearing:
    low_deg, high_deg = row["interval90_from_deg"], row["interval90_to_deg"]
    interval90_deg = None if low_deg is None else (low_deg, high_deg)
    bearing = Bearing(interval90_deg=interval90_deg, **_shared(Bearing, row))
    # The column `flight` is a name, the field a number among flights read together.
    return TagBearing(**_shared(TagBearing, row) | {"bearing": bearing, "flight": 0})


def _shared(record: type, row: dict[str, Any]) -> dict[str, Any]:
    """Values of a table row's columns that are fields of the dataclass `record`."""
    names = [one.name for one in fields(record)]
    return {name: row[name] for name in names if name in row}


def _position(row: dict[str, Any]) -> TagPosition:
    ellipse = None
    if row["semi_major95_m"] is not None:
        ellipse = Ellipse(
            semi_major_m=row["semi_major95_m"],
            semi_minor_m=row["semi_minor95_m"],
            orientation_deg=row["orientation_deg"],
        )
    way = zip(*(row[f"track_{name}"] for name in PATH_FIELDS), strict=True)
    more = {
        "stations": row["bearings"],
        "pulses": row["powers"],
        "ellipse95": ellipse,
        "cautions": _cautions(row),
        "track": tuple(TrackPoint(**dict(zip(PATH_FIELDS, one, strict=True))) for one in way),
    }
    position = Position(**_shared(Position, row) | more)
    return TagPosition(tag_id=row["tag_id"], position=position)


def _cautions(row: dict[str, Any]) -> tuple[Caution, ...]:
    names, texts = row["cautions"], row["cautions_in_words"]
    return tuple(
        Caution(name=cast("Any", name), text=text)
        for name, text in zip(names.split(", "), texts.split("\n"), strict=True)
        if name
    )


def _geoparquet(archive: Path, table: str, flights: list[str] | None, directory: Path) -> Path:
    import pyarrow.parquet as pq

    which = "" if flights is None else f"WHERE flight IN ({', '.join(map(quoted, flights))})"
    rows = ask(archive, f"SELECT * FROM {table} {which} ORDER BY flight, tag_id, start_time_ns")
    target = directory / f"{table}.parquet"
    with os_errors_as(RecordingError, f"cannot write {target}", "Choose a writable directory"):
        make_directories(directory)
        with replacing(target) as part:
            pq.write_table(with_points(rows), part, compression="zstd")
    return target


def with_points(rows: "pa.Table") -> "pa.Table":
    """Add a column `geometry` of points on WGS 84, and the metadata of GeoParquet 1.1.

    The metadata have no `crs`: its default is longitude and latitude of WGS 84
    (https://geoparquet.org/releases/v1.1.0/).
    """
    import pyarrow as pa

    longitude, latitude = (
        rows[name].to_numpy().astype(np.float64) for name in ("longitude_deg", "latitude_deg")
    )
    points = np.empty(
        len(rows), np.dtype([("order", "u1"), ("kind", "<u4"), ("x", "<f8"), ("y", "<f8")])
    )
    points["order"], points["kind"], points["x"], points["y"] = 1, 1, longitude, latitude
    size = points.dtype.itemsize
    offsets = np.arange(0, size * len(rows) + 1, size, dtype=np.int32)
    geometry = pa.Array.from_buffers(
        pa.binary(), len(rows), [None, pa.py_buffer(offsets), pa.py_buffer(points.tobytes())]
    )
    column: dict[str, object] = {"encoding": "WKB", "geometry_types": ["Point"]}
    if len(rows):
        column["bbox"] = [
            *(float(longitude.min()), float(latitude.min())),
            *(float(longitude.max()), float(latitude.max())),
        ]
    geo = {"version": "1.1.0", "primary_column": "geometry", "columns": {"geometry": column}}
    return rows.append_column("geometry", geometry).replace_schema_metadata(
        {"geo": json.dumps(geo), "uavrt_schema": SCHEMA_VERSION}
    )
