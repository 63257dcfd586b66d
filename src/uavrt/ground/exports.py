"""A flight as files for other programs: CSV, GeoJSON, KML, KMZ, GPX."""

import csv
import io
import json
import math
import zipfile
from collections.abc import Callable
from typing import Any
from xml.etree import ElementTree

import numpy as np

from uavrt.clock import iso_utc
from uavrt.ground.estimates import Estimates
from uavrt.ground.flights import PULSE_COLUMNS, STATUSES, Columns, FlightSummary, known
from uavrt.ground.places import Places

RAY_M = 3000.0
_TRACK_STEP_NS = 1_000_000_000
_EARTH_M = 6_371_000.0

EXPORTS = {
    "csv": "text/csv",
    "geojson": "application/geo+json",
    "kml": "application/vnd.google-earth.kml+xml",
    "kmz": "application/vnd.google-earth.kmz",
    "gpx": "application/gpx+xml",
}
"""Formats and their media types."""


def export(
    name: str,
    summary: FlightSummary,
    columns: Columns,
    found: Estimates,
    places: Places | None = None,
) -> bytes:
    """Write a flight, with its marks, in one of `EXPORTS`."""
    writers: dict[str, Callable[[FlightSummary, Columns, Estimates, Places], bytes]] = {
        "csv": _csv,
        "geojson": _geojson,
        "kml": _kml,
        "kmz": _kmz,
        "gpx": _gpx,
    }
    return writers[name](summary, columns, found, places or Places(home=None, marks=()))


def _csv(summary: FlightSummary, columns: Columns, found: Estimates, places: Places) -> bytes:
    """Pulses, one a line; unknown is empty."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(("time_utc", *PULSE_COLUMNS))
    for pulse in columns.pulses.T:
        cells: list[Any] = [known(value) for value in pulse]
        cells[0], cells[1], cells[7] = int(pulse[0]), int(pulse[1]), int(pulse[7])
        cells[6] = STATUSES[int(pulse[6])]
        # Other tags' numbers, and whether it was clipped.
        cells[15:] = [None if value is None else int(value) for value in cells[15:]]
        writer.writerow((iso_utc(int(pulse[1])), *cells))
    return stream.getvalue().encode()


def _geojson(
    summary: FlightSummary, columns: Columns, found: Estimates, places: Places
) -> bytes:
    """Track, pulses, rays and positions as features (RFC 7946)."""
    features: list[Any] = []
    track = _track(columns)
    if len(track) > 1:
        line = {"type": "LineString", "coordinates": [place[:3] for place in track]}
        features.append(_feature(line, kind="track", flight=summary.flight_id))
    for pulse in columns.pulses.T:
        if math.isfinite(pulse[8]):
            point = {"type": "Point", "coordinates": [_r(pulse[9]), _r(pulse[8])]}
            properties = {
                "kind": "pulse",
                "tag_id": int(pulse[0]),
                "time": iso_utc(int(pulse[1])),
                "frequency_hz": known(pulse[2]),
                "snr_db": known(pulse[3]),
            }
            features.append(_feature(point, **properties))
    for bearing in found.bearings:
        line = {"type": "LineString", "coordinates": [list(end) for end in _ray(bearing)]}
        kept = {key: value for key, value in bearing.items() if key != "rose_snr_db"}
        kept["time"] = iso_utc(bearing["end_time_ns"])
        features.append(_feature(line, **kept, kind="bearing"))
    for position in found.positions:
        point = {
            "type": "Point",
            "coordinates": [_r(position["longitude_deg"]), _r(position["latitude_deg"])],
        }
        left_out = ("region50", "region95", "heat")
        kept = {key: value for key, value in position.items() if key not in left_out}
        time = _time_of(position, found)
        features.append(_feature(point, **kept, **time, kind="position"))
        for share in (50, 95):
            if lines := position[f"region{share}"]:
                shape = {"type": "MultiLineString", "coordinates": lines}
                tag_id = position["tag_id"]
                features.append(_feature(shape, tag_id=tag_id, share=share, kind="region"))
    for mark in places.marks:
        point = {"type": "Point", "coordinates": [mark.longitude_deg, mark.latitude_deg]}
        time = {"time": iso_utc(mark.time_ns)}
        features.append(_feature(point, text=mark.text, **time, kind="mark"))
    collection = {"type": "FeatureCollection", "features": features}
    return json.dumps(collection, allow_nan=False).encode()


def _feature(geometry: dict[str, Any], **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _gpx(summary: FlightSummary, columns: Columns, found: Estimates, places: Places) -> bytes:
    """Positions as waypoints, the flight as a track (GPX 1.1)."""
    root = ElementTree.Element(
        "gpx", version="1.1", creator="uavrt", xmlns="http://www.topografix.com/GPX/1/1"
    )
    for position in found.positions:
        point = ElementTree.SubElement(
            root,
            "wpt",
            lat=f"{position['latitude_deg']:.7f}",
            lon=f"{position['longitude_deg']:.7f}",
        )
        for time in _time_of(position, found).values():
            ElementTree.SubElement(point, "time").text = time
        ElementTree.SubElement(point, "name").text = _label(summary, position["tag_id"])
        ElementTree.SubElement(point, "desc").text = _said(position)
    for mark in places.marks:
        point = ElementTree.SubElement(
            root, "wpt", lat=f"{mark.latitude_deg:.7f}", lon=f"{mark.longitude_deg:.7f}"
        )
        ElementTree.SubElement(point, "time").text = iso_utc(mark.time_ns)
        ElementTree.SubElement(point, "name").text = _printable(mark.text) or "mark"
    track = ElementTree.SubElement(root, "trk")
    ElementTree.SubElement(track, "name").text = summary.flight_id
    segment = ElementTree.SubElement(track, "trkseg")
    for longitude, latitude, _height, time_ns in _track(columns):
        point = ElementTree.SubElement(
            segment, "trkpt", lat=f"{latitude:.7f}", lon=f"{longitude:.7f}"
        )
        ElementTree.SubElement(point, "time").text = iso_utc(int(time_ns))
    return _xml(root)


def _kml(summary: FlightSummary, columns: Columns, found: Estimates, places: Places) -> bytes:
    """The same for Google Earth, nothing fetched from anywhere."""
    root = ElementTree.Element("kml", xmlns="http://www.opengis.net/kml/2.2")
    document = ElementTree.SubElement(root, "Document")
    ElementTree.SubElement(document, "name").text = summary.flight_id
    _placemark(document, "flight", "LineString", [place[:2] for place in _track(columns)])
    for bearing in found.bearings:
        name = f"{_label(summary, bearing['tag_id'])}: {bearing['bearing_deg']:.0f}°"
        _placemark(document, name, "LineString", _ray(bearing))
    for position in found.positions:
        place = (position["longitude_deg"], position["latitude_deg"])
        mark = _placemark(document, _label(summary, position["tag_id"]), "Point", [place])
        ElementTree.SubElement(mark, "description").text = _said(position)
        for time in _time_of(position, found).values():
            _stamped(mark, time)
        for share in (50, 95):
            if lines := position[f"region{share}"]:
                label = f"{_label(summary, position['tag_id'])}, {share} %"
                _region(document, label, lines)
    for seen in places.marks:
        at = (seen.longitude_deg, seen.latitude_deg)
        pin = _placemark(document, _printable(seen.text) or "mark", "Point", [at])
        _stamped(pin, iso_utc(seen.time_ns))
    return _xml(root)


def _region(document: ElementTree.Element, name: str, lines: list[list[list[float]]]) -> None:
    """Outline of a region, of as many pieces as it has."""
    pieces = ElementTree.SubElement(document, "Placemark")
    ElementTree.SubElement(pieces, "name").text = name
    several = ElementTree.SubElement(pieces, "MultiGeometry")
    for line in lines:
        shape = ElementTree.SubElement(several, "LineString")
        text = " ".join(",".join(f"{value:.7f}" for value in place) for place in line)
        ElementTree.SubElement(shape, "coordinates").text = text


def _stamped(mark: ElementTree.Element, time: str) -> None:
    """Give a placemark its time, before its shape as the schema wants it."""
    stamp = ElementTree.Element("TimeStamp")
    ElementTree.SubElement(stamp, "when").text = time
    mark.insert(1, stamp)


def _time_of(position: dict[str, Any], found: Estimates) -> dict[str, str]:
    """When a position was so: at the end of the last turn that it is from."""
    ends = [
        one["end_time_ns"]
        for one in found.bearings
        if one["tag_id"] == position["tag_id"] and one["accepted"]
    ]
    return {"time": iso_utc(max(ends))} if ends else {}


def _kmz(summary: FlightSummary, columns: Columns, found: Estimates, places: Places) -> bytes:
    """The same, packed as Google Earth likes it."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("doc.kml", _kml(summary, columns, found, places))
    return stream.getvalue()


