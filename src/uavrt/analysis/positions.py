"""From flights, pulse logs or a bearings.csv to one position for each tag."""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import get_args

import numpy as np

from uavrt.analysis.bearings import NO_BEARINGS_FROM_THESE, TagBearing, read_bearings_together
from uavrt.analysis.flight_copies import SAME_PULSES
from uavrt.analysis.flown_with import USUAL_ANTENNA, flight_antenna
from uavrt.analysis.log_clocks import clock_doubts
from uavrt.analysis.power_survey import (
    HeardStrength,
    TagSignal,
    power_track,
    signal_of,
)
from uavrt.analysis.same_tags import SameTags, ToldTag, same_tags
from uavrt.analysis.standing import stands, strengths_without_bearing
from uavrt.errors import UsageError
from uavrt.localization import (
    HEIGHT_SIGMA_M,
    MONOPOLE,
    ONE_FLIGHT_S,
    AntennaPattern,
    OverGround,
    PoseColumns,
    Position,
    PositionMethod,
    PowerTrack,
    Stations,
    Strengths,
    located,
    position_of_bearings,
)
from uavrt.localization.position import ADDED_METHODS, HEADING_SIGMA_DEG
from uavrt.messages import Pose, PulsePose, Tag
from uavrt.recording import FlightLayout, read_flight, vehicle_of
from uavrt.recording.formats import (
    ORIGINAL_POSES,
    WITHOUT_HEADINGS,
    BearingRow,
    PulseLog,
    TargetEstimate,
    cells_of,
    pulse_logs_in,
    read_bearing_file,
    read_lines,
    read_position_file,
    read_pulse_log,
    read_ucsd_estimates,
    tag_numbers,
    with_commas,
)
from uavrt.terrain import Elevation
from uavrt.units import NANOSECONDS_PER_SECOND

