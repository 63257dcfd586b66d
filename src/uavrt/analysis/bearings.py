"""From a flight, or a pulse log, to bearings: find the turns, collect the pulses, estimate."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from uavrt.errors import UsageError
from uavrt.localization import (
    AntennaPattern,
    Bearing,
    BearingMethod,
    TangentPlane,
    Turn,
    TurnPulses,
    estimate_bearing,
    find_turns,
    learn_pattern,
)
from uavrt.localization.antenna import pattern_named
from uavrt.localization.attitude import Headings
from uavrt.localization.bearing import ADDED_METHODS
from uavrt.messages import Pose, PulsePose, Tag
from uavrt.recording import Flight, FlightLayout, read_flight
from uavrt.recording.formats import read_pulses

NO_BEARINGS_FROM_THESE = (
    "No bearing is computed from these poses; detect again in a recording with the poses of "
    "the autopilot's own log, or fly again."
)
HEADING_SIGMA_DEG = 1.0
"""Compass and mounting err by that much, the same for a whole turn, at the least."""
MISS_THRESHOLD_DB = 13.0
"""SNR from which a pulse that a detector was following is not missed: three pulses of 11.4 dB
are found with 90 % (DESIGN.md §5), the rest is room for losses."""
_IN_PLACE_M = 30.0
_FEWEST_PULSES = 3
_FEWEST_TURNS = 3

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class TagBearing:
    """A bearing of a tag, where and when it was taken."""

    tag_id: int
    bearing: Bearing
    latitude_deg: float
    """Median over the pulses, as are the other two."""
    longitude_deg: float
    altitude_amsl_m: float
    start_time_ns: int
    """Of the first pulse."""
    end_time_ns: int


def read_bearings(
    path: str | os.PathLike[str],
    *,
    method: BearingMethod = "pattern_ml",
    antenna: AntennaPattern | str = "RA-23K",
) -> list[TagBearing]:
    """Estimate the bearings of a flight directory or a pulse log in any format we know.

    Raises
    ------
    FormatError
        It is none of them.
    UsageError
        No pulse has a pose, or method or antenna is unknown.
    """
    check_bearing_method(method)
    if FlightLayout(Path(path)).database.is_file():
        return bearings_of_flight(read_flight(path), method=method, antenna=antenna)
    return bearings_of_pulses(read_pulses(path), method=method, antenna=antenna)


def check_bearing_method(method: str) -> None:
    """Refuse an unknown method, also where no turn was flown; raises `UsageError`."""
    known = [*get_args(BearingMethod), *ADDED_METHODS]
    if method not in known:
        raise UsageError(
            f"there is no method {method!r}", remedy=f"Known are {', '.join(known)}"
        )


def bearings_of_flight(
    flight: Flight,
    *,
    method: BearingMethod = "pattern_ml",
    antenna: AntennaPattern | str = "RA-23K",
) -> list[TagBearing]:
    """One bearing for each tag and each turn in place, in order of time and tag.

    Turns are found in the vehicle's poses; headings are the antenna's, which the pulses carry.
    Pulses that a known interval says must have come, and that were not heard, count as misses.
    """
    return [
        _estimated(pulses, missed, method, antenna) for pulses, missed in heard_in_turns(flight)
    ]


Heard = tuple[Sequence[PulsePose], Sequence[float]]
"""Pulses of one tag in one turn, and the antenna's headings at those that were missed."""


def heard_in_turns(flight: Flight) -> list[Heard]:
    """What was heard of each tag in each turn in place, in order of time and tag.

    Raises
    ------
    UsageError
        No pulse has a pose.
    """
    _check_poses(flight.pulse_poses)
    found: list[Heard] = []
    for turn in _turns_of(flight.poses):
        inside = [one for one in flight.pulse_poses if _during(one, turn)]
        for tag_id in _tag_ids(inside):
            pulses = [one for one in inside if one.pulse.tag_id == tag_id]
            if len(pulses) < _FEWEST_PULSES:
                continue
            every = [one for one in flight.pulse_poses if one.pulse.tag_id == tag_id]
            tags = {tag.tag_id: tag for tag in flight.info.tags}
            missed = _missed_yaws(every, tags.get(tag_id), turn, flight.poses)
            found.append((pulses, missed))
    return found


