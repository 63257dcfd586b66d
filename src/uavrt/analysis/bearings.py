"""From a flight, or a pulse log, to bearings: find the turns, collect the pulses, estimate."""

import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from uavrt.analysis.flown_with import USUAL_ANTENNA, flight_antenna
from uavrt.errors import UsageError
from uavrt.localization import (
    LEAST_TURNS,
    MONOPOLE,
    AntennaPattern,
    Bearing,
    BearingMethod,
    HeardInTurn,
    PoseColumns,
    PulseColumns,
    Rhythm,
    TangentPlane,
    Turn,
    antenna_as_shown,
    bearing_of,
    heard_in,
    turns_in,
    widest_gap_deg,
)
from uavrt.localization.bearing import ADDED_METHODS
from uavrt.messages import PulsePose
from uavrt.recording import Flight, FlightLayout, read_flight
from uavrt.recording.formats import read_pulses

NO_BEARINGS_FROM_THESE = (
    "No bearing is computed from these poses; detect again in a recording with the poses of "
    "the autopilot's own log, or fly again."
)
_IN_PLACE_M = 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TagBearing:
    """A bearing to a tag, with place and time."""

    tag_id: int
    bearing: Bearing
    latitude_deg: float
    """Median over the pulses, as are the other two."""
    longitude_deg: float
    altitude_amsl_m: float
    start_time_ns: int
    """Of the first pulse."""
    middle_time_ns: int
    end_time_ns: int


def read_bearings(
    path: str | os.PathLike[str],
    *,
    method: BearingMethod = "pattern_ml",
    antenna: AntennaPattern | str | None = None,
    learn: bool = True,
    offset_deg: float = 0.0,
) -> list[TagBearing]:
    """Estimate the bearings of a flight directory or a pulse log in any format we know.

    Parameters
    ----------
    path : path
        The flight or log.
    method : str
        How pulses become a bearing.
    antenna : AntennaPattern or str, optional
        The pattern, by default that of the flight's settings, RA-23K for logs; the method
        ``pattern_ml`` corrects it by what the turns show.
    learn : bool
        False takes the pattern as it is.
    offset_deg : float
        Boresight clockwise from the heading that the pulses carry.

    Raises
    ------
    FormatError
        It is none of them.
    UsageError
        No pulse has a pose, or method or antenna is unknown.
    """
    check_bearing_method(method)
    if FlightLayout(Path(path)).database.is_file():
        return bearings_of_flight(
            read_flight(path),
            method=method,
            antenna=antenna or pattern_of(path),
            learn=learn,
            offset_deg=offset_deg,
        )
    return bearings_of_pulses(
        read_pulses(path),
        method=method,
        antenna=antenna or USUAL_ANTENNA,
        learn=learn,
        offset_deg=offset_deg,
    )


def pattern_of(path: str | os.PathLike[str]) -> str:
    """Name of the antenna that a flight or log was taken with, for its bearings.

    Raises
    ------
    UsageError
        It tells no directions, or is not known here.
    """
    if not FlightLayout(Path(path)).database.is_file():
        return USUAL_ANTENNA
    named = flight_antenna(read_flight(path))
    if named == MONOPOLE:
        raise UsageError(
            "the drone was set up with an upright whip, which tells no directions",
            remedy="uavrt localize finds tags by their strength; or name the --antenna",
        )
    return named


def check_bearing_method(method: str) -> None:
    """Refuse an unknown method, also where no turn was flown; raises `UsageError`."""
    known = [*get_args(BearingMethod), *ADDED_METHODS]
    if method not in known:
        raise UsageError(
            f"there is no method {method!r}", remedy=f"Choose from {', '.join(known)}"
        )


def bearings_of_flight(
    flight: Flight,
    *,
    method: BearingMethod = "pattern_ml",
    antenna: AntennaPattern | str = "RA-23K",
    learn: bool = True,
    offset_deg: float = 0.0,
) -> list[TagBearing]:
    """One bearing for each tag and each turn in place, in order of time and tag.

    Turns are found in the vehicle's poses; headings are the antenna's, which the pulses carry.
    Pulses that a known interval says must have come, and that were not heard, count as misses.
    The pattern is corrected by what three or more turns show of it.

    Raises
    ------
    UsageError
        No pulse has a pose.
    """
    heard, every = heard_in_turns(flight, offset_deg)
    return _estimated(heard, every, method, antenna, learn)


_Pulses = dict[int, list[PulsePose]]
"""Of each tag, those with a pose and a power, in order of time."""


def heard_in_turns(
    flight: Flight, offset_deg: float = 0.0
) -> tuple[list[HeardInTurn], _Pulses]:
    """What was heard of each tag in each turn in place, in order of time and tag.

    Where the vehicle's poses are missing, those of the pulses stand. The antenna is turned by
    an offset clockwise from the heading that the pulses carry.

    Raises
    ------
    UsageError
        No pulse has a pose.
    """
    _check_poses(flight.pulse_poses)
    every = _by_tag(flight.pulse_poses)
    rhythms = {tag.tag_id: Rhythm.of(tag) for tag in flight.info.tags}
    poses = PoseColumns.of(flight.poses, flight.on_ground_ns).completed(_poses_of(every))
    return _in_turns(every, poses, rhythms, offset_deg), every


def _in_turns(
    every: _Pulses,
    poses: PoseColumns,
    rhythms: dict[int, Rhythm],
    offset_deg: float = 0.0,
) -> list[HeardInTurn]:
    columns = {
        tag_id: PulseColumns.of(pulses).turned(offset_deg) for tag_id, pulses in every.items()
    }
    found = [
        heard_in(tag_id, turn, columns[tag_id], poses, rhythms.get(tag_id))
        for turn in turns_in(poses)
        for tag_id in sorted(columns)
    ]
    return [one for one in found if one is not None]


