"""Read outlines of areas from GeoJSON, KML and QGroundControl's plans; no I/O.

In a plan (version 1), these are the ``polygon`` of a survey, and the polygons and circles of a
fence.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from math import cos, pi, sin
from typing import Any
from xml.etree import ElementTree as ET

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import FormatError
from uavrt.core.foreign import SHAPES, read_json, read_xml
from uavrt.core.messages import KeepOut
from uavrt.guidance.operator_orders import Place

CIRCLE_CORNERS = 20
"""Number of corners of the polygon that approximates a circle; an order may have as many."""
MOST_KEEP_OUT = 100
MOST_OUTLINES = 1000
MOST_CORNERS = 1000
"""Largest number of corners of an outline; planning time grows with its square."""
MOST_NAME = 24
_NOT_OUTLINES = frozenset(
    ("Point", "LineString", "LinearRing", "Track", "MultiTrack", "Model", "NetworkLink")
)
"""KML elements that are not areas: points, lines, models, links to other files."""
_REMEDY = (
    "Draw one outline without holes, in QGIS or on geojson.io (GeoJSON), in Google Earth "
    "(KML), or as a survey in QGroundControl (.plan)"
)
_KEEP_OUT_REMEDY = (
    'Mark them: GeoJSON with "keep_out": true, a point with its "radius_m"; KML polygons named '
    '"keep out …"; in a .plan of QGroundControl its exclusion fences'
)


def area_in(text: str, name: str) -> tuple[Place, ...]:
    """Return the corners of the only area to search in a file's text.

    Raises `FormatError` if there is not exactly one.
    """
    with in_words(f"{name} contains no usable area", _REMEDY):
        outlines = [one for one in _read(text) if not one.keep_out]
        if len(outlines) != 1:
            raise ValueError(f"the file has {len(outlines)} outlines; give exactly one")
        if outlines[0].holes:
            raise ValueError("the outline has holes, which are not supported")
        return _checked(outlines[0].corners)


def keep_out_in(text: str, name: str, *, every: bool = False) -> tuple[KeepOut, ...]:
    """Return the areas in a file's text over which nothing may fly.

    In GeoJSON these are features with ``"keep_out": true`` (a Point needs ``radius_m``), in KML
    polygons with a name that begins with "keep out", and in a plan the exclusion fences. Any
    other feature that is marked so raises an error with its name, so that none is overlooked.
    With `every`, all outlines and all GeoJSON Points are excluded areas, marked or not. Raises
    `FormatError` if the text has none of the three formats, or if an area is invalid.
    """
    with in_words(f"{name} contains no usable keep-out areas", _KEEP_OUT_REMEDY):
        found = tuple(
            _kept(one)
            for one in _read(text, every=every)
            if one.keep_out or (every and one.mixed)
        )
        if len(found) > MOST_KEEP_OUT:
            raise ValueError(
                f"the file has {len(found)} areas; at most {MOST_KEEP_OUT} are allowed"
            )
        if every and not found:
            raise ValueError("the file has no area")
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class _Outline:
    corners: list[tuple[float, float]]
    keep_out: bool = False
    mixed: bool = True
    """True if the format does not define whether an outline is to be searched or excluded."""
    radius_m: float | None = None
    name: str = ""
    holes: bool = False


@contextmanager
def in_words(what: str, remedy: str) -> Iterator[None]:
    """Context that converts errors of parsing to a `FormatError` that begins with `what`."""
    try:
        yield
    except (
        ValueError,
        TypeError,
        KeyError,
        AttributeError,
        IndexError,
        OverflowError,
        RecursionError,
        ET.ParseError,
    ) as error:
        reason = str(error)
        if isinstance(error, KeyError):
            reason = f"an object has no {error}"
        elif isinstance(error, AttributeError | TypeError | IndexError):
            reason = "the file is neither GeoJSON nor a plan: a value has the wrong type"
        raise FormatError(f"{what}: {reason}", remedy=remedy) from error


def _read(text: str, *, every: bool = False) -> list[_Outline]:
    read = _of_kml if text.lstrip("\ufeff \t\r\n")[:1] == "<" else _of_json
    return _bounded(read(text, every))


def _bounded(outlines: Iterator[_Outline]) -> list[_Outline]:
    found = list(islice(outlines, MOST_OUTLINES + 1))
    if len(found) > MOST_OUTLINES:
        raise ValueError(f"the file has more than {MOST_OUTLINES} outlines")
    return found


def _checked(corners: list[tuple[float, float]], least: int = 3) -> tuple[Place, ...]:
    places = tuple((float(north), float(east)) for north, east in corners)
    if places[:1] == places[-1:] and len(places) > 1:
        places = places[:-1]
    check_places(places)
    if len(places) > MOST_CORNERS:
        raise ValueError(
            f"an outline has {len(places)} corners; at most {MOST_CORNERS} are allowed"
        )
    if len(places) < least:
        raise ValueError(f"an outline needs three corners or more, got {len(places)}")
    return places


def check_places(places: tuple[Place, ...]) -> None:
    """Raise `ValueError` if a latitude or longitude is invalid."""
    for north, east in places:
        if not (abs(north) <= 90 and abs(east) <= 180):
            raise ValueError(f"{north:g}, {east:g} is not a position on earth")


def _kept(one: _Outline) -> KeepOut:
    """Convert an outline to an excluded area; its holes are excluded too."""
    radius, name = one.radius_m, one.name[:MOST_NAME].encode("utf-8", "replace").decode()
    if radius is None:
        if len(one.corners) == 1:
            raise ValueError(f'the excluded point "{name}" has no radius_m')
        return KeepOut(places=_checked(one.corners), name=name)
    if isinstance(radius, bool) or not 0.0 < float(radius) < 1e5:
        raise ValueError(f"the radius of {radius} m is not positive")
    return KeepOut(places=_checked(one.corners, 1), radius_m=float(radius), name=name)


def circle(center: Place, radius_m: float) -> tuple[Place, ...]:
    """Return the corners of a polygon that approximates a circle.

    Raises `FormatError` unless the radius is positive [m].
    """
    if not 0.0 < radius_m < 1e5:
        raise FormatError(
            f"the circle's radius is {radius_m:g} m, but must be above 0",
            remedy="Give a radius above 0",
        )
    plane = TangentPlane(latitude_deg=center[0], longitude_deg=center[1])
    angles = [2.0 * pi * number / CIRCLE_CORNERS for number in range(CIRCLE_CORNERS)]
    places = [plane.to_geodetic(radius_m * sin(a), radius_m * cos(a)) for a in angles]
    return tuple((float(north), float(east)) for north, east in places)


def _of_json(text: str, every: bool) -> Iterator[_Outline]:
    found = read_json(text, SHAPES)
    if found.get("fileType") == "Plan":
        yield from _of_plan(found)
    else:
        yield from _shapes(found, {}, every)


def _shapes(found: Any, properties: Any, every: bool) -> Iterator[_Outline]:
    """Yield the polygons in GeoJSON, and the points that are to be excluded."""
    keep_out = bool(properties.get("keep_out", False))
    name = str(properties.get("name") or "")
    match found["type"]:
        case "FeatureCollection":
            for feature in found["features"]:
                yield from _shapes(feature, {}, every)
        case "Feature":
            yield from _shapes(found["geometry"], found.get("properties") or {}, every)
        case "GeometryCollection" if found["geometries"]:
            for member in found["geometries"]:
                yield from _shapes(member, properties, every)
        case "Polygon" | "MultiPolygon" if found["coordinates"]:
            several = found["type"] == "MultiPolygon"
            for rings in found["coordinates"] if several else [found["coordinates"]]:
                yield _Outline(
                    corners=[(north, east) for east, north, *_ in rings[0]],
                    keep_out=keep_out,
                    name=name,
                    holes=len(rings) != 1,
                )
        case "Point" if keep_out or every:
            east, north, *_ = found["coordinates"]
            radius = properties.get("radius_m")
            yield _Outline(corners=[(north, east)], keep_out=True, radius_m=radius, name=name)
        case other if keep_out or every:
            raise _not_understood(name, other)


def _not_understood(name: str, kind: object) -> ValueError:
    """Return the error for an excluded area `name` of the unsupported kind `kind`."""
    who = f'"{name[:MOST_NAME]}"' if name else "an unnamed feature"
    return ValueError(f"{who} is a {kind} without an outline")


def _of_plan(found: Any) -> Iterator[_Outline]:
    """Yield the survey areas of a QGroundControl plan, then its exclusion fences.

    Without a survey, the inclusion fences replace it.
    """
    surveyed = [
        _Outline(corners=[(north, east) for north, east, *_ in item["polygon"]], mixed=False)
        for item in found.get("mission", {}).get("items", [])
        if "polygon" in item
    ]
    fences = _bounded(_fences(found.get("geoFence", {})))
    yield from surveyed or [one for one in fences if not one.keep_out]
    yield from (one for one in fences if one.keep_out)


def _fences(fence: Any) -> Iterator[_Outline]:
    for one in fence.get("polygons", []):
        corners = [(north, east) for north, east, *_ in one["polygon"]]
        yield _Outline(corners=corners, keep_out=not one.get("inclusion", True), mixed=False)
    for one in fence.get("circles", []):
        north, east = one["circle"]["center"][:2]
        place, radius = (float(north), float(east)), float(one["circle"]["radius"])
        if one.get("inclusion", True):
            yield _Outline(corners=list(circle(place, radius)), mixed=False)
        else:
            yield _Outline(corners=[place], keep_out=True, radius_m=radius, mixed=False)


def _of_kml(text: str, every: bool) -> Iterator[_Outline]:
    root = read_xml(text, SHAPES, "kml")
    names = {
        polygon: _kml_name(placemark)
        for placemark in root.iter()
        if _named(placemark, "Placemark")
        for polygon in placemark.iter()
    }
    _check_kml(root, names, every)
    for polygon in (one for one in root.iter() if _named(one, "Polygon")):
        ring, *inner = [one for one in polygon.iter() if _named(one, "coordinates")]
        corners = [corner.split(",") for corner in (ring.text or "").split()]
        name = names.get(polygon, "")
        yield _Outline(
            corners=[(float(corner[1]), float(corner[0])) for corner in corners],
            keep_out=_keeps_out(name),
            name=name,
            holes=bool(inner) or any(_named(one, "innerBoundaryIs") for one in polygon.iter()),
        )


def _check_kml(root: ET.Element, names: dict[ET.Element, str], every: bool) -> None:
    """Raise `ValueError` for a feature marked as excluded that is not a polygon."""
    polygons = [one for one in root.iter() if _named(one, "Polygon")]
    within = {inner for polygon in polygons for inner in polygon.iter()}
    for one in root.iter():
        name, kind = names.get(one, ""), one.tag.rpartition("}")[2]
        if not (every or _keeps_out(name)):
            continue
        empty = kind == "Placemark" and within.isdisjoint(one.iter())
        if empty or (kind in _NOT_OUTLINES and one not in within):
            raise _not_understood(name, kind)


def _keeps_out(name: str) -> bool:
    return name.lower().replace("-", " ").startswith("keep out")


def _kml_name(placemark: ET.Element) -> str:
    return next((one.text or "" for one in placemark if _named(one, "name")), "").strip()


def _named(element: ET.Element, name: str) -> bool:
    return element.tag.rpartition("}")[2] == name
