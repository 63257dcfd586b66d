"""Export a survey as KMZ (OGC KML 2.2 in a zip), which Google Earth opens without a network.

The icon and each tag's heat map are files in the zip; styles are defined once.
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
    Point,
    path_points,
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
    """Write the track, and pulses, bearings, position and heat map of each tag."""
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
    """Make the KML document, and add the pictures that it refers to to `files`."""
    root = ET.Element("kml", xmlns=NAMESPACE)
    document = ET.SubElement(root, "Document")
    add_text(document, "name", survey.name)
    vehicle = None if survey.vehicle is None else f"vehicle {survey.vehicle}"
    if vehicle is not None:
        add_text(document, "description", vehicle)
    _styles(document)
    track = [(pose.longitude_deg, pose.latitude_deg) for pose in thinned(survey.track)]
    if len(track) > 1:
        _geometry(_placemark(document, "track", "track", vehicle), "LineString", track)
    for tag_id in survey.tag_ids:
        _tag(document, survey, tag_id, files)
    for seen in survey.marks:
        mark = _placemark(document, seen.text or "mark", "mark", time_ns=seen.time_ns)
        _geometry(mark, "Point", [(seen.longitude_deg, seen.latitude_deg)])
    return root


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
    folder = ET.SubElement(document, "Folder")
    name = survey.label(tag_id)
    add_text(folder, "name", name)
    found = survey.position_of(tag_id)
    position = None if found is None else found.position
    if position is not None:
        time_ns = survey.position_time_ns(tag_id)
        mark = _placemark(folder, name, "position", _described(survey, position), time_ns)
        place = (position.longitude_deg, position.latitude_deg)
        _geometry(mark, "Point", [place])
        area = region95(position)
        if area is not None:
            _polygon(_placemark(folder, f"{name} 95 %", "region"), area)
        for share in REGION_SHARES:
            if lines := region_lines(found, share):
                _lines(_placemark(folder, f"{name}, {share} %", "outline"), lines)
        if position.grid is not None:
            file = f"files/heat_{tag_id}.png"
            files[file] = png_bytes(heat(position.grid.probability[::-1]))
            _overlay(folder, f"{name} probability", file, position.grid)
        _track(folder, name, position)
    _signal(folder, survey, tag_id, files)
    _bearings(folder, survey, tag_id)
    _pulses(folder, "pulses", "pulse", survey.pulses_of(tag_id))
    hindsight = [one for one in survey.integrated if one.pulse.tag_id == tag_id]
    _pulses(folder, "pulses seen in hindsight (integrated)", "integrated", hindsight)
    _whole(folder, survey, tag_id)


def _whole(folder: ET.Element, survey: Survey, tag_id: int) -> None:
    for place, properties in integrated_places(survey):
        if properties["tag_id"] == tag_id:
            percent = 100.0 * (properties["probability"] or 0.0)
            name = f"{survey.label(tag_id)}, whole flight, {percent:.0f} %"
            _geometry(_placemark(folder, name, "position"), "Point", [place])
    for rings, properties in integrated_regions(survey):
        if properties["tag_id"] == tag_id and properties["share"] == 95:
            mark = _placemark(folder, f"{survey.label(tag_id)}, whole flight, 95 %", "whole")
            several = ET.SubElement(mark, "MultiGeometry")
            for ring in rings:
                _polygon(several, ring)


def _track(folder: ET.Element, name: str, position: Position) -> None:
    if len(position.track) < 2:
        return
    inner = ET.SubElement(folder, "Folder")
    add_text(inner, "name", f"{name} track")
    _geometry(
        _placemark(inner, f"{name} track", "outline"), "LineString", path_points(position)
    )
    for one in position.track:
        within = f"within {one.radius95_m:.0f} m with 95 %"
        mark = _placemark(inner, within, "pulse", time_ns=one.time_ns)
        _geometry(mark, "Point", [(one.longitude_deg, one.latitude_deg)])


def _signal(folder: ET.Element, survey: Survey, tag_id: int, files: dict[str, bytes]) -> None:
    """Placemark and map of signal strength, labelled as not the tag's position."""
    found = survey.signal_of(tag_id)
    if found is None:
        return
    if found.strongest is not None:
        loudest = found.strongest
        text = f"{loudest.snr_db:.0f} dB; the tag is about {loudest.ring_radius_m:.0f} m away"
        mark = _placemark(folder, "strongest signal", "pulse", text)
        _geometry(mark, "Point", [(loudest.longitude_deg, loudest.latitude_deg)])
    if found.surface is not None:
        file = f"files/signal_{tag_id}.png"
        files[file] = png_bytes(signal(found.surface.snr_db[::-1]))
        _overlay(folder, "signal strength", file, found.surface)
    if found.layers:
        inner = ET.SubElement(folder, "Folder")
        add_text(inner, "name", "signal strength by height")
        for number, layer in enumerate(found.layers):
            if layer.surface is None:
                continue
            file = f"files/signal_{tag_id}_{number}.png"
            files[file] = png_bytes(signal(layer.surface.snr_db[::-1]))
            middle_m = _start_amsl_m(survey) + (layer.low_m + layer.high_m) / 2.0
            _overlay(inner, layer.name, file, layer.surface, amsl_m=middle_m)


