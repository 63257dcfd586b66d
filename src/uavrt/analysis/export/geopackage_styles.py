"""Write QML styles of GeoPackage layers into the table ``layer_styles``, from which QGIS reads
them.

Each style is a QML document with one symbol. Layers with times are controlled by QGIS's
temporal controller.
"""

import sqlite3
from xml.sax.saxutils import quoteattr

SCHEMA = """
CREATE TABLE layer_styles (
    id INTEGER PRIMARY KEY AUTOINCREMENT, f_table_catalog TEXT, f_table_schema TEXT,
    f_table_name TEXT, f_geometry_column TEXT, styleName TEXT, styleQML TEXT, styleSLD TEXT,
    useAsDefault BOOLEAN, description TEXT, owner TEXT, ui TEXT,
    update_time DATETIME DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now'))
);
INSERT INTO gpkg_contents (table_name, data_type, identifier, srs_id)
    VALUES ('layer_styles', 'attributes', 'layer_styles', 0);
"""
_COLOURS = {
    "pulses": "33,145,140,255",
    "track": "81,98,107,255",
    "bearings": "213,94,0,255",
    "bearing_wedges": "213,94,0,40",
    "positions": "179,38,30,255",
    "tag_tracks": "179,38,30,160",
    "regions95": "179,38,30,50",
    "region_outlines": "179,38,30,255",
    "integrated_places": "204,121,167,255",
    "integrated_regions": "204,121,167,50",
    "marks": "0,114,178,255",
    "strongest_signal": "22,35,42,255",
}
_TIMED = (
    "pulses",
    "bearings",
    "bearing_wedges",
    "positions",
    "regions95",
    "region_outlines",
    "tag_tracks",
    "marks",
)


def add_style(database: sqlite3.Connection, table: str, kind: str) -> None:
    """Add the default style of a layer to ``layer_styles``."""
    database.execute(
        "INSERT INTO layer_styles (f_table_catalog, f_table_schema, f_table_name,"
        " f_geometry_column, styleName, styleQML, styleSLD, useAsDefault, description, owner)"
        " VALUES ('', '', ?, 'geom', ?, ?, '', 1, 'uavrt', '')",
        (table, table, qml(table, kind)),
    )


def qml(table: str, kind: str) -> str:
    """Return the QML document that contains a layer's symbol."""
    colour = _COLOURS.get(table, "11,93,117,255")
    symbol, layer, options = {
        "POINT": ("marker", "SimpleMarker", {"name": _shape(table), "size": _size(table)}),
        "LINESTRING": ("line", "SimpleLine", {"line_width": "0.5"}),
        "POLYGON": ("fill", "SimpleFill", {"outline_width": "0.4"}),
    }[kind]
    colours = {"line_color": colour} if kind == "LINESTRING" else {"color": colour}
    if kind == "POLYGON":
        colours["outline_color"] = ",".join([*colour.split(",")[:3], "255"])
    items = "".join(
        f'<Option type="QString" name={quoteattr(name)} value={quoteattr(value)}/>'
        for name, value in {**colours, **options}.items()
    )
    temporal = ""
    if table in _TIMED:
        # Mode 1: a single field of date-time; what was heard stays.
        temporal = (
            '<temporal enabled="1" mode="1" startField="time" accumulate="1" '
            'durationUnit="s" fixedDuration="0"/>'
        )
    return (
        '<!DOCTYPE qgis PUBLIC "http://mrcc.com/qgis.dtd" "SYSTEM">'
        '<qgis version="3.22" styleCategories="Symbology|Temporal">'
        f'{temporal}<renderer-v2 type="singleSymbol"><symbols>'
        f'<symbol type="{symbol}" name="0" alpha="1"><layer class="{layer}" enabled="1">'
        f'<Option type="Map">{items}</Option></layer></symbol></symbols></renderer-v2></qgis>'
    )


def _shape(table: str) -> str:
    if table == "strongest_signal":
        return "cross2"
    return "star" if table in ("positions", "integrated_places") else "circle"


def _size(table: str) -> str:
    large = ("positions", "integrated_places", "strongest_signal")
    return "4" if table in large else "1.6"