def _by_tag(pulse_poses: Iterable[PulsePose]) -> _Pulses:
    usable = [one for one in pulse_poses if one.pose and math.isfinite(one.pulse.snr_db)]
    usable.sort(key=lambda one: one.pulse.start_time_ns)
    found: _Pulses = {}
    for one in usable:
        found.setdefault(one.pulse.tag_id, []).append(one)
    return found


def learnt_antenna(
    path: str | os.PathLike[str], antenna: str, offset_deg: float = 0.0
) -> AntennaPattern:
    """Correct a pattern by the turns of a flight or log: the antenna as it is on this airframe.

    The antenna is turned by an offset clockwise from the heading that the pulses carry.

    Raises
    ------
    UsageError
        It has fewer than three turns past a tag.
    """
    if FlightLayout(Path(path)).database.is_file():
        heard, _ = heard_in_turns(read_flight(path), offset_deg)
    else:
        every = _by_tag(read_pulses(path))
        heard = _in_turns(every, _poses_of(every), {}, offset_deg)
    if len(heard) < LEAST_TURNS:
        raise UsageError(
            f"{len(heard)} turns past a tag are too few to learn a pattern",
            remedy=f"Turn in place {LEAST_TURNS} times or more, or hear more tags",
        )
    return antenna_as_shown(heard, antenna)


def _poses_of(every: _Pulses) -> PoseColumns:
    """The pulses' own poses: those of all tags together."""
    return PoseColumns.of(one.pose for pulses in every.values() for one in pulses if one.pose)


def bearings_of_pulses(
    pulse_poses: Sequence[PulsePose],
    *,
    method: BearingMethod = "pattern_ml",
    antenna: AntennaPattern | str = "RA-23K",
    learn: bool = True,
    offset_deg: float = 0.0,
) -> list[TagBearing]:
    """Bearings from a log of pulses alone.

    A log whose pulses were all heard at one place, without a climb, is one turn, as the
    original takes it; in a longer one the turns are sought in the pulses' own poses. The
    antenna is turned by an offset clockwise from the heading that the pulses carry.
    """
    _check_poses(pulse_poses)
    every = _by_tag(pulse_poses)
    if not every:
        return []
    poses = _poses_of(every)
    if _in_place(poses) and not poses.leaves_ground:
        heard = [_whole_log(tag, every[tag], poses, offset_deg) for tag in sorted(every)]
    else:
        heard = _in_turns(every, poses, {}, offset_deg)
    return _estimated(heard, every, method, antenna, learn)


def _whole_log(
    tag_id: int, pulses: Sequence[PulsePose], poses: PoseColumns, offset_deg: float
) -> HeardInTurn:
    """All pulses of a tag as those of one turn."""
    columns = PulseColumns.of(pulses).turned(offset_deg)
    yaw = np.unwrap(poses.yaw_deg, period=360.0)
    place = (float(np.median(columns.latitude_deg)), float(np.median(columns.longitude_deg)))
    turn = Turn(
        start_time_ns=int(poses.time_ns[0]),
        end_time_ns=int(poses.time_ns[-1]),
        turned_deg=float(yaw[-1] - yaw[0]),
        stops=0,
        widest_gap_deg=widest_gap_deg(yaw),
        latitude_deg=place[0],
        longitude_deg=place[1],
    )
    return HeardInTurn(
        tag_id=tag_id,
        turn=turn,
        inside=np.arange(len(pulses)),
        latitude_deg=place[0],
        longitude_deg=place[1],
        start_time_ns=int(columns.time_ns[0]),
        middle_time_ns=int(columns.time_ns[0] + columns.time_ns[-1]) // 2,
        quaternion_wxyz=columns.quaternion_wxyz,
        snr_db=columns.snr_db,
        noise_psd=columns.noise_psd,
        missed_yaw_deg=np.zeros(0),
    )


def _check_poses(pulse_poses: Sequence[PulsePose]) -> None:
    if pulse_poses and all(one.pose is None for one in pulse_poses):
        raise UsageError(
            "no pulse has a pose, so headings are unknown",
            remedy="Bearings need a log that was recorded with the autopilot connected",
        )


def _in_place(poses: PoseColumns) -> bool:
    plane = TangentPlane(
        latitude_deg=float(np.median(poses.latitude_deg)),
        longitude_deg=float(np.median(poses.longitude_deg)),
    )
    off = np.hypot(*plane.to_local(poses.latitude_deg, poses.longitude_deg))
    return bool(off.max() <= _IN_PLACE_M)


def _estimated(
    heard: Sequence[HeardInTurn],
    every: _Pulses,
    method: BearingMethod,
    antenna: AntennaPattern | str,
    learn: bool,
) -> list[TagBearing]:
    if learn and method == "pattern_ml" and heard:
        antenna = antenna_as_shown(heard, antenna)
    found = []
    for one in heard:
        pulses = [every[one.tag_id][number] for number in one.inside]
        altitudes = [pulse.pose.altitude_amsl_m for pulse in pulses if pulse.pose is not None]
        found.append(
            TagBearing(
                tag_id=one.tag_id,
                bearing=bearing_of(one, antenna=antenna, method=method),
                latitude_deg=one.latitude_deg,
                longitude_deg=one.longitude_deg,
                altitude_amsl_m=float(np.median(altitudes)),
                start_time_ns=one.start_time_ns,
                middle_time_ns=one.middle_time_ns,
                end_time_ns=max(pulse.pulse.end_time_ns for pulse in pulses),
            )
        )
    return found
