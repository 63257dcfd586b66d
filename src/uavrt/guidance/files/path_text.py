"""Read flight paths from GeoJSON, KML and QGroundControl's plans; no I/O.

In a plan (version 1), these are waypoints (MAVLink commands 16 to 22 with a position) and the
lines of surveys (``VisualTransectPoints``).
"""

from collections.abc import Iterator
from typing import Any

from uavrt.core.foreign import SHAPES, read_json, read_xml
from uavrt.guidance.files.area_text import check_places, in_words
from uavrt.guidance.operator_orders import Place

_WAYPOINTS = range(16, 23)
_RETURN = 20
_MOST_LINE_PLACES = 20_000
_REMEDY = "Give a QGroundControl plan (.plan), GeoJSON or KML file"


def path_in(text: str, name: str) -> tuple[Place, ...]:
    """Return the positions of the path in a file's text, empty if it has none.

    Raises `FormatError`.
    """
    with in_words(f"{name} contains no usable path", _REMEDY):
        kml = text.lstrip("\ufeff \t\r\n")[:1] == "<"
        places = tuple(_of_kml(text) if kml else _of_json(read_json(text, SHAPES)))
        if len(places) > _MOST_LINE_PLACES:
            raise ValueError(f"the path has more than {_MOST_LINE_PLACES} points")
        check_places(places)
        return places if len(places) > 1 else ()


def _of_json(found: Any) -> Iterator[Place]:
    if found.get("fileType") == "Plan":
        for item in found.get("mission", {}).get("items", []):
            yield from _of_item(item)
        return
    match found["type"]:
        case "FeatureCollection":
            for feature in found["features"]:
                yield from _of_json(feature)
        case "Feature":
            yield from _of_json(found["geometry"])
        case "LineString":
            yield from ((float(north), float(east)) for east, north, *_ in found["coordinates"])


def _of_item(item: Any) -> Iterator[Place]:
    style = item.get("TransectStyleComplexItem")
    if style is not None:
        for north, east, *_ in style.get("VisualTransectPoints", []):
            yield float(north), float(east)
    elif item.get("command") in _WAYPOINTS and item["command"] != _RETURN:
        north, east = item["params"][4:6]
        if north or east:  # QGroundControl writes 0, 0 for "here"
            yield float(north), float(east)


def _of_kml(text: str) -> Iterator[Place]:
    root = read_xml(text, SHAPES, "kml")
    for line in root.iter():
        if line.tag.rpartition("}")[2] != "LineString":
            continue
        for one in line.iter():
            if one.tag.rpartition("}")[2] == "coordinates":
                for corner in (one.text or "").split():
                    east, north, *_ = corner.split(",")
                    yield float(north), float(east)