_FIRST_LINES = 100
"""Which tell what a file is; comments may come first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TagPosition:
    """A position of a tag, or why there is none."""

    tag_id: int
    position: Position | None
    reason: str | None = None
    """Why there is no position."""
    frequency_hz: float | None = None
    """Median of what was heard, where logs with pulses were read."""
    name: str | None = None
    """In the list of the flights."""


def read_positions(
    *paths: str | os.PathLike[str],
    method: PositionMethod = "bayes",
    antenna: AntennaPattern | str | None = None,
    offset_deg: float = 0.0,
    height_m: float | None = None,
    heading_sigma_deg: float = HEADING_SIGMA_DEG,
    height_sigma_m: float = HEIGHT_SIGMA_M,
    elevation: Elevation | None = None,
    warn: Callable[[str], None] = lambda text: None,
) -> list[TagPosition]:
    """Estimate the positions of tags from all that is known of them.

    Parameters
    ----------
    *paths : path
        Flights, pulse logs of any kind, folders of them: their bearings go together, one
        position for each tag, taken to rest. Or one or more bearings.csv. A positions.csv, and
        an estimate CSV of UCSD's tracker, give what is in them.
    method : str
        How bearings become positions.
    antenna : str, optional
        Pattern of the antenna; without it that of each flight's settings, RA-23K for logs
        without, and a monopole for UCSD's pings.
    offset_deg : float
        Boresight clockwise from the heading that the pulses carry.
    height_m : float, optional
        With a monopole: the drone's height over the tags where the log does not tell it.
    heading_sigma_deg : float
        Error that all headings of the flight share, one standard deviation.
    height_sigma_m : float
        With a monopole: error that all heights over a tag share, one standard deviation.
    elevation : Elevation, optional
        Heights of the ground: hills weaken what is heard, and explain silence.
    warn : callable, optional
        Called with what somebody who works with a log must know.

    Raises
    ------
    FormatError
        One of them is nothing of that kind.
    UsageError
        There is no such method; or what was given cannot go together.
    """
    check_position_method(method)
    if offset_deg and any(_is_result(path) for path in paths):
        raise UsageError(
            "an antenna offset turns bearings as they are estimated; this file has results",
            remedy="Name the flight or the pulse log that it came from",
        )
    if len(paths) == 1:
        if _holds_estimates(paths[0]):
            return _stored_estimates(paths[0])
        if _columns_of_named_file(paths[0]) in range(4, 9):
            return _stored_positions(paths[0], method)
    files = [path for path in paths if _columns_of_named_file(path)]
    if files and len(files) < len(paths):
        raise UsageError(
            "a bearings.csv cannot be combined with flights or pulse logs",
            remedy="Name the flights that its bearings came from, or only the bearings.csv",
        )
    if files and elevation is not None:
        raise UsageError(
            "a bearings.csv does not tell how high the drone was, as the ground needs",
            remedy="Name the flights that its bearings came from, or leave --dem out",
        )
    if files:
        return _positions_of_rows(
            [row for path in files for row in read_bearing_file(path)],
            method,
            heading_sigma_deg,
        )
    logs = [(path, read_pulse_log(path)) for given in paths for path in pulse_logs_in(given)]
    for text in dict.fromkeys(text for _, log in logs for text in log.warnings):
        warn(text)
    logs = _without_copies(logs, warn)
    for text in clock_doubts(logs):
        warn(text)
    same = same_tags([log for _, log in logs], [tags_of(path) for path, _ in logs])
    for text in same.warnings:
        warn(text)
    keyed = [
        _Log(
            path=path,
            log=replace(log, pulse_poses=same.keyed(number, log.pulse_poses)),
            keys=same.keys[number],
        )
        for number, (path, log) in enumerate(logs)
    ]
    found = _positions_of_logs(
        keyed,
        method=method,
        antenna=antenna,
        offset_deg=offset_deg,
        height_m=height_m,
        heading_sigma_deg=heading_sigma_deg,
        height_sigma_m=height_sigma_m,
        elevation=elevation,
        warn=warn,
    )
    return _as_told(found, same)


def _as_told(found: Sequence[TagPosition], same: SameTags) -> list[TagPosition]:
    """Positions under the numbers and names of the tags, in their order."""
    named = []
    for one in found:
        unknown = ToldTag(tag_id=one.tag_id, frequency_hz=None, name=None)
        tag = same.told.get(one.tag_id, unknown)
        named.append(
            replace(one, tag_id=tag.tag_id, frequency_hz=tag.frequency_hz, name=tag.name)
        )
    return sorted(named, key=lambda one: (one.tag_id, one.frequency_hz or 0.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Log:
    """A flight or log."""

    path: Path
    log: PulseLog
    """Its pulses have the keys of their tags."""
    keys: Mapping[int, int]
    """Its numbers of the tags, and the keys."""

    def key(self, tag_id: int) -> int:
        """Key of a tag by its number in the log."""
        return self.keys.get(tag_id, tag_id)


def _positions_of_logs(
    logs: Sequence[_Log],
    *,
    method: PositionMethod,
    antenna: AntennaPattern | str | None,
    offset_deg: float,
    height_m: float | None,
    heading_sigma_deg: float,
    height_sigma_m: float,
    elevation: Elevation | None,
    warn: Callable[[str], None],
) -> list[TagPosition]:
    poses = sorted(
        (pose for one in logs for pose in poses_of(one.path)), key=lambda pose: pose.time_ns
    )
    pulses = [one for log in logs for one in log.log.pulse_poses]
    over = None if elevation is None else over_ground(elevation, poses, pulses)
    if over is not None and len(logs) > 1:
        over = over.noting(
            "heights of several flights are counted from the first one's take-off: the flights "
            "must have begun at one place"
        )
    whips = [one for one in logs if (antenna or antenna_of(one.path, one.log)) == MONOPOLE]
    turned = [one for one in logs if one not in whips]
    standing = [one for one in whips if turned and stands(one.log.pulse_poses)]
    whips = [one for one in whips if one not in standing]
    if whips and turned:
        warn(
            "some of these logs give bearings and some only strengths: each kind has its own "
            "positions"
        )
    found: list[TagPosition] = []
    if turned or not whips:
        found += _positions_of_turns(
            turned, standing, antenna, method, offset_deg, heading_sigma_deg, over, warn
        )
    if whips:
        listed = {
            one.key(tag.tag_id): replace(tag, tag_id=one.key(tag.tag_id))
            for one in whips
            for tag in tags_of(one.path)
        }
        try:
            found += positions_of_powers(
                [one for log in whips for one in log.log.pulse_poses],
                list(listed.values()),
                [one for log in whips for one in poses_of(log.path)],
                method=method,
                height_m=height_m,
                height_sigma_m=height_sigma_m,
                over=over,
            )[0]
        except UsageError as error:
            if not turned:
                raise
            found += _without_position(whips, str(error))
    return found


def _positions_of_turns(
    logs: Sequence[_Log],
    standing: Sequence[_Log],
    antenna: AntennaPattern | str | None,
    method: PositionMethod,
    offset_deg: float,
    heading_sigma_deg: float,
    over: OverGround | None,
    warn: Callable[[str], None],
) -> list[TagPosition]:
    """Positions from bearings, and strengths of logs without; and of tags without any, why.

    `standing` are logs of whips at one place, which give no bearing.
    """
    usable = [one for one in logs if ORIGINAL_POSES not in one.log.warnings]
    if len(usable) < len(logs):
        warn(NO_BEARINGS_FROM_THESE)
    bearings = [
        replace(one, tag_id=usable[one.flight].key(one.tag_id))
        for one in read_bearings_together(
            [one.path for one in usable], antenna=antenna, offset_deg=offset_deg, warn=warn
        )
    ]
    listeners: dict[int, list[Strengths]] = {}
    if len(usable) + len(standing) > 1:
        for number, log in enumerate((*usable, *standing)):
            own = [one for one in bearings if one.flight == number]
            for tag_id, one in _strengths_in(log, own, antenna, offset_deg).items():
                listeners.setdefault(tag_id, []).append(one)
    found = positions_of_bearings(
        bearings,
        method=method,
        heading_sigma_deg=heading_sigma_deg,
        over=over,
        listeners=listeners,
    )
    placed = {one.tag_id for one in found}
    silent = _without_position((*usable, *standing), _NEVER_TURNED)
    return found + [one for one in silent if one.tag_id not in placed]


_NEVER_TURNED = (
    "it was heard, but in no turn in place; strengths of receivers that do not turn go into a "
    "position only beside the bearings of others"
)


def _strengths_in(
    log: _Log,
    bearings: Sequence[TagBearing],
    antenna: AntennaPattern | str | None,
    offset_deg: float,
) -> dict[int, Strengths]:
    """Strengths of the tags of which a log gives no bearing."""
    path = log.path
    flight = read_flight(path) if FlightLayout(path).database.is_file() else None
    vehicle = None if flight is None else vehicle_of(flight.notes)
    if flight is not None:
        listed = [replace(tag, tag_id=log.key(tag.tag_id)) for tag in flight.info.tags]
        flight = replace(flight, info=replace(flight.info, tags=tuple(listed)))
    return strengths_without_bearing(
        path.name if vehicle is None else f"{path.name} (vehicle {vehicle})",
        log.log.pulse_poses,
        bearings,
        antenna or antenna_of(path, log.log),
        offset_deg,
        flight,
    )


def _without_position(logs: Sequence[_Log], reason: str) -> list[TagPosition]:
    """Every tag that was heard, with the reason why it has no position."""
    heard = {one.pulse.tag_id for log in logs for one in log.log.pulse_poses}
    return [TagPosition(tag_id=tag, position=None, reason=reason) for tag in sorted(heard)]


def over_ground(
    elevation: Elevation, poses: Sequence[Pose], pulse_poses: Sequence[PulsePose]
) -> OverGround | None:
    """Lay the ground around a flight, of whose poses the pulses' own tell, too.

    Parameters
    ----------
    elevation : Elevation
    poses : sequence of Pose
        Of the vehicle.
    pulse_poses : sequence of PulsePose
        Their frequency is that of the losses.

    Raises
    ------
    FormatError
        A file of heights is damaged.
    """
    own = sorted((one.pose for one in pulse_poses if one.pose), key=lambda one: one.time_ns)
    columns = PoseColumns.of(poses).completed(PoseColumns.of(own))
    told = [one.altitude_amsl_m - one.altitude_relative_m for one in (*poses[:1], *own[:1])]
    over = OverGround.of(elevation, columns, takeoff_amsl_m=told[0] if told else None)
    if over is None or not pulse_poses:
        return over
    heard_hz = [one.pulse.frequency_hz for one in pulse_poses]
    known_hz = [one for one in heard_hz if math.isfinite(one)]
    return over.at(float(np.median(known_hz))) if known_hz else over


def antenna_of(path: str | os.PathLike[str], log: PulseLog) -> str:
    """Name of the antenna of a flight or log: without headings it is an upright whip.

    Raises
    ------
    UsageError
        The drone's antenna is not known here.
    """
    if FlightLayout(Path(path)).database.is_file():
        return flight_antenna(read_flight(path))
    return MONOPOLE if log.kind in WITHOUT_HEADINGS else USUAL_ANTENNA


def check_position_method(method: str) -> None:
    """Refuse a method that does not exist; raises `UsageError`."""
    known = [*get_args(PositionMethod), *ADDED_METHODS]
    if method not in known:
        raise UsageError(
            f"there is no method {method!r}", remedy=f"Choose from {', '.join(known)}"
        )


def _columns_of_named_file(path: str | os.PathLike[str]) -> int:
    """Columns of a bearings.csv (10 or 11) or positions.csv (up to 8); 0 for all else.

    Both have a number and then the name of a file, which no pulse log has.
    """
    if not Path(path).is_file():
        return 0
    every = with_commas(read_lines(path)[:_FIRST_LINES])
    lines = (line for line in every if line.strip() and line[0] != "#")
    cells = cells_of(next(lines, ""))
    if cells[:1] == ["tag_id"]:
        return len(cells) if {"parent_file", "bearing_file"} & set(cells) else 0
    if len(cells) < 2 or not cells[0].replace(".0", "").isdigit():
        return 0
    try:
        float(cells[1])
    except ValueError:
        return len(cells)
    return 0


def _is_result(path: str | os.PathLike[str]) -> bool:
    """Whether a file has bearings or positions, and no pulses."""
    return bool(_columns_of_named_file(path)) or _holds_estimates(path)


def _positions_of_rows(
    rows: Sequence[BearingRow],
    method: PositionMethod,
    heading_sigma_deg: float,
) -> list[TagPosition]:
    return [
        _positioned(
            tag_id,
            _stations_of_rows([row for row in rows if row.tag_id == tag_id]),
            method,
            heading_sigma_deg,
        )
        for tag_id in sorted({row.tag_id for row in rows})
    ]


def _holds_estimates(path: str | os.PathLike[str]) -> bool:
    """Whether a file has the heading of UCSD's estimates, which have no amplitude."""
    if not Path(path).is_file():
        return False
    first = next((line for line in read_lines(path) if line.strip()), "")
    names = {cell.strip().lower() for cell in first.split(",")}
    return "run" in names and "easting" in names and "amplitude" not in names


