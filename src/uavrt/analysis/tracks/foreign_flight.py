"""Create a flight record from another program's track and samples."""

from collections.abc import Sequence

from uavrt.config.settings import AntennaSettings
from uavrt.core.errors import PoseUnavailable, UsageError
from uavrt.core.messages import FlightInfo, Pose, Tag
from uavrt.core.units import ns_from_s
from uavrt.flight.reading.flight_reader import Flight
from uavrt.formats.tracks.track import VehicleTrack
from uavrt.localization.pose.ring import PoseRing

_STEP_NS = 200_000_000
"""Interval between the poses of a flight [ns]; at 30°/s the heading changes by 6°."""


def flight_of_track(
    track: VehicleTrack,
    tags: Sequence[Tag],
    *,
    name: str,
    offset_s: float = 0.0,
    yaw_offset_deg: float = 0.0,
) -> Flight:
    """Create a flight from a track with 5 antenna poses a second; `offset_s` is added to the
    track's times.
    """
    if len(track.attitudes) < 2 or len(track.positions) < 2:
        raise UsageError(f"{name} is an empty track", remedy="Give another log")
    poses = _poses(track.shifted(ns_from_s(offset_s)), yaw_offset_deg)
    if not poses:
        raise UsageError(
            f"{name} has no time with both a position and a heading", remedy="Give another log"
        )
    return Flight(
        info=FlightInfo(
            directory=name,
            start_time_ns=poses[0].time_ns,
            clock_offset_ns=0,
            tags=tuple(tags),
            center_frequency_hz=tags[0].frequency_hz if tags else 0.0,
            sample_rate_hz=0.0,
        ),
        settings_json=None,
        pulse_poses=(),
        poses=poses,
        status_texts=(),
        notes=(),
    )


def _poses(track: VehicleTrack, yaw_offset_deg: float) -> tuple[Pose, ...]:
    ring = PoseRing(
        AntennaSettings(yaw_offset_deg=yaw_offset_deg),
        capacity=max(len(track.attitudes), len(track.positions)),
    )
    for attitude in track.attitudes:
        ring.add_attitude(attitude)
    for position in track.positions:
        ring.add_position(position)
    begin = max(track.attitudes[0].time_ns, track.positions[0].time_ns)
    end = min(track.attitudes[-1].time_ns, track.positions[-1].time_ns)
    found = []
    for time_ns in range(begin, end + 1, _STEP_NS):
        try:
            found.append(ring.antenna_pose(time_ns))
        except PoseUnavailable:  # a gap of the track
            continue
    return tuple(found)
