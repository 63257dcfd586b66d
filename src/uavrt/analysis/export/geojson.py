"""Export a survey as GeoJSON (RFC 7946): WGS 84, longitude first, outer rings anticlockwise."""

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any

from uavrt.analysis.estimates.power_survey import HeightBand, TagSignal
from uavrt.analysis.estimates.records import bearing_record, known, position_record
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
    split_area_at_date_line,
    split_at_date_line,
    wedge,
)
from uavrt.analysis.survey import Survey, thinned
from uavrt.core.clock import iso_utc
from uavrt.core.messages import Pose
from uavrt.flight.integrated import IntegratedPart, Ring
from uavrt.localization.position.levels.strongest import StrongestSignal
from uavrt.localization.results import Position, TrackPoint

_PLACES = 8
"""Number of decimals of exported coordinates in degrees; the eighth decimal is 1 mm."""
_OF_BEARING = ("bearing_deg", "sigma_deg", "method", "pulses", "accepted", "ambiguous")
_OF_POSITION = ("method", "radius50_m", "radius95_m", "bearings", "powers")


Properties = dict[str, Any]
Shape = tuple[list[list[Point]], Properties]
"""Attributes of a point, line or area, and its parts, cut at the 180° meridian."""


def geojson_text(survey: Survey) -> str:
    """Write track, pulses, bearings, positions, tags' paths and marks as one GeoJSON."""
    features = [
        {
            "type": "Feature",
            "geometry": _geometry(kind, parts),
            "properties": {"layer": name.format(**facts), **facts, "vehicle": survey.vehicle},
        }
        for name, _, kind, shapes in layers(survey)
        for parts, facts in shapes
    ]
    return json.dumps({"type": "FeatureCollection", "features": features}, allow_nan=False)


def layers(survey: Survey) -> Iterator[tuple[str, str, str, list[Shape]]]:
    """Yield each map layer of a survey: name, table name in a GeoPackage (or empty), geometry
    type and shapes.
    """
    track = list(map(point_of, thinned(survey.track)))
    rays: list[Shape] = []
    wedges: list[Shape] = []
    for one, facts in zip(survey.bearings, bearing_properties(survey), strict=True):
        length_m = ray_length_m(one, survey.placed(one.tag_id))
        rays.append((split_at_date_line(ray(one, length_m)), facts))
        area = wedge(one, length_m)
        wedges += [] if area is None else [(split_area_at_date_line(area), facts)]
    places, circles, outlines = list[Shape](), list[Shape](), list[Shape]()
    for position, facts in position_properties(survey):
        places.append(([[point_of(position)]], facts))
        area = region95(position)
        circles += [] if area is None else [(split_area_at_date_line(area), facts)]
        for share in REGION_SHARES:
            if lines := region_lines(position, share):
                outlines.append((lines, {"share": share, **facts}))
    yield "pulse", "pulses", "POINT", _points(pulse_properties(survey))
    if len(track) > 1:
        times = [iso_utc(survey.track[which].time_ns) for which in (0, -1)]
        shape = split_at_date_line(track), dict(zip(("start", "end"), times, strict=True))
        yield "track", "track", "LINESTRING", [shape]
    yield "bearing", "bearings", "LINESTRING", rays
    yield "bearing 90 %", "bearing_wedges", "POLYGON", wedges
    yield "position", "positions", "POINT", places
    yield "tag track", "", "LINESTRING", _tag_paths(survey)
    yield "tag track place", "tag_tracks", "POINT", _points(path_properties(survey))
    yield "position 95 %", "regions95", "POLYGON", circles
    yield "region {share} %", "region_outlines", "MULTILINESTRING", outlines
    yield "integrated place", "integrated_places", "POINT", _points(integrated_places(survey))
    regions = integrated_regions(survey)
    yield "integrated {share} %", "integrated_regions", "MULTIPOLYGON", regions
    marks = [(one, {"time": iso_utc(one.time_ns), "text": one.text}) for one in survey.marks]
    yield "mark", "marks", "POINT", _points(marks)
    loudest = [found for one in survey.signals for found in strongest_properties(one)]
    yield "strongest signal", "strongest_signal", "POINT", _points(loudest)


def _points(found: Sequence[tuple[Located, Properties]]) -> list[Shape]:
    return [([[point_of(place)]], facts) for place, facts in found]


def _tag_paths(survey: Survey) -> list[Shape]:
    ways = [(path_points(one.position), {"tag_id": one.tag_id}) for one in survey.positions]
    return [(split_at_date_line(way), facts) for way, facts in ways if len(way) > 1]


