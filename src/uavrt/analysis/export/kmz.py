"""Export a survey as KMZ (OGC KML 2.2 in a zip file), which Google Earth opens offline.

The icon and each tag's heat map are separate files in the zip file; styles are defined once.
"""

import io
import math
import zipfile
from collections.abc import Iterable
from xml.etree import ElementTree as ET

from uavrt.analysis.export.geojson import (
    bearing_properties,
    integrated_places,
    integrated_regions,
)
from uavrt.analysis.measure.pulse_shapes import (
    REGION_SHARES,
    Located,
    Point,
    path_points,
    point_of,
    ray,
    ray_length_m,
    region95,
    region_lines,
    wedge,
)
from uavrt.analysis.survey import Survey, thinned
from uavrt.core.clock import iso_utc
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import PulsePose
from uavrt.formats.png import disc, heat, png_bytes, signal
from uavrt.formats.xml_text import add_text
from uavrt.localization.position.levels.strongest import SignalSurface
from uavrt.localization.results import Position, PositionGrid

NAMESPACE = "http://www.opengis.net/kml/2.2"
_STYLES = {
    # KML's colours are opacity, blue, green, red.
    "track": ("ffb0b0b0", None, 1.5),
    "bearing": ("ff00a5ff", None, 2.0),
    "wedge": ("8000a5ff", "2000a5ff", 1.0),
    "region": ("ff2828d7", "402828d7", 2.0),
    "outline": ("ff2828d7", None, 1.0),
    "whole": ("ffa779cc", "40a779cc", 1.0),
}
_PICTURES = ("GroundOverlay", "Icon")


def kmz_bytes(survey: Survey) -> bytes:
    """Encode the track, and each tag's pulses, bearings, position and heat map, as KMZ."""
    files: dict[str, bytes] = {"files/dot.png": png_bytes(disc(7, (31, 119, 180)))}
    files["files/ring.png"] = png_bytes(disc(7, (204, 121, 167)))
    files["files/tag.png"] = png_bytes(disc(11, (215, 40, 40)))
    content = ET.tostring(_document(survey, files), encoding="utf-8", xml_declaration=True)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        # The first .kml of the archive is the one that is opened.
        archive.writestr("doc.kml", content)
        for name, data in files.items():
            archive.writestr(name, data)
    return packed.getvalue()


def kml_text(survey: Survey) -> str:
    """Write a survey as plain KML, without pictures."""
    root = _document(survey, {})
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in _PICTURES:
                parent.remove(child)
    return ET.tostring(root, encoding="unicode", xml_declaration=True)


def _document(survey: Survey, files: dict[str, bytes]) -> ET.Element:
    """Create the KML document, and store the pictures that it uses in `files`."""
    root = ET.Element("kml", xmlns=NAMESPACE)
    document = ET.SubElement(root, "Document")
    add_text(document, "name", survey.name)
    vehicle = None if survey.vehicle is None else f"vehicle {survey.vehicle}"
    if vehicle is not None:
        add_text(document, "description", vehicle)
    _styles(document)
    track = list(map(point_of, thinned(survey.track)))
    if len(track) > 1:
        _mark(document, "track", "track", "LineString", [track], vehicle)
    for tag_id in survey.tag_ids:
        _tag(document, survey, tag_id, files)
    for seen in survey.marks:
        _mark(document, seen.text or "mark", "mark", "Point", _at(seen), time_ns=seen.time_ns)
    return root


def _at(place: Located) -> list[list[Point]]:
    return [[point_of(place)]]


def _styles(document: ET.Element) -> None:
    for name, (line, area, width) in _STYLES.items():
        style = ET.SubElement(document, "Style", id=name)
        drawn = ET.SubElement(style, "LineStyle")
        add_text(drawn, "color", line)
        add_text(drawn, "width", str(width))
        if area is not None:
            add_text(ET.SubElement(style, "PolyStyle"), "color", area)
    for name, file, size in (
        *(("pulse", "dot", 0.4), ("integrated", "ring", 0.4), ("position", "tag", 1.0)),
        ("mark", "dot", 1.0),
    ):
        style = ET.SubElement(document, "Style", id=name)
        icon_style = ET.SubElement(style, "IconStyle")
        add_text(icon_style, "scale", str(size))
        add_text(ET.SubElement(icon_style, "Icon"), "href", f"files/{file}.png")
        add_text(
            ET.SubElement(style, "LabelStyle"),
            "scale",
            "0" if name in ("pulse", "integrated") else "1",
        )


