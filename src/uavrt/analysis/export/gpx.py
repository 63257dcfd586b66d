"""Export a survey as GPX 1.1: positions as waypoints, flight and moving tags as tracks."""

import math
from collections.abc import Iterable
from xml.etree import ElementTree as ET

import uavrt
from uavrt.analysis.survey import Survey, thinned
from uavrt.core.clock import iso_utc
from uavrt.core.messages import Pose
from uavrt.core.units import wrap_degrees_180
from uavrt.formats.xml_text import add_text
from uavrt.localization.results import TrackPoint

NAMESPACE = "http://www.topografix.com/GPX/1/1"


def gpx_text(survey: Survey) -> str:
    """Write the waypoints and tracks of a survey as GPX text, for a handheld receiver."""
    root = ET.Element("gpx", version="1.1", creator=f"uavrt {uavrt.__version__}")
    root.set("xmlns", NAMESPACE)
    metadata = ET.SubElement(root, "metadata")
    add_text(metadata, "name", survey.name)
    vehicle = None if survey.vehicle is None else f"vehicle {survey.vehicle}"
    if vehicle is not None:
        add_text(metadata, "desc", vehicle)
    if survey.span_ns is not None:
        add_text(metadata, "time", iso_utc(survey.span_ns[0]))
    for one in survey.positions:
        if one.position is None:
            continue
        position, time_ns = one.position, survey.position_time_ns(one.tag_id)
        point = _point(root, "wpt", position.latitude_deg, position.longitude_deg)
        if time_ns is not None:
            add_text(point, "time", iso_utc(time_ns))
        add_text(point, "name", survey.label(one.tag_id))
        remarks = [one.text for one in position.cautions]
        if position.radius95_m is not None:
            remarks.insert(0, f"within {position.radius95_m:.0f} m with 95 %")
        remarks += [] if vehicle is None else [f"heard by {vehicle}"]
        if remarks:
            add_text(point, "desc", "; ".join(remarks))
        add_text(point, "type", "tag position")
    for mark in survey.marks:
        point = _point(root, "wpt", mark.latitude_deg, mark.longitude_deg)
        add_text(point, "time", iso_utc(mark.time_ns))
        add_text(point, "name", mark.text or "mark")
        add_text(point, "type", "mark")
    if track := thinned(survey.track):
        _track(root, survey.name, vehicle, track)
    for one in survey.positions:
        if one.position is not None and one.position.track:
            _track(root, survey.label(one.tag_id), None, one.position.track)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _track(
    root: ET.Element, name: str, remark: str | None, points: Iterable[Pose | TrackPoint]
) -> None:
    line = ET.SubElement(root, "trk")
    add_text(line, "name", name)
    if remark is not None:
        add_text(line, "desc", remark)
    segment = ET.SubElement(line, "trkseg")
    for one in points:
        point = _point(segment, "trkpt", one.latitude_deg, one.longitude_deg)
        if isinstance(one, Pose) and math.isfinite(one.altitude_amsl_m):
            add_text(point, "ele", f"{one.altitude_amsl_m:.2f}")
        add_text(point, "time", iso_utc(one.time_ns))


def _point(
    parent: ET.Element, name: str, latitude_deg: float, longitude_deg: float
) -> ET.Element:
    # GPX wants longitudes in [-180, 180).
    east = wrap_degrees_180(longitude_deg)
    return ET.SubElement(parent, name, lat=f"{latitude_deg:.8f}", lon=f"{east:.8f}")