def _start_amsl_m(survey: Survey) -> float:
    """Altitude above mean sea level of the survey's height reference [m]; NaN where unknown."""
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
    heard = [] if survey.vehicle is None else [f"heard by vehicle {survey.vehicle}"]
    return "; ".join([text, *heard, *(one.text for one in position.cautions)])


def _bearings(folder: ET.Element, survey: Survey, tag_id: int) -> None:
    found = survey.position_of(tag_id)
    position = None if found is None else found.position
    for one, properties in zip(survey.bearings, bearing_properties(survey), strict=True):
        if one.tag_id != tag_id:
            continue
        length_m = ray_length_m(one, position)
        name = f"{one.bearing.bearing_deg:.0f}°"
        description = "; ".join(f"{key}: {value}" for key, value in properties.items())
        mark = _placemark(folder, name, "bearing", description)
        _geometry(mark, "LineString", ray(one, length_m))
        area = wedge(one, length_m)
        if area is not None:
            _polygon(_placemark(folder, f"{name}, 90 %", "wedge"), area)


def _pulses(folder: ET.Element, name: str, style: str, found: Iterable[PulsePose]) -> None:
    pulses = [one for one in found if one.pose is not None]
    if not pulses:
        return
    inner = ET.SubElement(folder, "Folder")
    add_text(inner, "name", name)
    for one in pulses:
        assert one.pose is not None
        snr = one.pulse.snr_db
        level = f"{snr:.1f} dB" if math.isfinite(snr) else ""
        mark = _placemark(inner, level, style, time_ns=one.pulse.start_time_ns)
        _geometry(mark, "Point", [(one.pose.longitude_deg, one.pose.latitude_deg)])


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
    """West, south, east and north edge of a heat map [deg], along its middle lines.

    The cells are squares of the tangent plane. At 3 km and 60° latitude the error is 1.2 m, far
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


def _placemark(
    parent: ET.Element,
    name: str,
    style: str,
    description: str | None = None,
    time_ns: int | None = None,
) -> ET.Element:
    mark = ET.SubElement(parent, "Placemark")
    add_text(mark, "name", name)
    if description is not None:
        add_text(mark, "description", description)
    if time_ns is not None:
        add_text(ET.SubElement(mark, "TimeStamp"), "when", iso_utc(time_ns))
    add_text(mark, "styleUrl", f"#{style}")
    return mark


def _lines(mark: ET.Element, lines: list[list[Point]]) -> None:
    several = ET.SubElement(mark, "MultiGeometry")
    for line in lines:
        _geometry(several, "LineString", line)


def _geometry(mark: ET.Element, kind: str, points: list[Point]) -> None:
    shape = ET.SubElement(mark, kind)
    if kind == "LineString":
        add_text(shape, "tessellate", "1")
    add_text(shape, "coordinates", _coordinates(points))


def _polygon(mark: ET.Element, points: list[Point]) -> None:
    shape = ET.SubElement(mark, "Polygon")
    add_text(shape, "tessellate", "1")
    ring = ET.SubElement(ET.SubElement(shape, "outerBoundaryIs"), "LinearRing")
    add_text(ring, "coordinates", _coordinates(points))


def _coordinates(points: list[Point]) -> str:
    return " ".join(f"{longitude:.8f},{latitude:.8f}" for longitude, latitude in points)
