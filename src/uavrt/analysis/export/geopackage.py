"""Export a survey as OGC GeoPackage 1.3: an SQLite file that QGIS and ArcGIS open as layers.

Lines and areas are cut at the 180° meridian. A geometry is a header of 8 bytes and well-known
binary, both little endian (OGC 12-128r18, §2.1.3)::

    "GP" | version 0 | flags 1 | srs_id 4326 as int32 | WKB

Each layer has a spatial index and a style.
"""

import sqlite3
import struct
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from uavrt.analysis.export.geojson import layers
from uavrt.analysis.export.geopackage_index import SCHEMA as INDEX_SCHEMA
from uavrt.analysis.export.geopackage_index import add_index
from uavrt.analysis.export.geopackage_styles import SCHEMA as STYLE_SCHEMA
from uavrt.analysis.export.geopackage_styles import add_style
from uavrt.analysis.measure.pulse_shapes import Point
from uavrt.analysis.survey import Survey

APPLICATION_ID = 0x47504B47
"""SQLite application id of a GeoPackage: the letters ``GPKG``."""
VERSION = 10300
_WGS84 = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,'
    'AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,'
    'AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],'
    'AUTHORITY["EPSG","4326"]]'
)
_TABLES = """
CREATE TABLE gpkg_spatial_ref_sys (
    srs_name TEXT NOT NULL, srs_id INTEGER PRIMARY KEY, organization TEXT NOT NULL,
    organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT
);
CREATE TABLE gpkg_contents (
    table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
    description TEXT DEFAULT '',
    last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
    min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
    CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id)
);
CREATE TABLE gpkg_geometry_columns (
    table_name TEXT NOT NULL, column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL,
    srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
    CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name),
    CONSTRAINT uk_gc_table_name UNIQUE (table_name),
    CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
    CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id)
);
"""
_SYSTEMS = (
    ("Undefined Cartesian", -1, "NONE", -1, "undefined", None),
    ("Undefined geographic", 0, "NONE", 0, "undefined", None),
    ("WGS 84 geodetic", 4326, "EPSG", 4326, _WGS84, "longitude, latitude in degrees"),
)
_TYPES = {bool: "BOOLEAN", int: "INTEGER", float: "DOUBLE", str: "TEXT"}
_TIMES = ("time", "start", "end")
"""Attributes stored as DATETIME, so that QGIS's temporal controller can use them."""
_WKB = {"POINT": 1, "LINESTRING": 2, "POLYGON": 3}

Feature = tuple[list[Point], dict[str, Any]]


def write_geopackage(survey: Survey, path: Path) -> None:
    """Write a survey as a new GeoPackage file; raises `sqlite3.Error`."""
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        database.execute(f"PRAGMA user_version = {VERSION}")
        database.executescript(_TABLES + INDEX_SCHEMA + STYLE_SCHEMA)
        database.executemany(
            "INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)", _SYSTEMS
        )
        vehicle = {"vehicle": survey.vehicle}
        for _, name, kind, shapes in layers(survey):
            rows = [(part, one | vehicle) for parts, one in shapes for part in parts]
            if name and rows:
                _layer(database, name, kind.removeprefix("MULTI"), rows)


def geometry_blob(kind: str, points: Sequence[Point]) -> bytes:
    """Encode a geometry as GeoPackage header and well-known binary."""
    blob = b"GP" + struct.pack("<BBi", 0, 1, 4326) + struct.pack("<BI", 1, _WKB[kind])
    if kind == "POLYGON":
        blob += struct.pack("<I", 1)
    if kind != "POINT":
        blob += struct.pack("<I", len(points))
    return blob + b"".join(struct.pack("<dd", *point) for point in points)


def _layer(database: sqlite3.Connection, name: str, kind: str, features: list[Feature]) -> None:
    columns = {
        key: "DATETIME"
        if key in _TIMES
        else _column_type([fields[key] for _, fields in features])
        for key in features[0][1]
    }
    described = "".join(f', "{key}" {kind_of}' for key, kind_of in columns.items())
    database.execute(
        f"CREATE TABLE {name} (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,"
        f" geom {kind}{described})"
    )
    xs = [point[0] for points, _ in features for point in points]
    ys = [point[1] for points, _ in features for point in points]
    database.execute(
        "INSERT INTO gpkg_contents (table_name, data_type, identifier, min_x, min_y, max_x,"
        " max_y, srs_id) VALUES (?, 'features', ?, ?, ?, ?, ?, 4326)",
        (name, name, min(xs), min(ys), max(xs), max(ys)),
    )
    database.execute(
        "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, 4326, 0, 0)", (name, kind)
    )
    marks = ", ".join("?" * (1 + len(columns)))
    named = "".join(f', "{key}"' for key in columns)
    database.executemany(
        f"INSERT INTO {name} (geom{named}) VALUES ({marks})",
        [
            (geometry_blob(kind, points), *(_cell(key, value) for key, value in fields.items()))
            for points, fields in features
        ],
    )
    add_index(database, name, [_box(points) for points, _ in features])
    add_style(database, name, kind)


def _box(points: Sequence[Point]) -> tuple[float, float, float, float]:
    xs, ys = [point[0] for point in points], [point[1] for point in points]
    return min(xs), max(xs), min(ys), max(ys)


def _cell(key: str, value: Any) -> Any:
    """Convert an attribute to the type of its column; times are given to milliseconds, as
    clause 1.1.1.1.2 of the GeoPackage standard (OGC 12-128r18) requires for DATETIME.
    """
    if key not in _TIMES or value is None:
        return value
    seconds, _, rest = str(value).rstrip("Z").partition(".")
    return f"{seconds}.{rest[:3].ljust(3, '0')}Z"


def _column_type(values: list[Any]) -> str:
    known = next((value for value in values if value is not None), "")
    return _TYPES[type(known)]