def learnt_antenna(path: str | os.PathLike[str], antenna: str) -> AntennaPattern:
    """Correct a pattern by the turns of a flight: the antenna as it is on this airframe.

    Raises
    ------
    UsageError
        It is no flight directory, or has fewer than three turns past a tag.
    """
    if not FlightLayout(Path(path)).database.is_file():
        raise UsageError("only a flight directory teaches a pattern", remedy="Name one")
    turns = [_turn_pulses(*one) for one in heard_in_turns(read_flight(path))]
    if len(turns) < _FEWEST_TURNS:
        raise UsageError(
            f"{len(turns)} turns past a tag do not teach a pattern",
            remedy=f"Turn in place {_FEWEST_TURNS} times or more, or hear more tags",
        )
    return learn_pattern(turns, pattern_named(antenna), threshold_db=MISS_THRESHOLD_DB)


def _turn_pulses(pulses: Sequence[PulsePose], missed_yaw_deg: Sequence[float]) -> TurnPulses:
    poses = [one.pose for one in pulses if one.pose is not None]
    snr = np.array([one.pulse.snr_db for one in pulses])
    return TurnPulses(
        yaw_deg=np.concatenate([_yaw_deg(poses), missed_yaw_deg]),
        matched_power=np.concatenate(
            [1.0 + 10.0 ** (snr / 10.0), np.full(len(missed_yaw_deg), np.nan)]
        ),
    )


def bearings_of_pulses(
    pulse_poses: Sequence[PulsePose],
    *,
    method: BearingMethod = "pattern_ml",
    antenna: AntennaPattern | str = "RA-23K",
) -> list[TagBearing]:
    """Bearings from a log of pulses alone.

    A log whose pulses were all heard at one place is one turn, as the original takes it; in a
    longer one the turns are sought in the pulses' own poses.
    """
    _check_poses(pulse_poses)
    placed = [one for one in pulse_poses if one.pose is not None]
    if _in_place([one.pose for one in placed if one.pose is not None]):
        spans = [placed]
    else:
        turns = _turns_of([one.pose for one in placed if one.pose is not None])
        spans = [[one for one in placed if _during(one, turn)] for turn in turns]
    return [
        _estimated([one for one in span if one.pulse.tag_id == tag_id], [], method, antenna)
        for span in spans
        for tag_id in _tag_ids(span)
    ]


def _check_poses(pulse_poses: Sequence[PulsePose]) -> None:
    if pulse_poses and all(one.pose is None for one in pulse_poses):
        raise UsageError(
            "no pulse has a pose, so none has a heading",
            remedy="Bearings need a log that was recorded with the autopilot connected",
        )


def _tag_ids(pulses: Iterable[PulsePose]) -> list[int]:
    return sorted({one.pulse.tag_id for one in pulses})


def _turns_of(poses: Iterable[Pose]) -> list[Turn]:
    by_time = {pose.time_ns: pose for pose in poses}
    ordered = [by_time[time] for time in sorted(by_time)]
    if not ordered:
        return []
    return find_turns(
        np.array([pose.time_ns for pose in ordered], np.int64),
        _yaw_deg(ordered),
        np.array([pose.latitude_deg for pose in ordered]),
        np.array([pose.longitude_deg for pose in ordered]),
        height_m=np.array([pose.altitude_relative_m for pose in ordered]),
    )


def _yaw_deg(poses: Sequence[Pose]) -> _Floats:
    return Headings.from_quaternions([pose.quaternion_wxyz for pose in poses]).yaw_deg


def _in_place(poses: Sequence[Pose]) -> bool:
    if not poses:
        return False
    latitude = np.array([pose.latitude_deg for pose in poses])
    longitude = np.array([pose.longitude_deg for pose in poses])
    plane = TangentPlane(
        latitude_deg=float(np.median(latitude)), longitude_deg=float(np.median(longitude))
    )
    return bool(np.hypot(*plane.to_local(latitude, longitude)).max() <= _IN_PLACE_M)


