"""Export a survey as GPX 1.1: positions as waypoints, flight and moving tags as tracks."""

import math
from xml.etree import ElementTree as ET

import uavrt
from uavrt.analysis.export.xml_text import printable
from uavrt.analysis.survey import Survey, thinned
from uavrt.clock import iso_utc
from uavrt.units import wrap_degrees_180

NAMESPACE = "http://www.topografix.com/GPX/1/1"


def gpx_text(survey: Survey) -> str:
    """Write the waypoints and tracks of a survey as GPX text, for a handheld receiver."""
    root = ET.Element("gpx", version="1.1", creator=f"uavrt {uavrt.__version__}")
    root.set("xmlns", NAMESPACE)
    metadata = ET.SubElement(root, "metadata")
    ET.SubElement(metadata, "name").text = printable(survey.name)
    vehicle = None if survey.vehicle is None else printable(f"vehicle {survey.vehicle}")
    if vehicle is not None:
        ET.SubElement(metadata, "desc").text = vehicle
    span = survey.span_ns
    if span is not None:
        ET.SubElement(metadata, "time").text = iso_utc(span[0])
    for one in survey.positions:
        if one.position is None:
            continue
        position = one.position
        point = _point(root, "wpt", position.latitude_deg, position.longitude_deg)
        time_ns = survey.position_time_ns(one.tag_id)
        if time_ns is not None:
            ET.SubElement(point, "time").text = iso_utc(time_ns)
        ET.SubElement(point, "name").text = printable(survey.label(one.tag_id))
        remarks = [one.text for one in position.cautions]
        if position.radius95_m is not None:
            remarks.insert(0, f"within {position.radius95_m:.0f} m with 95 %")
        remarks += [] if vehicle is None else [f"heard by {vehicle}"]
        if remarks:
            ET.SubElement(point, "desc").text = printable("; ".join(remarks))
        ET.SubElement(point, "type").text = "tag position"
    for mark in survey.marks:
        point = _point(root, "wpt", mark.latitude_deg, mark.longitude_deg)
        ET.SubElement(point, "time").text = iso_utc(mark.time_ns)
        ET.SubElement(point, "name").text = printable(mark.text) or "mark"
        ET.SubElement(point, "type").text = "mark"
    track = thinned(survey.track)
    if track:
        line = ET.SubElement(root, "trk")
        ET.SubElement(line, "name").text = printable(survey.name)
        if vehicle is not None:
            ET.SubElement(line, "desc").text = vehicle
        segment = ET.SubElement(line, "trkseg")
        for pose in track:
            point = _point(segment, "trkpt", pose.latitude_deg, pose.longitude_deg)
            if math.isfinite(pose.altitude_amsl_m):
                ET.SubElement(point, "ele").text = f"{pose.altitude_amsl_m:.2f}"
            ET.SubElement(point, "time").text = iso_utc(pose.time_ns)
    for one in survey.positions:
        if one.position is not None and one.position.track:
            line = ET.SubElement(root, "trk")
            ET.SubElement(line, "name").text = printable(survey.label(one.tag_id))
            segment = ET.SubElement(line, "trkseg")
            for place in one.position.track:
                point = _point(segment, "trkpt", place.latitude_deg, place.longitude_deg)
                ET.SubElement(point, "time").text = iso_utc(place.time_ns)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _point(
    parent: ET.Element, name: str, latitude_deg: float, longitude_deg: float
) -> ET.Element:
    # GPX wants longitudes in [-180, 180).
    east = wrap_degrees_180(longitude_deg)
    point = ET.SubElement(parent, name)
    point.set("lat", f"{latitude_deg:.8f}")
    point.set("lon", f"{east:.8f}")
    return point
