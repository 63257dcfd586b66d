"""Write a survey as CSV tables for uavrt, the original UAV-RT system, and Movebank."""

import io
import math
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import Any

from uavrt.analysis.export.geojson import cautions_of
from uavrt.analysis.survey import Survey
from uavrt.core.clock import iso_utc
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.flight.logs.pulse_files import PulseWriter
from uavrt.formats.bearings_csv import BearingRow
from uavrt.formats.csv_line import TableWriter
from uavrt.formats.positions_csv import PositionRow
from uavrt.formats.pulses.tagtracker import write_tagtracker
from uavrt.localization.estimates.flight_estimates import (
    EstimationOptions,
    Found,
    TagBearing,
    place,
)
from uavrt.localization.results import Position, PositionMethod

MOVEBANK_COLUMNS = (
    *("event-id", "timestamp", "location-long", "location-lat", "sensor-type"),
    *("individual-local-identifier", "tag-local-identifier", "tag-beacon-frequency"),
    *("location-error-numerical", "location-error-percentile", "location-error-text"),
    *("algorithm-marked-outlier", "comments"),
)
REFERENCE_COLUMNS = (
    *("tag-id", "animal-id", "animal-nickname", "tag-beacon-frequency"),
    *("deploy-on-date", "deploy-off-date", "deployment-comments"),
)


def pulses_csv(survey: Survey) -> str:
    """Write all pulses, with those of whole-flight analysis, as ``uavrt detect -o`` does."""
    stream = io.StringIO(newline="")
    pulses = survey.every_pulse
    writer = PulseWriter(stream, "csv", bursts=any(one.pulse.burst_starts_ns for one in pulses))
    for one in pulses:
        writer.write(one)
    return stream.getvalue()


def tagtracker_csv(survey: Survey) -> str:
    """Write pulses with a pose in TagTracker's format; whole-flight ones have status 3."""
    stream = io.StringIO()
    write_tagtracker(stream, survey.every_pulse)
    return stream.getvalue()


def track_csv(survey: Survey) -> str:
    """Write every pose of the vehicle as CSV."""
    header = (
        *("time_ns", "latitude_deg", "longitude_deg", "altitude_amsl_m"),
        *("altitude_relative_m", "qw", "qx", "qy", "qz", "vehicle"),
    )
    vehicle = survey.vehicle or ""
    rows = (
        (
            pose.time_ns,
            *(f"{degrees:.9f}" for degrees in (pose.latitude_deg, pose.longitude_deg)),
            *map(_metres, (pose.altitude_amsl_m, pose.altitude_relative_m)),
            *(f"{part:.9f}" for part in pose.quaternion_wxyz),
            vehicle,
        )
        for pose in survey.track
    )
    return _csv(header, rows)


def bearing_rows(survey: Survey, parent_file: str) -> list[BearingRow]:
    """Return rows for the original UAV-RT's ``bearings.csv``.

    Turns without a clear direction are excluded, since the format has no column to mark
    them.
    """
    known = (one for one in survey.bearings if one.bearing.accepted)
    return [_bearing_row(one, survey, parent_file) for one in known]


def position_rows(survey: Survey, bearing_file: str) -> list[PositionRow]:
    """Rows of the original UAV-RT's ``positions.csv``, by estimators mle, rmr and mest."""
    places: dict[PositionMethod, dict[int, tuple[float, float] | None]] = {}
    methods: tuple[PositionMethod, ...] = ("mle", "rmr", "mest")
    for method in methods:
        found = place([Found(bearings=survey.bearings)], EstimationOptions(method=method))
        places[method] = {
            one.tag_id: None
            if one.position is None
            else (one.position.latitude_deg, one.position.longitude_deg)
            for one in found
        }
    return [
        PositionRow(
            tag_id=tag_id,
            bearing_file=bearing_file,
            mle=place,
            rmr=places["rmr"][tag_id],
            mest=places["mest"][tag_id],
        )
        for tag_id, place in places["mle"].items()
    ]


def fixes_csv(survey: Survey) -> str:
    """Write the tags' positions and their uncertainty, or the reason for having none."""
    header = (
        *("tag_id", "name", "time_utc", "method", "latitude_deg", "longitude_deg"),
        *("radius50_m", "radius95_m", "bearings", "may_be_farther_out"),
        *("cautions", "cautions_in_words", "reason", "vehicle"),
    )
    rows = []
    vehicle = survey.vehicle or ""
    for tag_id in survey.tag_ids:
        name, found = survey.name_of(tag_id), survey.position_of(tag_id)
        if found is None or found.position is None:
            reason = "no bearing was taken" if found is None else found.reason
            rows.append((tag_id, name, *[""] * 10, reason, vehicle))
            continue
        position = found.position
        place = (f"{position.latitude_deg:.9f}", f"{position.longitude_deg:.9f}")
        radii = (_metres(position.radius50_m), _metres(position.radius95_m))
        rest = (position.stations, str(position.at_edge).lower())
        doubts = (*cautions_of(position).values(), "", vehicle)
        time_ns = survey.position_time_ns(tag_id)
        time = "" if time_ns is None else iso_utc(time_ns)
        rows.append((tag_id, name, time, position.method, *place, *radii, *rest, *doubts))
    return _csv(header, rows)


def tag_paths_csv(survey: Survey) -> str:
    """Write the position of each moving tag at each time of its path."""
    header = (
        *("tag_id", "name", "time_utc", "latitude_deg", "longitude_deg"),
        *("radius50_m", "radius95_m", "vehicle"),
    )
    rows = []
    for each in survey.positions:
        name = survey.name_of(each.tag_id)
        for one in () if each.position is None else each.position.track:
            place = (f"{one.latitude_deg:.9f}", f"{one.longitude_deg:.9f}")
            radii = (_metres(one.radius50_m), _metres(one.radius95_m))
            time = iso_utc(one.time_ns)
            rows.append((each.tag_id, name, time, *place, *radii, survey.vehicle or ""))
    return _csv(header, rows)