def _tag(document: ET.Element, survey: Survey, tag_id: int, files: dict[str, bytes]) -> None:
    name = survey.label(tag_id)
    folder = _folder(document, name)
    position = survey.placed(tag_id)
    if position is not None:
        text, time_ns = _described(survey, position), survey.position_time_ns(tag_id)
        _mark(folder, name, "position", "Point", _at(position), text, time_ns)
        if (area := region95(position)) is not None:
            _mark(folder, f"{name} 95 %", "region", "Polygon", [area])
        for share in REGION_SHARES:
            if lines := region_lines(position, share):
                _mark(folder, f"{name}, {share} %", "outline", "MultiLineString", lines)
        if position.grid is not None:
            file = f"files/heat_{tag_id}.png"
            files[file] = png_bytes(heat(position.grid.probability[::-1]))
            _overlay(folder, f"{name} probability", file, position.grid)
        _track(folder, name, position)
    _signal(folder, survey, tag_id, files)
    _bearings(folder, survey, tag_id)
    _pulses(folder, "pulses", "pulse", survey.pulses_of(tag_id))
    hindsight = survey.integrated_of(tag_id)
    _pulses(folder, "pulses found after the flight (integrated)", "integrated", hindsight)
    _whole(folder, survey, tag_id)


def _whole(folder: ET.Element, survey: Survey, tag_id: int) -> None:
    for place, properties in integrated_places(survey):
        if properties["tag_id"] == tag_id:
            percent = 100.0 * (properties["probability"] or 0.0)
            name = f"{survey.label(tag_id)}, whole flight, {percent:.0f} %"
            _mark(folder, name, "position", "Point", _at(place))
    for rings, properties in integrated_regions(survey):
        if properties["tag_id"] == tag_id and properties["share"] == 95:
            name = f"{survey.label(tag_id)}, whole flight, 95 %"
            _mark(folder, name, "whole", "MultiPolygon", rings)


def _track(folder: ET.Element, name: str, position: Position) -> None:
    if len(position.track) < 2:
        return
    inner = _folder(folder, f"{name} track")
    _mark(inner, f"{name} track", "outline", "LineString", [path_points(position)])
    for one in position.track:
        within = f"within {one.radius95_m:.0f} m with 95 %"
        _mark(inner, within, "pulse", "Point", _at(one), time_ns=one.time_ns)


def _signal(folder: ET.Element, survey: Survey, tag_id: int, files: dict[str, bytes]) -> None:
    """Map a tag's signal strength in the folder, with a mark where it is strongest."""
    found = survey.signal_of(tag_id)
    if found is None:
        return
    if found.strongest is not None:
        loudest = found.strongest
        text = f"{loudest.snr_db:.0f} dB; the tag is about {loudest.ring_radius_m:.0f} m away"
        _mark(folder, "strongest signal", "pulse", "Point", _at(loudest), text)
    if found.surface is not None:
        file = f"files/signal_{tag_id}.png"
        files[file] = png_bytes(signal(found.surface.snr_db[::-1]))
        _overlay(folder, "signal strength", file, found.surface)
    if found.layers:
        inner = _folder(folder, "signal strength by height")
        for number, layer in enumerate(found.layers):
            if layer.surface is None:
                continue
            file = f"files/signal_{tag_id}_{number}.png"
            files[file] = png_bytes(signal(layer.surface.snr_db[::-1]))
            middle_m = _start_amsl_m(survey) + (layer.low_m + layer.high_m) / 2.0
            _overlay(inner, layer.name, file, layer.surface, amsl_m=middle_m)


def _start_amsl_m(survey: Survey) -> float:
    """Altitude above mean sea level from which the survey's heights are measured [m]; NaN if
    unknown.
    """
    first = survey.track[0]
    return first.altitude_amsl_m - first.altitude_relative_m


def _described(survey: Survey, position: Position) -> str:
    text = f"{position.latitude_deg:.5f}, {position.longitude_deg:.5f}"
    if position.radius95_m is not None:
        text += f", within {position.radius95_m:.0f} m with 95 %"
    if position.pulses:
        text += f"; from the strength of {position.pulses} pulses"
    else:
        text += f"; from {position.stations} bearings"
    heard = [] if survey.vehicle is None else [f"received by vehicle {survey.vehicle}"]
    return "; ".join([text, *heard, *(one.text for one in position.cautions)])