def _stored_estimates(path: str | os.PathLike[str]) -> list[TagPosition]:
    """The last estimate of each target of UCSD's tracker; it refines them as it flies."""
    rows = read_ucsd_estimates(path)
    last: dict[int, TargetEstimate] = {}
    for number, row in zip(tag_numbers([one.frequency_hz for one in rows]), rows, strict=True):
        if number not in last or row.time_ns >= last[number].time_ns:
            last[number] = row
    return [
        TagPosition(
            tag_id=number,
            position=Position(
                latitude_deg=row.latitude_deg,
                longitude_deg=row.longitude_deg,
                method="ucsd",
                stations=0,
            ),
        )
        for number, row in sorted(last.items())
    ]


def _stored_positions(path: str | os.PathLike[str], method: str) -> list[TagPosition]:
    """What the original's tools wrote into a positions.csv; of all methods for ``bayes``."""
    found = []
    for row in read_position_file(path):
        for name, place in (("mle", row.mle), ("rmr", row.rmr), ("mest", row.mest)):
            if place is not None and method in ("bayes", name):
                position = Position(
                    latitude_deg=place[0], longitude_deg=place[1], method=name, stations=0
                )
                found.append(TagPosition(tag_id=row.tag_id, position=position))
    return found


def tags_of(path: str | os.PathLike[str]) -> tuple[Tag, ...]:
    """The tags that a flight directory lists; none for a log."""
    inside = FlightLayout(Path(path)).database.is_file()
    return read_flight(path).info.tags if inside else ()