def marks_csv(survey: Survey) -> str:
    """Write the positions that the operator marked."""
    rows = (
        (iso_utc(one.time_ns), f"{one.latitude_deg:.9f}", f"{one.longitude_deg:.9f}", one.text)
        for one in survey.marks
    )
    return _csv(("time_utc", "latitude_deg", "longitude_deg", "text"), rows)


def movebank_csv(survey: Survey) -> str:
    """Write positions as events for Movebank: one for a resting tag, one for each point of a
    moving tag's path.

    The event of a resting tag has the time of its last bearing. Movebank recognises the column
    names when the file is uploaded.
    """
    events = [
        (one.tag_id, one.position, place)
        for one in survey.positions
        if one.position is not None
        for place in _places(survey, one.tag_id, one.position)
    ]
    rows = [
        _movebank_row(survey, number, *event) for number, event in enumerate(events, start=1)
    ]
    return _without_empty(MOVEBANK_COLUMNS, rows)


def _places(
    survey: Survey, tag_id: int, position: Position
) -> list[tuple[int, float, float, float | None]]:
    """Time, latitude, longitude and 95 % radius of a position or each point of a path."""
    if position.track:
        return [
            (one.time_ns, one.latitude_deg, one.longitude_deg, one.radius95_m)
            for one in position.track
        ]
    time_ns = survey.position_time_ns(tag_id)
    if time_ns is None:
        return []
    return [(time_ns, position.latitude_deg, position.longitude_deg, position.radius95_m)]


def _movebank_row(
    survey: Survey,
    number: int,
    tag_id: int,
    position: Position,
    place: tuple[int, float, float, float | None],
) -> Sequence[Any]:
    time_ns, latitude_deg, longitude_deg, radius95_m = place
    radius = _metres(radius95_m)
    heard = "pulses" if position.pulses else "bearings"
    count = position.pulses or position.stations
    text = f"{position.method}, {count} {heard}, {survey.name}"
    contradicted = any(one.name == "contradiction" for one in position.cautions)
    return (
        *(number, _movebank_time(time_ns)),
        *(f"{longitude_deg:.8f}", f"{latitude_deg:.8f}"),
        *("radio-transmitter", _animal(survey, tag_id), tag_id),
        _megahertz(survey, tag_id),
        *(radius, 95 if radius else ""),
        "; ".join([text, *(one.text for one in position.cautions)]),
        # What says no more than a direction is no place, and bearings that contradict each
        # other have no trusted coordinates; Movebank hides such by default.
        str(position.at_edge or not radius or contradicted).lower(),
        "" if survey.vehicle is None else f"vehicle {survey.vehicle}",
    )


def movebank_reference_csv(survey: Survey) -> str:
    """Write Movebank's reference data: the animal of each tag, and the flight's date."""
    span = survey.span_ns
    day = "" if span is None else _movebank_time(span[0])
    note = f"dates of {survey.name}: replace them by the deployment's"
    rows = []
    for tag_id in survey.tag_ids:
        about = survey.name_of(tag_id), _megahertz(survey, tag_id)
        rows.append((tag_id, _animal(survey, tag_id), *about, day, "", note))
    return _without_empty(REFERENCE_COLUMNS, rows)


def _animal(survey: Survey, tag_id: int) -> str:
    return survey.name_of(tag_id) or f"tag {tag_id}"


def _megahertz(survey: Survey, tag_id: int) -> str:
    tag = survey.tag(tag_id)
    return "" if tag is None else f"{tag.frequency_hz / 1e6:.6f}"


def _without_empty(names: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    columns = zip(names, *rows, strict=True)
    kept = [one for one in columns if not rows or any(cell != "" for cell in one[1:])]
    header, *cells = zip(*kept, strict=True)
    return _csv(header, cells)


def _bearing_row(one: TagBearing, survey: Survey, parent_file: str) -> BearingRow:
    heights = sorted(
        pulse.pose.altitude_relative_m
        for pulse in survey.pulses_of(one.tag_id)
        if pulse.pose is not None
        and one.start_time_ns <= pulse.pulse.start_time_ns <= one.end_time_ns
        and math.isfinite(pulse.pose.altitude_relative_m)
    )
    amsl = one.altitude_amsl_m
    return BearingRow(
        tag_id=one.tag_id,
        parent_file=parent_file,
        bearing_deg=one.bearing.bearing_deg,
        confidence=one.bearing.confidence,
        latitude_deg=one.latitude_deg,
        longitude_deg=one.longitude_deg,
        altitude_relative_m=heights[len(heights) // 2] if heights else None,
        altitude_amsl_m=amsl if math.isfinite(amsl) else None,
        start_time_ns=one.start_time_ns,
        end_time_ns=one.end_time_ns,
        sigma_deg=one.bearing.sigma_deg,
    )


def _movebank_time(time_ns: int) -> str:
    stamp = datetime.fromtimestamp(time_ns // NANOSECONDS_PER_SECOND, tz=UTC)
    return f"{stamp:%Y-%m-%d %H:%M:%S}.{time_ns // 1_000_000 % 1000:03d}"


def _metres(value: float | None) -> str:
    return "" if value is None or not math.isfinite(value) else f"{value:.3f}"


def _csv(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    stream = io.StringIO(newline="")
    writer = TableWriter(stream)
    writer.writerow(header)
    writer.writerows(rows)
    return stream.getvalue()
