"""From a flight, or a pulse log, to bearings: find the turns, collect the pulses, estimate."""

import math
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np

from uavrt.analysis.flown_with import USUAL_ANTENNA, flight_antenna, flight_settings
from uavrt.errors import FormatError, UsageError
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
    teaching,
    turns_in,
    widest_gap_deg,
)
from uavrt.localization.bearing import ADDED_METHODS
from uavrt.messages import PulsePose
from uavrt.recording import (
    Flight,
    FlightLayout,
    flights_in_order,
    flown_before,
    flown_name,
    read_flight,
    vehicle_of,
)
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
    flight: int = 0
    """Which of the flights or logs that were read together, from 0."""


def read_bearings(
    path: str | os.PathLike[str],
    *,
    method: BearingMethod = "pattern_ml",
    antenna: AntennaPattern | str | None = None,
    learn: bool = True,
    offset_deg: float = 0.0,
    warn: Callable[[str], None] = lambda text: None,
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
        ``pattern_ml`` corrects it by what the turns show, those of past flights included.
    learn : bool
        False takes the pattern as it is.
    offset_deg : float
        Boresight clockwise from the heading that the pulses carry.
    warn : callable, optional
        Called with what taught the pattern, where that is more than this flight.

    Raises
    ------
    FormatError
        It is none of them.
    UsageError
        No pulse has a pose, or method or antenna is unknown.
    """
    return read_bearings_together(
        [path], method=method, antenna=antenna, learn=learn, offset_deg=offset_deg, warn=warn
    )


def read_bearings_together(
    paths: Sequence[str | os.PathLike[str]],
    *,
    method: BearingMethod = "pattern_ml",
    antenna: AntennaPattern | str | None = None,
    learn: bool = True,
    offset_deg: float = 0.0,
    warn: Callable[[str], None] = lambda text: None,
) -> list[TagBearing]:
    """Estimate the bearings of several flights or logs, which teach each other's pattern.

    See `read_bearings`; those of one antenna go together.
    """
    check_bearing_method(method)
    taken = [_taken(path, antenna, offset_deg) for path in paths]
    found = []
    taught: set[str] = set()
    for number, one in enumerate(taken):
        own = [other.heard for other in taken if other.antenna == one.antenna]
        flights = [one.heard, *(heard for heard in own if heard is not one.heard)]
        if one.flight is not None and learn:
            here = [other.flight for other in taken if other.flight is not None]
            flights += past_turns(one.flight, one.antenna, offset_deg, besides=here)
        others = [heard for flight in flights[1:] for heard in flight]
        if learn and method == "pattern_ml" and (text := taught_in_words(flights)):
            taught.add(text)
        estimated = _estimated(one.heard, one.every, method, one.antenna, learn, others)
        found += [replace(each, flight=number) for each in estimated]
    for text in sorted(taught):
        warn(text)
    return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Taken:
    """What was heard in the turns of a flight or log."""

    antenna: AntennaPattern | str
    heard: list[HeardInTurn]
    every: "_Pulses"
    flight: Flight | None
    """None of a log."""


def _taken(
    path: str | os.PathLike[str], antenna: AntennaPattern | str | None, offset_deg: float
) -> _Taken:
    if not FlightLayout(Path(path)).database.is_file():
        pulse_poses = read_pulses(path)
        _check_poses(pulse_poses)
        heard, every = _heard_in_log(pulse_poses, offset_deg)
        return _Taken(antenna=antenna or USUAL_ANTENNA, heard=heard, every=every, flight=None)
    named = antenna or pattern_of(path)
    flight = read_flight(path)
    heard, every = heard_in_turns(flight, offset_deg)
    return _Taken(antenna=named, heard=heard, every=every, flight=flight)


MOST_PAST_FLIGHTS = 6
"""Past flights that are looked into: each costs about as much as the flight itself."""
ENOUGH_TURNS = 12
"""More turns teach a pattern little."""


def past_turns(
    flight: Flight,
    antenna: AntennaPattern | str,
    offset_deg: float = 0.0,
    *,
    besides: Sequence[Flight] = (),
) -> list[list[HeardInTurn]]:
    """What was heard in turns of the same drone's past flights with the same antenna.

    Those in the same folder, the newest first, until there are turns enough. A past flight that
    cannot be read, or is another drone's, teaches nothing. Which are past is told by the order
    in which they were noted, and where it was not, by when they began.

    Parameters
    ----------
    flight : Flight
        The one that is looked at.
    antenna : AntennaPattern or str
        Its pattern.
    offset_deg : float
        Boresight clockwise from the heading that the pulses carry.
    besides : sequence of Flight
        Flights that teach anyway.
    """
    place = Path(flight.info.directory).resolve()
    names = {Path(one.info.directory).resolve().name for one in besides}
    before = flown_before(place)
    beside = flights_in_order(place.parent) if before is None else before
    others = [path for path in beside if flown_name(path.name) != flown_name(place.name)]
    past = [path for path in others if path.name not in names]
    found: list[list[HeardInTurn]] = []
    for path in reversed(past[-MOST_PAST_FLIGHTS:]):
        if sum(map(len, map(teaching, found))) >= ENOUGH_TURNS:
            break
        try:
            other = read_flight(path)
            is_past = before is not None or (
                other.info.start_time_ns < flight.info.start_time_ns
            )
            if is_past and _same_set_up(other, flight):
                found.append(heard_in_turns(other, offset_deg)[0])
        except (FormatError, UsageError):
            continue  # its turns are not needed
    return [one for one in found if one]


def _same_set_up(one: Flight, other: Flight) -> bool:
    """Whether drone, antenna and mounting are the same, as far as the flights tell."""
    settings = [flight_settings(flight) for flight in (one, other)]
    mounted = [None if it is None else (it.antenna, it.bearings.antenna) for it in settings]
    return mounted[0] == mounted[1] and vehicle_of(one.notes) == vehicle_of(other.notes)


def taught_in_words(flights: Sequence[Sequence[HeardInTurn]]) -> str | None:
    """What taught the pattern, where that is more than one flight and enough."""
    turns = teaching(heard for flight in flights for heard in flight)
    used = sum(1 for flight in flights if any(one in turns for one in flight))
    if used < 2 or len(turns) < LEAST_TURNS:
        return None
    return f"the antenna's pattern is as {len(turns)} turns of {used} flights have shown it"


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
    past: Sequence[HeardInTurn] = (),
) -> list[TagBearing]:
    """One bearing for each tag and each turn in place, in order of time and tag.

    Turns are found in the vehicle's poses; headings are the antenna's, which the pulses carry.
    Pulses that a known interval says must have come, and that were not heard, count as misses.
    The pattern is corrected by what three or more turns show of it, `past` ones included.

    Raises
    ------
    UsageError
        No pulse has a pose.
    """
    heard, every = heard_in_turns(flight, offset_deg)
    return _estimated(heard, every, method, antenna, learn, past)


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
    heard, every = _heard_in_log(pulse_poses, offset_deg)
    return _estimated(heard, every, method, antenna, learn)


def _heard_in_log(
    pulse_poses: Sequence[PulsePose], offset_deg: float
) -> tuple[list[HeardInTurn], _Pulses]:
    """What was heard in the turns of a log, and all its pulses."""
    every = _by_tag(pulse_poses)
    if not every:
        return [], every
    poses = _poses_of(every)
    if _in_place(poses) and not poses.leaves_ground:
        whole = [_whole_log(tag, every[tag], poses, offset_deg) for tag in sorted(every)]
        return whole, every
    return _in_turns(every, poses, {}, offset_deg), every


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
    past: Sequence[HeardInTurn] = (),
) -> list[TagBearing]:
    if learn and method == "pattern_ml" and heard:
        antenna = antenna_as_shown([*heard, *past], antenna)
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