def poses_of(path: str | os.PathLike[str]) -> tuple[Pose, ...]:
    """The vehicle's poses in a flight directory; none for a log."""
    inside = FlightLayout(Path(path)).database.is_file()
    return read_flight(path).poses if inside else ()


def positions_of_powers(
    pulse_poses: Sequence[PulsePose],
    tags: Sequence[Tag],
    poses: Sequence[Pose],
    *,
    method: str = "bayes",
    height_m: float | None = None,
    height_sigma_m: float = HEIGHT_SIGMA_M,
    over: OverGround | None = None,
) -> tuple[list[TagPosition], list[TagSignal]]:
    """Positions from strength alone, heard with an upright monopole; and the signals.

    Raises
    ------
    UsageError
        The method is not ``bayes``: the others need bearings.
    """
    if method not in ("bayes", "track"):
        raise UsageError(
            f"{method} needs bearings, but a monopole gives none",
            remedy="Use the method bayes, or track",
        )
    listed = {tag.tag_id: tag for tag in tags}
    ordered = sorted(pulse_poses, key=lambda one: one.pulse.start_time_ns)
    way = PoseColumns.of(poses).completed(
        PoseColumns.of(one.pose for one in ordered if one.pose)
    )
    found: list[TagPosition] = []
    signals: list[TagSignal] = []
    for tag_id in sorted({one.pulse.tag_id for one in ordered}):
        position, track = position_of_strength(
            tag_id,
            HeardStrength.of([one for one in ordered if one.pulse.tag_id == tag_id]),
            listed.get(tag_id),
            way,
            method=method,
            height_m=height_m,
            height_sigma_m=height_sigma_m,
            over=over,
        )
        found.append(position)
        if track is not None and position.position is not None:
            signals.append(signal_of(tag_id, track, position.position))
    return found, signals