def _during(one: PulsePose, turn: Turn) -> bool:
    middle = (one.pulse.start_time_ns + one.pulse.end_time_ns) // 2
    return one.pose is not None and turn.start_time_ns <= middle <= turn.end_time_ns


def _missed_yaws(
    every: Sequence[PulsePose], tag: Tag | None, turn: Turn, poses: Sequence[Pose]
) -> list[float]:
    """Headings of the antenna at pulses that must have come during a turn and were not heard.

    Between two heard pulses whose distance is a multiple of the tag's interval. The heading is
    the vehicle's, plus what the antenna's differed from it at the heard pulses.
    """
    if tag is None or not poses:
        return []
    time_ns = np.array([pose.time_ns for pose in poses], np.int64)
    yaw = np.unwrap(_yaw_deg(poses), period=360.0)
    heard = sorted((one for one in every if one.pose), key=lambda one: one.pulse.start_time_ns)
    times: list[float] = []
    for before, after in pairwise(heard):
        rate = min(max(before.pulse.rate, 1), len(tag.pulse_intervals_s))
        interval_ns = tag.pulse_intervals_s[rate - 1] * 1e9
        gap_ns = after.pulse.start_time_ns - before.pulse.start_time_ns
        count = round(gap_ns / interval_ns)
        tolerance_ns = 1e9 * tag.interval_uncertainty_s * count + 0.1 * interval_ns
        if count > 1 and abs(gap_ns - count * interval_ns) <= tolerance_ns:
            start = before.pulse.start_time_ns
            times += [start + gap_ns * step / count for step in range(1, count)]
    inside = [time for time in times if turn.start_time_ns <= time <= turn.end_time_ns]
    antenna = _yaw_deg([one.pose for one in heard if one.pose])
    vehicle = np.interp([one.pulse.start_time_ns for one in heard], time_ns, yaw)
    offset = np.angle(np.mean(np.exp(1j * np.radians(antenna - vehicle))), deg=True)
    return [float(value + offset) % 360.0 for value in np.interp(inside, time_ns, yaw)]


def _estimated(
    pulses: Sequence[PulsePose],
    missed_yaw_deg: Sequence[float],
    method: BearingMethod,
    antenna: AntennaPattern | str,
) -> TagBearing:
    poses = [one.pose for one in pulses if one.pose is not None]
    half = np.radians(np.array(missed_yaw_deg, np.float64)) / 2.0
    nothing = np.zeros(len(half))
    missed = np.stack([np.cos(half), nothing, nothing, np.sin(half)], axis=1)
    heard = np.array([pose.quaternion_wxyz for pose in poses])
    noise = np.array([one.pulse.noise_psd for one in pulses])
    known = bool(np.all(np.isfinite(noise) & (noise > 0.0)))
    fill = np.full(len(half), np.median(noise) if known else 1.0)
    snr = [one.pulse.snr_db for one in pulses]
    bearing = estimate_bearing(
        None,
        np.concatenate([snr, np.full(len(half), np.nan)]),
        method=method,
        antenna=antenna,
        quaternion_wxyz=np.concatenate([heard, missed]),
        noise_psd=np.concatenate([noise, fill]) if known else None,
        threshold_db=MISS_THRESHOLD_DB,
        heading_sigma_deg=HEADING_SIGMA_DEG,
    )
    return TagBearing(
        tag_id=pulses[0].pulse.tag_id,
        bearing=bearing,
        latitude_deg=float(np.median([pose.latitude_deg for pose in poses])),
        longitude_deg=float(np.median([pose.longitude_deg for pose in poses])),
        altitude_amsl_m=float(np.median([pose.altitude_amsl_m for pose in poses])),
        start_time_ns=min(one.pulse.start_time_ns for one in pulses),
        end_time_ns=max(one.pulse.end_time_ns for one in pulses),
    )
