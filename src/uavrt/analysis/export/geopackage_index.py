"""Write GeoPackage layers' spatial index: the R-tree extension (OGC 12-128r18, F.3).

Triggers keep the index correct when features are edited. They call functions such as
``ST_MinX``, which a program that edits GeoPackages provides.
"""

import sqlite3
from collections.abc import Sequence

SCHEMA = """
CREATE TABLE gpkg_extensions (
    table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL, definition TEXT NOT NULL,
    scope TEXT NOT NULL, CONSTRAINT ge_tce UNIQUE (table_name, column_name, extension_name)
);
"""
_DEFINITION = "http://www.geopackage.org/spec130/#extension_rtree"
_BOX = "ST_MinX(NEW.geom), ST_MaxX(NEW.geom), ST_MinY(NEW.geom), ST_MaxY(NEW.geom)"
_THERE = "(NEW.geom NOTNULL AND NOT ST_IsEmpty(NEW.geom))"
_GONE = "(NEW.geom ISNULL OR ST_IsEmpty(NEW.geom))"


def add_index(
    database: sqlite3.Connection, table: str, boxes: Sequence[tuple[float, float, float, float]]
) -> None:
    """Build the spatial index of a layer; each box is west, east, south and north [deg]."""
    tree = f"rtree_{table}_geom"
    database.execute(f"CREATE VIRTUAL TABLE {tree} USING rtree(id, minx, maxx, miny, maxy)")
    database.executemany(
        f"INSERT INTO {tree} VALUES (?, ?, ?, ?, ?)",
        [(number, *box) for number, box in enumerate(boxes, start=1)],
    )
    put = f"INSERT OR REPLACE INTO {tree} VALUES (NEW.fid, {_BOX});"
    drop_old = f"DELETE FROM {tree} WHERE id = OLD.fid;"
    drop_both = f"DELETE FROM {tree} WHERE id IN (OLD.fid, NEW.fid);"
    same, other = "OLD.fid = NEW.fid", "OLD.fid != NEW.fid"
    for name, event, when, action in (
        ("insert", "INSERT", _THERE, put),
        ("update1", "UPDATE OF geom", f"{same} AND {_THERE}", put),
        ("update2", "UPDATE OF geom", f"{same} AND {_GONE}", drop_old),
        ("update3", "UPDATE", f"{other} AND {_THERE}", drop_old + put),
        ("update4", "UPDATE", f"{other} AND {_GONE}", drop_both),
        ("delete", "DELETE", "OLD.geom NOT NULL", drop_old),
    ):
        database.execute(
            f"CREATE TRIGGER {tree}_{name} AFTER {event} ON {table} WHEN {when} "
            f"BEGIN {action} END"
        )
    database.execute(
        "INSERT INTO gpkg_extensions VALUES (?, 'geom', 'gpkg_rtree_index', ?, 'write-only')",
        (table, _DEFINITION),
    )