def position_of_strength(
    tag_id: int,
    heard: HeardStrength,
    tag: Tag | None,
    poses: PoseColumns,
    *,
    method: str = "bayes",
    height_m: float | None = None,
    height_sigma_m: float = HEIGHT_SIGMA_M,
    over: OverGround | None = None,
) -> tuple[TagPosition, PowerTrack | None]:
    """Locate one tag from its strength: for command line, report and page alike.

    Parameters
    ----------
    tag_id : int
        Its number.
    heard : HeardStrength
        Its pulses with an upright monopole.
    tag : Tag, optional
        With it, pulses that must have come count as missed.
    poses : PoseColumns
        Of the vehicle.
    method : {"bayes", "track"}
        Where it rests, or its way.
    height_m : float, optional
        Over the tag, where the poses do not tell their height.
    height_sigma_m : float
        Error that all heights share, one standard deviation.
    over : OverGround, optional
        The ground of the flight.
    """
    hills = None if over is None else over.hills
    try:
        track = power_track(heard, tag, poses, height_m=height_m)
        position = located(
            None, track, method=method, height_sigma_m=height_sigma_m, hills=hills
        )
    except UsageError as error:
        return TagPosition(tag_id=tag_id, position=None, reason=str(error)), None
    return TagPosition(tag_id=tag_id, position=position), track