def _placemark(
    document: ElementTree.Element, name: str, kind: str, places: list[tuple[float, ...]]
) -> ElementTree.Element:
    mark = ElementTree.SubElement(document, "Placemark")
    ElementTree.SubElement(mark, "name").text = name
    shape = ElementTree.SubElement(mark, kind)
    text = " ".join(",".join(f"{value:.7f}" for value in place) for place in places)
    ElementTree.SubElement(shape, "coordinates").text = text
    return mark


def _label(summary: FlightSummary, tag_id: int) -> str:
    names = {tag.tag_id: tag.name for tag in summary.tags}
    return f"tag {tag_id} {_printable(names.get(tag_id) or '')}".strip()


def _printable(text: str) -> str:
    """A text without what XML cannot hold."""
    return "".join(letter for letter in text if letter.isprintable())


def _said(position: dict[str, Any]) -> str:
    radius = position["radius95_m"]
    within = "" if radius is None else f"within {radius:.0f} m with 95 % probability; "
    return f"{within}{position['stations']} bearings; method {position['method']}"


def _xml(root: ElementTree.Element) -> bytes:
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text


def _track(columns: Columns) -> list[tuple[float, ...]]:
    """Longitude, latitude, relative altitude and time, once a second."""
    poses = columns.poses
    if not poses.shape[1]:
        return []
    slots = ((poses[0] - poses[0, 0]) // _TRACK_STEP_NS).astype(np.int64)
    _, kept = np.unique(slots, return_index=True)
    return [
        (_r(longitude), _r(latitude), round(float(height), 2), time_ns)
        for time_ns, latitude, longitude, height in poses[:4, kept].T
    ]


def _ray(bearing: dict[str, Any]) -> list[tuple[float, ...]]:
    """Both ends of a bearing's ray of 3 km, on the sphere: for the eye."""
    latitude = math.radians(bearing["latitude_deg"])
    angle, reach = math.radians(bearing["bearing_deg"]), RAY_M / _EARTH_M
    end = math.asin(
        math.sin(latitude) * math.cos(reach)
        + math.cos(latitude) * math.sin(reach) * math.cos(angle)
    )
    turned = math.atan2(
        math.sin(angle) * math.sin(reach) * math.cos(latitude),
        math.cos(reach) - math.sin(latitude) * math.sin(end),
    )
    longitude = bearing["longitude_deg"]
    return [
        (_r(longitude), _r(bearing["latitude_deg"])),
        (_r(longitude + math.degrees(turned)), _r(math.degrees(end))),
    ]


def _r(degrees: float) -> float:
    return round(float(degrees), 7)