def _bearings(folder: ET.Element, survey: Survey, tag_id: int) -> None:
    position = survey.placed(tag_id)
    for one, properties in zip(survey.bearings, bearing_properties(survey), strict=True):
        if one.tag_id != tag_id:
            continue
        length_m = ray_length_m(one, position)
        name = f"{one.bearing.bearing_deg:.0f}°"
        description = "; ".join(f"{key}: {value}" for key, value in properties.items())
        _mark(folder, name, "bearing", "LineString", [ray(one, length_m)], description)
        if (area := wedge(one, length_m)) is not None:
            _mark(folder, f"{name}, 90 %", "wedge", "Polygon", [area])


def _pulses(folder: ET.Element, name: str, style: str, found: Iterable[PulsePose]) -> None:
    pulses = [(one.pulse, one.pose) for one in found if one.pose is not None]
    if not pulses:
        return
    inner = _folder(folder, name)
    for pulse, pose in pulses:
        level = f"{pulse.snr_db:.1f} dB" if math.isfinite(pulse.snr_db) else ""
        _mark(inner, level, style, "Point", _at(pose), time_ns=pulse.start_time_ns)


def _overlay(
    folder: ET.Element,
    name: str,
    file: str,
    grid: PositionGrid | SignalSurface,
    *,
    amsl_m: float | None = None,
) -> None:
    overlay = ET.SubElement(folder, "GroundOverlay")
    add_text(overlay, "name", name)
    if amsl_m is not None:
        add_text(overlay, "visibility", "0")  # several above each other hide each other
    add_text(ET.SubElement(overlay, "Icon"), "href", file)
    if amsl_m is not None and math.isfinite(amsl_m):
        add_text(overlay, "altitude", f"{amsl_m:.1f}")
        add_text(overlay, "altitudeMode", "absolute")
    west, south, east, north = bounds(grid)
    box = ET.SubElement(overlay, "LatLonBox")
    for key, value in (("north", north), ("south", south), ("east", east), ("west", west)):
        add_text(box, key, f"{value:.8f}")


def bounds(grid: PositionGrid | SignalSurface) -> tuple[float, float, float, float]:
    """West, south, east and north edge of a heat map [deg], computed along its middle lines.

    The cells are squares in the tangent plane. At 3 km and 60° latitude the error is 1.2 m, far
    less than a cell.
    """
    plane = TangentPlane(latitude_deg=grid.latitude_deg, longitude_deg=grid.longitude_deg)
    half_x, half_y = (abs(axis[1] - axis[0]) / 2 for axis in (grid.east_m, grid.north_m))
    middle_x, middle_y = grid.east_m.mean(), grid.north_m.mean()
    _, west = plane.to_geodetic(grid.east_m.min() - half_x, middle_y)
    _, east = plane.to_geodetic(grid.east_m.max() + half_x, middle_y)
    south, _ = plane.to_geodetic(middle_x, grid.north_m.min() - half_y)
    north, _ = plane.to_geodetic(middle_x, grid.north_m.max() + half_y)
    return float(west), float(south), float(east), float(north)


def _folder(parent: ET.Element, name: str) -> ET.Element:
    folder = ET.SubElement(parent, "Folder")
    add_text(folder, "name", name)
    return folder


def _mark(
    parent: ET.Element,
    name: str,
    style: str,
    kind: str,
    parts: list[list[Point]],
    description: str | None = None,
    time_ns: int | None = None,
) -> None:
    """Add a placemark of `kind` Point, LineString or Polygon, or its Multi- variant."""
    mark = ET.SubElement(parent, "Placemark")
    add_text(mark, "name", name)
    if description is not None:
        add_text(mark, "description", description)
    if time_ns is not None:
        add_text(ET.SubElement(mark, "TimeStamp"), "when", iso_utc(time_ns))
    add_text(mark, "styleUrl", f"#{style}")
    shapes = ET.SubElement(mark, "MultiGeometry") if kind.startswith("Multi") else mark
    for points in parts:
        shape = ET.SubElement(shapes, kind.removeprefix("Multi"))
        if shape.tag != "Point":
            add_text(shape, "tessellate", "1")
        if shape.tag == "Polygon":
            shape = ET.SubElement(ET.SubElement(shape, "outerBoundaryIs"), "LinearRing")
        text = " ".join(f"{longitude:.8f},{latitude:.8f}" for longitude, latitude in points)
        add_text(shape, "coordinates", text)