def positions_of_bearings(
    bearings: Sequence[TagBearing],
    *,
    method: PositionMethod = "bayes",
    heading_sigma_deg: float = HEADING_SIGMA_DEG,
    over: OverGround | None = None,
    listeners: Mapping[int, Sequence[Strengths]] = MappingProxyType({}),
) -> list[TagPosition]:
    """One position for each tag; bearings in which there is no direction are left out.

    `listeners` are what receivers heard of each tag without turning.
    """
    found = []
    for tag_id in sorted({one.tag_id for one in bearings}):
        own = [one for one in bearings if one.tag_id == tag_id]
        try:
            position = position_of_bearings(
                [one.latitude_deg for one in own],
                [one.longitude_deg for one in own],
                [one.middle_time_ns for one in own],
                [one.bearing for one in own],
                method=method,
                heading_sigma_deg=heading_sigma_deg,
                over=over,
                listeners=listeners.get(tag_id, ()),
            )
            found.append(TagPosition(tag_id=tag_id, position=position))
        except UsageError as error:
            # One tag with a single bearing must not keep the others from the list.
            found.append(TagPosition(tag_id=tag_id, position=None, reason=str(error)))
    return found


def _stations_of_rows(rows: Sequence[BearingRow]) -> Stations:
    sigmas = [row.sigma_deg for row in rows if row.sigma_deg is not None]
    times = [time_s for time_s in map(_middle_s, rows) if time_s is not None]
    of_one_flight = len(times) == len(rows) and max(times) - min(times) <= ONE_FLIGHT_S
    return Stations(
        latitude_deg=np.array([row.latitude_deg for row in rows]),
        longitude_deg=np.array([row.longitude_deg for row in rows]),
        bearing_deg=np.array([row.bearing_deg for row in rows]),
        sigma_deg=np.array(sigmas) if len(sigmas) == len(rows) else None,
        time_s=np.array(times) - min(times) if of_one_flight else None,
        origin_ns=round(min(times, default=0.0) * NANOSECONDS_PER_SECOND),
    )


def _middle_s(row: BearingRow) -> float | None:
    """When a bearing held best; a turn takes a minute, in which an animal walks on."""
    if row.start_time_s is None or row.end_time_s is None:
        return row.start_time_s
    return 0.5 * (row.start_time_s + row.end_time_s)


def _positioned(
    tag_id: int,
    stations: Stations,
    method: PositionMethod,
    heading_sigma_deg: float,
) -> TagPosition:
    try:
        position = located(stations, method=method, heading_sigma_deg=heading_sigma_deg)
    except UsageError as error:
        return TagPosition(tag_id=tag_id, position=None, reason=str(error))
    return TagPosition(tag_id=tag_id, position=position)


def _without_copies(
    logs: Sequence[tuple[Path, PulseLog]], warn: Callable[[str], None]
) -> list[tuple[Path, PulseLog]]:
    """Leave out what another log holds, too: a flight received and fetched is heard once.

    Two drones that hear one pulse are at two places.
    """
    heard = [set(map(_place_and_time, log.pulse_poses)) for _, log in logs]
    kept: list[int] = []
    for number in sorted(range(len(logs)), key=lambda one: len(heard[one]), reverse=True):
        own = heard[number]
        for other in kept:
            if own and len(own & heard[other]) >= SAME_PULSES * len(own):
                text = f"{logs[number][0]} is a copy of {logs[other][0]}, of the same flight"
                warn(f"{text}: left out")
                break
        else:
            kept.append(number)
    return [logs[number] for number in sorted(kept)]


def _place_and_time(posed: PulsePose) -> tuple[int, int, int, int]:
    """Tag, start [ms] and place (to 10 m) of a pulse: the same in each copy of a flight."""
    pose, pulse = posed.pose, posed.pulse
    milliseconds = round(pulse.start_time_ns / 1e6)
    if pose is None:
        return pulse.tag_id, milliseconds, 0, 0
    return (
        pulse.tag_id,
        milliseconds,
        round(pose.latitude_deg * 1e4),
        round(pose.longitude_deg * 1e4),
    )
