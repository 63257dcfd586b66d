"""Read tracks of points from NMEA 0183 sentences or GPX files.

NMEA: RMC (date, time, position), GGA (time, position, altitude), HDT (true heading), HDG and
HDM (magnetic heading, converted to true). Checksums are verified if present. GPX 1.0 and 1.1:
``trkpt`` with time and elevation.
"""

import math
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from xml.etree import ElementTree as ET

from uavrt.core.clock import parse_iso_utc
from uavrt.core.earth.attitude import from_euler_deg
from uavrt.core.earth.on_earth import OffEarthError
from uavrt.core.errors import FormatError
from uavrt.core.foreign import GPX, read_xml
from uavrt.core.messages import AttitudeSample, PositionSample
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.formats import nmea
from uavrt.formats.text import place_or_none, read_lines
from uavrt.formats.tracks.declination import declination_deg
from uavrt.formats.tracks.track import (
    COURSE,
    STANDING,
    VehicleTrack,
    attitude,
    filled,
    headings_of_course,
    over_the_first,
    position,
    standing,
)

MAGNETIC = (
    "The headings of this track are magnetic; the declination was added, from the sentences or "
    "from the World Magnetic Model. Bearings are no better than the compass's calibration."
)
_DAY_NS = 86_400_000_000_000


def read_nmea(path: Path) -> VehicleTrack:
    """Read undamaged NMEA sentences; raises `FormatError` if no position has a date."""
    day_ns: int | None = None
    time_ns: int | None = None
    places: dict[int, PositionSample] = {}
    turns: list[AttitudeSample] = []
    magnetic: list[AttitudeSample] = []
    for line in read_lines(path):
        fields = nmea.fields_of(line)
        try:
            if fields[0].endswith("RMC") and fields[2] == "A":
                stamp = datetime.strptime(fields[9], "%d%m%y").replace(tzinfo=UTC)
                day_ns = round(stamp.timestamp()) * NANOSECONDS_PER_SECOND
                time_ns = day_ns + nmea.clock_ns(fields[1])
                found = position(time_ns, *nmea.place_in(fields[3:7]), math.nan)
                if found is not None:
                    places.setdefault(time_ns, found)
            elif fields[0].endswith("GGA") and day_ns is not None and fields[6] != "0":
                new_ns = day_ns + nmea.clock_ns(fields[1])
                if time_ns is not None and new_ns < time_ns - _DAY_NS // 2:
                    new_ns += _DAY_NS  # midnight has passed since the last RMC
                time_ns = new_ns
                found = position(time_ns, *nmea.place_in(fields[2:6]), float(fields[9]))
                if found is not None:
                    places[time_ns] = found
            elif fields[0].endswith("HDT") and time_ns is not None:
                turned = attitude(time_ns, from_euler_deg(float(fields[1]), 0.0, 0.0))
                turns += [] if turned is None else [turned]
            elif fields[0].endswith(("HDG", "HDM")) and time_ns in places:
                heading = _true_heading_deg(fields, places[time_ns])
                turned = attitude(time_ns, from_euler_deg(heading, 0.0, 0.0))
                magnetic += [] if turned is None else [turned]
        except (ValueError, IndexError):
            continue
    warnings = (MAGNETIC,) if magnetic and not turns else ()
    return _track("NMEA", list(places.values()), turns or magnetic, path, warnings)


def _true_heading_deg(fields: list[str], place: PositionSample) -> float:
    """Convert a magnetic heading to true [°], by the sentence's or the model's declination."""
    heading = float(fields[1])
    if fields[0].endswith("HDG") and len(fields) > 5:
        heading += _eastward(fields[2], fields[3])
        if fields[4]:
            return heading + _eastward(fields[4], fields[5])
    return heading + declination_deg(
        place.latitude_deg, place.longitude_deg, place.altitude_amsl_m, place.time_ns
    )


def _eastward(angle: str, direction: str) -> float:
    return (float(angle) if angle else 0.0) * (-1.0 if direction == "W" else 1.0)


def read_gpx(path: Path) -> VehicleTrack:
    """Read the tracks of a GPX file; raises `FormatError` if it has no points with times."""
    text = "\n".join(read_lines(path))
    places: list[PositionSample] = []
    astray: list[tuple[int, OffEarthError]] = []
    try:
        root = read_xml(text, GPX, "gpx")
        points = (one for one in root.iter() if one.tag.rpartition("}")[2] == "trkpt")
        for number, point in enumerate(points, start=1):
            inner = {child.tag.rpartition("}")[2]: child.text or "" for child in point}
            if "time" not in inner:
                continue
            try:
                place = place_or_none(point.get("lat", ""), point.get("lon", ""))
            except OffEarthError as error:
                astray.append((number, error))
                continue
            time_ns, height_m = parse_iso_utc(inner["time"].strip()), inner.get("ele", "nan")
            found = None
            if place is not None:
                found = position(time_ns, place[0], place[1], float(height_m))
            places += [] if found is None else [found]
    except (ET.ParseError, ValueError, OverflowError) as error:
        raise FormatError(
            f"{path} is not a GPX file: {error}", remedy="Export the track as GPX again"
        ) from error
    if len(astray) > len(places):
        at, fault = astray[0]
        raise FormatError(f"{path} point {at}: {fault}", remedy=fault.remedy)
    track = _track("GPX", places, [], path)
    if not astray:
        return track
    at, fault = astray[0]
    count = "1 point" if len(astray) == 1 else f"{len(astray)} points"
    skipped = f"{count} of {path} skipped: {fault} (point {at}). {fault.remedy}."
    return replace(track, warnings=(skipped, *track.warnings))


def _track(
    kind: str,
    places: list[PositionSample],
    turns: list[AttitudeSample],
    path: Path,
    warnings: tuple[str, ...] = (),
) -> VehicleTrack:
    if not places:
        raise FormatError(
            f"{path} has no point with time and position",
            remedy="Name a log that was recorded with GPS reception",
        )
    positions = over_the_first(places)
    attitudes = tuple(turns) or tuple(headings_of_course(positions))
    if not turns:
        warnings = (COURSE,) if attitudes else (STANDING,)
    return filled(
        VehicleTrack(
            kind=kind,
            attitudes=attitudes or tuple(standing(positions)),
            positions=positions,
            warnings=warnings,
        )
    )
