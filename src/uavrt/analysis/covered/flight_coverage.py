"""Map where a flight would have detected a tag, from the flight's poses and noise."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.covered.coverage_maps import MOST_PULSES, MapArea, covered_by, has_boresight
from uavrt.analysis.inputs.flight_noise import FlightNoise
from uavrt.analysis.inputs.flown_with import antenna_poses, flight_settings
from uavrt.analysis.inputs.listening_times import Stretch, missing_in_words, within
from uavrt.core.earth.tangent_plane import TangentPlane, plane_around
from uavrt.core.errors import RecordingError
from uavrt.core.messages import Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.flight.integrated import SearchedFor
from uavrt.flight.reading.flight_reader import Flight
from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.estimates.heard import PoseColumns, height_warning
from uavrt.localization.headings import Headings
from uavrt.planning.detectability.detection_coverage import AntennaPath, Coverage
from uavrt.planning.detectability.link_budget import LinkBudget

_Floats = NDArray[np.float64]
_LEAST_HEIGHT_M = 1.0


def flight_coverage(
    area: MapArea,
    flight: Flight,
    tag: Tag,
    budget: LinkBudget,
    *,
    noise: FlightNoise | None,
    pattern: AntennaPattern | None,
    level_sigma_db: float,
    whole_flight: bool = False,
    searched: SearchedFor | None = None,
    listened: Sequence[Stretch] = (),
    on_pulse: Callable[[int, int], None] | None = None,
) -> Coverage:
    """Probability that a flight would have detected a tag at each map position.

    With `whole_flight` all pulses are combined, as in whole-flight analysis; otherwise each
    group of pulses is considered separately. If `listened` is given, the tag can be received
    only in these time spans.
    """
    way, limitations = flown_path(area, flight, tag, noise, listened)
    window_hz = frequency_window_hz(flight)
    if whole_flight and searched is not None:
        window_hz = searched.frequency_window_hz
    if not has_boresight(pattern):
        way = replace(way, headings=None)
    found = covered_by(
        area,
        way,
        tag,
        budget,
        pattern,
        level_sigma_db,
        window_hz,
        on_pulse,
        whole_flight=whole_flight,
        most_drift=0.0 if searched is None else searched.most_drift,
    )
    return replace(found, limitations=(*found.limitations, *limitations))


def frequency_window_hz(flight: Flight) -> float:
    """Half-width of the detectors' search around a tag's frequency [Hz]; 500 if unknown."""
    settings = flight_settings(flight)
    return 500.0 if settings is None else settings.detection.frequency_window_hz


def flight_plane(flight: Flight) -> tuple[TangentPlane, _Floats, _Floats]:
    """Return the local plane around a flight, and its path, east and north [m]. Raises
    `RecordingError` for a flight without poses.
    """
    poses = PoseColumns.of(flight.poses)
    if len(poses.time_ns) < 2:
        raise RecordingError(
            f"{flight.info.directory} has no poses",
            remedy="Attach poses from an autopilot's log with uavrt attach",
        )
    plane = plane_around(poses.latitude_deg, poses.longitude_deg)
    return (plane, *plane.to_local(poses.latitude_deg, poses.longitude_deg))


def flown_path(
    area: MapArea,
    flight: Flight,
    tag: Tag,
    noise: FlightNoise | None,
    listened: Sequence[Stretch] = (),
) -> tuple[AntennaPath, tuple[str, ...]]:
    """Return the antenna's positions and heights above ground, one for each pulse interval, and
    the map's limitations.

    If `listened` is given, only times in these spans with samples are used.
    """
    poses = PoseColumns.of(antenna_poses(flight))
    begin = max(int(poses.time_ns[0]), flight.info.start_time_ns)
    interval_ns = tag.pulse_intervals_s[0] * NANOSECONDS_PER_SECOND
    count = max(1, int((int(poses.time_ns[-1]) - begin) / interval_ns))
    time_ns = begin + np.rint(np.arange(min(count, MOST_PULSES + 1)) * interval_ns)
    missed: tuple[str, ...] = ()
    if listened:
        heard = within(time_ns, listened)
        missed = missing_in_words(float(heard.mean()))
        time_ns = time_ns[heard] if heard.any() else time_ns[:1]
    known = poses.time_ns.astype(np.float64)
    place = area.ground.plane.to_local(poses.latitude_deg, poses.longitude_deg)
    east, north = (np.interp(time_ns, known, one) for one in place)
    over_start_m = np.interp(time_ns, known, np.nan_to_num(poses.height_m, nan=0.0))
    height, limitations = _above_ground(area, flight, east, north, over_start_m)
    after = np.clip(np.searchsorted(known, time_ns), 1, len(known) - 1)
    nearest = after - (time_ns - known[after - 1] <= known[after] - time_ns)
    return (
        AntennaPath(
            time_s=(time_ns - begin) / NANOSECONDS_PER_SECOND,
            east_m=east,
            north_m=north,
            height_m=height,
            headings=Headings.from_quaternions(poses.quaternion_wxyz[nearest]),
            noise_db=None if noise is None else noise.at(tag.tag_id, time_ns.astype(np.int64)),
        ),
        (*missed, *limitations),
    )


def _above_ground(
    area: MapArea, flight: Flight, east: _Floats, north: _Floats, over_start_m: _Floats
) -> tuple[_Floats, tuple[str, ...]]:
    ground = area.ground
    limitations: list[str] = []
    first = flight.poses[0]
    at = ground.plane.to_local([first.latitude_deg], [first.longitude_deg])
    start_m = float(ground(*at)[0])
    height = start_m + over_start_m - ground(east, north)
    if area.hills:
        said_m = first.altitude_amsl_m - first.altitude_relative_m
        limitations += height_warning(start_m, said_m)
    below = float(np.mean(height < 0.0))
    if below > 0.02:
        limitations.append(
            f"{below:.0%} of the flight is below the ground in the elevation files: there "
            f"{_LEAST_HEIGHT_M:g} m above ground is assumed"
        )
    return np.maximum(height, _LEAST_HEIGHT_M), tuple(limitations)
