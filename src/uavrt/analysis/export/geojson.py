"""A survey as GeoJSON (RFC 7946): WGS84, longitude first, outer rings counter-clockwise."""

import json
import math
from typing import Any

from uavrt.analysis.measure.shapes import (
    REGION_SHARES,
    Point,
    ray,
    ray_length_m,
    region95,
    region_lines,
    split_area_at_date_line,
    split_at_date_line,
    way_of,
    wedge,
)
from uavrt.analysis.power_survey import HeightBand, TagSignal
from uavrt.analysis.records import bearing_record, known, position_record
from uavrt.analysis.survey import Survey, thinned
from uavrt.clock import iso_utc
from uavrt.localization.position.strongest import StrongestSignal
from uavrt.localization.results import Position
from uavrt.recording.integrated import Ring

_PLACES = 8
"""Decimals of a degree: 1 mm."""
_OF_BEARING = ("bearing_deg", "sigma_deg", "method", "pulses", "accepted", "ambiguous")
_OF_POSITION = ("method", "radius50_m", "radius95_m", "bearings", "powers")


def geojson_text(survey: Survey) -> str:
    """Write track, pulses, bearings with wedges, positions with regions and ways, and marks."""
    features = [*_track(survey), *_pulses(survey), *_bearings(survey), *_positions(survey)]
    features += [*_strongest(survey), *_integrated(survey), *_marks(survey)]
    for one in features:
        one["properties"]["vehicle"] = survey.vehicle
    return json.dumps({"type": "FeatureCollection", "features": features}, allow_nan=False)


def pulse_properties(survey: Survey) -> list[tuple[Point, dict[str, Any]]]:
    """Place and attributes of each pulse that has a place."""
    found = []
    for one in survey.every_pulse:
        if one.pose is None:
            continue
        place = (one.pose.longitude_deg, one.pose.latitude_deg)
        properties = {
            "tag_id": one.pulse.tag_id,
            "time": iso_utc(one.pulse.start_time_ns),
            "snr_db": known(one.pulse.snr_db),
            "frequency_hz": known(one.pulse.frequency_hz),
            "detection_status": one.pulse.detection_status,
            "altitude_amsl_m": known(one.pose.altitude_amsl_m),
        }
        found.append((place, properties))
    return found


def bearing_properties(survey: Survey) -> list[dict[str, Any]]:
    """Attributes of each bearing, in the survey's order."""
    found = []
    for one in survey.bearings:
        record = bearing_record(one)
        low, high = record["interval90_deg"] or (None, None)
        arc = {"interval90_from_deg": low, "interval90_to_deg": high}
        properties = {"tag_id": one.tag_id, "time": iso_utc(one.start_time_ns), **arc}
        found.append(properties | {name: record[name] for name in _OF_BEARING})
    return found


def position_properties(survey: Survey) -> list[tuple[Point, dict[str, Any]]]:
    """Place and attributes of each position."""
    found = []
    for one in survey.positions:
        if one.position is None:
            continue
        position, record = one.position, position_record(one)
        tag = survey.tag(one.tag_id)
        time_ns = survey.position_time_ns(one.tag_id)
        properties = {
            "tag_id": one.tag_id,
            "time": None if time_ns is None else iso_utc(time_ns),
            "name": None if tag is None else tag.name,
            **{name: record[name] for name in _OF_POSITION},
            "may_be_farther_out": position.at_edge,
            **cautions_of(position),
        }
        found.append(((position.longitude_deg, position.latitude_deg), properties))
    return found


def cautions_of(position: Position) -> dict[str, str]:
    """What makes a position less sure than its circles say: by name, and in words."""
    return {
        "cautions": ", ".join(one.name for one in position.cautions),
        "cautions_in_words": "; ".join(one.text for one in position.cautions),
    }


def mark_properties(survey: Survey) -> list[tuple[Point, dict[str, Any]]]:
    """Place and attributes of each mark."""
    return [
        (
            (mark.longitude_deg, mark.latitude_deg),
            {"time": iso_utc(mark.time_ns), "text": mark.text},
        )
        for mark in survey.marks
    ]


def way_properties(survey: Survey) -> list[tuple[Point, dict[str, Any]]]:
    """Place and attributes of each time of the way of each tag that moved."""
    return [
        (
            (one.longitude_deg, one.latitude_deg),
            {
                "tag_id": each.tag_id,
                "time": iso_utc(one.time_ns),
                "radius50_m": known(one.radius50_m),
                "radius95_m": known(one.radius95_m),
            },
        )
        for each in survey.positions
        if each.position is not None
        for one in each.position.track
    ]


def strongest_properties(signal: TagSignal) -> list[tuple[Point, dict[str, Any]]]:
    """Place and attributes of a tag's strongest signal: of all heights, then of each layer."""
    found: list[tuple[StrongestSignal, HeightBand | None]] = []
    if signal.strongest is not None:
        found.append((signal.strongest, None))
    return [
        (
            (one.longitude_deg, one.latitude_deg),
            {
                "tag_id": signal.tag_id,
                "snr_db": known(one.snr_db),
                "the_tag_is_about_so_far_away_m": known(round(one.ring_radius_m, 1)),
                "heights_from_m": None if layer is None else round(layer.low_m, 1),
                "heights_to_m": None if layer is None else round(layer.high_m, 1),
            },
        )
        for one, layer in [*found, *((layer.strongest, layer) for layer in signal.layers)]
    ]


def _feature(kind: str, coordinates: Any, properties: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": kind, "coordinates": coordinates},
        "properties": properties,
    }