def _geometry(kind: str, parts: list[list[Point]]) -> Properties:
    """Return the GeoJSON geometry of a shape; a shape of several parts gets a Multi- type."""
    rounded = [[[round(each, _PLACES) for each in point] for point in part] for part in parts]
    if kind == "POINT":
        return {"type": "Point", "coordinates": rounded[0][0]}
    name = "Polygon" if kind.endswith("POLYGON") else "LineString"
    several = [[part] for part in rounded] if name == "Polygon" else rounded
    if len(parts) == 1 and not kind.startswith("MULTI"):
        return {"type": name, "coordinates": several[0]}
    return {"type": f"Multi{name}", "coordinates": several}


def pulse_properties(survey: Survey) -> list[tuple[Pose, Properties]]:
    """Pose and attributes of each pulse with a pose."""
    return [
        (
            one.pose,
            {
                "tag_id": one.pulse.tag_id,
                "time": iso_utc(one.pulse.start_time_ns),
                "snr_db": known(one.pulse.snr_db),
                "frequency_hz": known(one.pulse.frequency_hz),
                "detection_status": one.pulse.detection_status,
                "altitude_amsl_m": known(one.pose.altitude_amsl_m),
            },
        )
        for one in survey.every_pulse
        if one.pose is not None
    ]


def bearing_properties(survey: Survey) -> list[Properties]:
    """Attributes of each bearing, in the survey's order."""
    found = []
    for one in survey.bearings:
        record = bearing_record(one)
        low, high = record["interval90_deg"] or (None, None)
        arc = {"interval90_from_deg": low, "interval90_to_deg": high}
        facts = {"tag_id": one.tag_id, "time": iso_utc(one.start_time_ns), **arc}
        found.append(facts | {name: record[name] for name in _OF_BEARING})
    return found


def position_properties(survey: Survey) -> list[tuple[Position, Properties]]:
    """Return each estimated position with its attributes."""
    found = []
    for one in survey.positions:
        if one.position is None:
            continue
        position, record = one.position, position_record(one)
        tag = survey.tag(one.tag_id)
        time_ns = survey.position_time_ns(one.tag_id)
        facts = {
            "tag_id": one.tag_id,
            "time": None if time_ns is None else iso_utc(time_ns),
            "name": None if tag is None else tag.name,
            **{name: record[name] for name in _OF_POSITION},
            "may_be_farther_out": position.at_edge,
            **cautions_of(position),
        }
        found.append((position, facts))
    return found


def cautions_of(position: Position) -> dict[str, str]:
    """Names and texts of the cautions on a position, joined to one string each."""
    return {
        "cautions": ", ".join(one.name for one in position.cautions),
        "cautions_in_words": "; ".join(one.text for one in position.cautions),
    }


def path_properties(survey: Survey) -> list[tuple[TrackPoint, Properties]]:
    """Return each point on the paths of moving tags, with its attributes."""
    return [
        (
            one,
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


def strongest_properties(signal: TagSignal) -> list[tuple[StrongestSignal, Properties]]:
    """Places of a tag's strongest signal, overall and by height range, with attributes."""
    found: list[tuple[StrongestSignal, HeightBand | None]] = []
    if signal.strongest is not None:
        found.append((signal.strongest, None))
    return [
        (
            one,
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


def integrated_places(survey: Survey) -> list[tuple[IntegratedPart, Properties]]:
    """Return tag positions found by whole-flight analysis. A tag has two if a straight flight
    path does not show on which side it is.
    """
    return [
        (
            part,
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


def integrated_regions(survey: Survey) -> list[tuple[list[list[Point]], Properties]]:
    """Outlines of whole-flight analysis's 50 and 95 % regions, cut at the 180° meridian."""
    regions = []
    for verdict in survey.verdicts:
        for share, region in ((50, verdict.region50), (95, verdict.region95)):
            areas = [
                part
                for ring in region
                for part in split_area_at_date_line(_counter_clockwise(ring))
            ]
            facts = {"share": share, "tag_id": verdict.tag_id, "places": verdict.places}
            regions += [(areas, facts)] if areas else []
    return regions


def _counter_clockwise(ring: Ring) -> list[Point]:
    """Ring of latitudes and longitudes as counter-clockwise points, as in RFC 7946."""
    points = [(longitude, latitude) for latitude, longitude in ring]
    first = points[0][0]
    x = [math.remainder(longitude - first, 360.0) for longitude, _ in points]
    twice = sum(
        x[n] * points[n + 1][1] - x[n + 1] * points[n][1] for n in range(len(points) - 1)
    )
    return points if twice > 0.0 else points[::-1]