def _line(points: list[Point], properties: dict[str, Any]) -> dict[str, Any]:
    parts = [[_rounded(point) for point in part] for part in split_at_date_line(points)]
    if len(parts) == 1:
        return _feature("LineString", parts[0], properties)
    return _feature("MultiLineString", parts, properties)


def _rounded(point: Point) -> list[float]:
    return [round(part, _PLACES) for part in point]


def _area(points: list[Point], properties: dict[str, Any]) -> dict[str, Any]:
    parts = [[_rounded(point) for point in part] for part in split_area_at_date_line(points)]
    if len(parts) == 1:
        return _feature("Polygon", parts, properties)
    return _feature("MultiPolygon", [[part] for part in parts], properties)


def _track(survey: Survey) -> list[dict[str, Any]]:
    track = thinned(survey.track)
    if len(track) < 2:
        return []
    points = [(pose.longitude_deg, pose.latitude_deg) for pose in track]
    times = {"start": iso_utc(track[0].time_ns), "end": iso_utc(track[-1].time_ns)}
    return [_line(points, {"layer": "track", **times})]


def _pulses(survey: Survey) -> list[dict[str, Any]]:
    return [
        _feature("Point", _rounded(place), {"layer": "pulse", **properties})
        for place, properties in pulse_properties(survey)
    ]


def _bearings(survey: Survey) -> list[dict[str, Any]]:
    features = []
    for one, properties in zip(survey.bearings, bearing_properties(survey), strict=True):
        found = survey.position_of(one.tag_id)
        length_m = ray_length_m(one, None if found is None else found.position)
        features.append(_line(ray(one, length_m), {"layer": "bearing", **properties}))
        area = wedge(one, length_m)
        if area is not None:
            properties = {"layer": "bearing 90 %", **properties}
            features.append(_area(area, properties))
    return features


def _strongest(survey: Survey) -> list[dict[str, Any]]:
    features = []
    for one in survey.signals:
        for place, properties in strongest_properties(one):
            layer = {"layer": "strongest signal", **properties}
            features.append(_feature("Point", _rounded(place), layer))
    return features


def _positions(survey: Survey) -> list[dict[str, Any]]:
    features = []
    for place, properties in position_properties(survey):
        features.append(_feature("Point", _rounded(place), {"layer": "position", **properties}))
        found = survey.position_of(properties["tag_id"])
        area = None if found is None or found.position is None else region95(found.position)
        if area is not None:
            ellipse = {"layer": "position 95 %", **properties}
            features.append(_area(area, ellipse))
        for share in REGION_SHARES:
            if lines := region_lines(found, share):
                region = {"layer": f"region {share} %", "share": share, **properties}
                rings = [[_rounded(point) for point in line] for line in lines]
                features.append(_feature("MultiLineString", rings, region))
    return features + _ways(survey)


def _integrated(survey: Survey) -> list[dict[str, Any]]:
    """Where whole flights place tags: each of the places, and the regions."""
    features = [
        _feature("Point", _rounded(place), {"layer": "integrated place", **properties})
        for place, properties in integrated_places(survey)
    ]
    for areas, properties in integrated_regions(survey):
        told = {"layer": f"integrated {properties['share']} %", **properties}
        rounded = [[[_rounded(point) for point in one]] for one in areas]
        features.append(_feature("MultiPolygon", rounded, told))
    return features


def integrated_places(survey: Survey) -> list[tuple[Point, dict[str, Any]]]:
    """Where whole flights place tags; both places beside a straight way."""
    return [
        (
            (part.longitude_deg, part.latitude_deg),
            {
                "tag_id": verdict.tag_id,
                "places": verdict.places,
                "probability": known(part.probability),
                "radius95_m": known(part.radius95_m),
            },
        )
        for verdict in survey.verdicts
        for part in verdict.parts
    ]


def integrated_regions(survey: Survey) -> list[tuple[list[list[Point]], dict[str, Any]]]:
    """Rings of the regions with 50 and 95 % of whole flights, cut at the 180° meridian."""
    regions = []
    for verdict in survey.verdicts:
        for share, region in ((50, verdict.region50), (95, verdict.region95)):
            areas = [
                part
                for ring in region
                for part in split_area_at_date_line(_counter_clockwise(ring))
            ]
            told = {"share": share, "tag_id": verdict.tag_id, "places": verdict.places}
            regions += [(areas, told)] if areas else []
    return regions


def _counter_clockwise(ring: Ring) -> list[Point]:
    """Longitudes and latitudes of a ring, turning as RFC 7946 wants it."""
    points = [(longitude, latitude) for latitude, longitude in ring]
    first = points[0][0]
    x = [math.remainder(longitude - first, 360.0) for longitude, _ in points]
    twice = sum(
        x[n] * points[n + 1][1] - x[n + 1] * points[n][1] for n in range(len(points) - 1)
    )
    return points if twice > 0.0 else points[::-1]


def _ways(survey: Survey) -> list[dict[str, Any]]:
    """The paths of moving tags: a line each, and the place at each time."""
    features = [
        _line(way_of(one.position), {"layer": "tag track", "tag_id": one.tag_id})
        for one in survey.positions
        if len(way_of(one.position)) > 1
    ]
    return features + [
        _feature("Point", _rounded(place), {"layer": "tag track place", **properties})
        for place, properties in way_properties(survey)
    ]


def _marks(survey: Survey) -> list[dict[str, Any]]:
    return [
        _feature("Point", _rounded(place), {"layer": "mark", **properties})
        for place, properties in mark_properties(survey)
    ]
