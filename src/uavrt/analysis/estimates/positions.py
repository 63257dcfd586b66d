"""Estimate one position for each tag from flights, pulse logs or files of bearings."""

import math
import os
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import count
from operator import attrgetter
from pathlib import Path
from typing import get_args

from uavrt.analysis.estimates.bearings import (
    NO_BEARINGS_FROM_THESE,
    Recorded,
    bearings_together,
    check_method,
    read_recorded,
)
from uavrt.analysis.estimates.kept_observers import observers_of
from uavrt.analysis.inputs.flight_copies import SAME_PULSES
from uavrt.analysis.inputs.log_clocks import clock_doubts, pulse_doubts
from uavrt.analysis.inputs.same_tags import NamedTag, SameTags, same_tags
from uavrt.core.earth.geodesy import distance_m
from uavrt.core.errors import UsageError
from uavrt.core.messages import PulsePose
from uavrt.flight.reading.recognise import ORIGINAL_POSES, pulse_logs_in
from uavrt.formats.bearings_csv import BearingRow, read_bearing_file
from uavrt.formats.noted_headings import is_noted
from uavrt.formats.positions_csv import read_position_file
from uavrt.formats.pulses.ucsd import TargetEstimate, read_ucsd_estimates, tag_numbers
from uavrt.formats.text import cells_of, read_lines, with_commas
from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import MONOPOLE
from uavrt.localization.estimates.flight_estimates import (
    NO_TIME,
    EstimationOptions,
    Found,
    TagBearing,
    TagPosition,
    at_one_place,
    place,
    survey,
    with_strengths,
)
from uavrt.localization.estimates.heard import FlightGround, Heard
from uavrt.localization.position.bearings.observers import Observer
from uavrt.localization.position.estimate_position import ADDED_METHODS
from uavrt.localization.results import Bearing, Position, PositionMethod

POSITION_METHODS = (*get_args(PositionMethod), *ADDED_METHODS)
_BEARING_COLUMNS = 10
_SAME_PLACE_M = 30.0
_SAME_BEARING_SIGMAS = 3.0
"""Largest difference between a bearing and its copy [standard deviations]."""
_USUAL_SIGMA_DEG = 6.0
"""Standard deviation assumed for a bearing from a file that states none [deg]."""
_FIRST_LINES = 100
"""Most lines read to recognise a file's format, as comments may precede the data."""

_Tables = list[tuple[Path, Sequence[BearingRow]]]


def read_positions(
    *paths: str | os.PathLike[str],
    how: EstimationOptions | None = None,
    warn: Callable[[str], None] = lambda text: None,
    observers: Path | None = None,
) -> list[TagPosition]:
    """Estimate the positions of tags from flights, logs and files of bearings.

    `*paths` are flights, pulse logs of any kind, folders of them, and files of bearings
    (bearings.csv, or noted by hand). All bearings of a tag together give one position, on the
    assumption that the tag rests. Positions in a positions.csv, or in an estimate CSV of UCSD's
    tracker, are returned unchanged.

    If `how` names no antenna, each flight's own antenna is used, RA-23K for other logs, and a
    monopole for UCSD's pings. `warn` is called with warnings about a log. `observers` is a file
    that stores the bearing errors of people who take bearings by hand.

    Raises `FormatError` for a file of another kind, and `UsageError` for an unknown method or
    for inputs that cannot be combined.
    """
    how = how or EstimationOptions()
    check_method(how.method, POSITION_METHODS)
    if how.offset_deg and any(
        _columns_of_named_file(path) or _holds_estimates(path) for path in paths
    ):
        raise UsageError(
            "an antenna offset cannot be applied to a file of results",
            remedy="Name the flight or the pulse log of these results",
        )
    if len(paths) == 1:
        if _holds_estimates(paths[0]):
            return _stored_estimates(paths[0])
        if _columns_of_named_file(paths[0]) in range(4, 9):
            return _stored_positions(paths[0], how.method)
    files = [path for path in paths if _columns_of_named_file(path)]
    if files and how.elevation is not None:
        raise UsageError(
            "a bearings.csv has no flight heights, which --dem needs",
            remedy="Name the flights that its bearings came from, or leave --dem out",
        )
    logs = [
        read_recorded(path)
        for given in paths
        if given not in files
        for path in pulse_logs_in(given)
    ]
    for text in dict.fromkeys(text for one in logs for text in one.log.warnings):
        warn(text)
    logs = _without_copies(logs, warn)
    tables: _Tables = [(Path(path), read_bearing_file(path)) for path in files]
    known = observers_of(tables, observers, warn)
    same = same_tags(
        [one.log for one in logs],
        [() if one.flight is None else one.flight.info.tags for one in logs],
    )
    tables, names = _numbered(tables, same)
    noted = _without_repeats(
        [(os.fspath(path), _noted(every, known)) for path, every in tables], warn
    )
    times: list[tuple[str | Path, list[int]]] = [
        (one.path, [each.pulse.start_time_ns for each in one.log.pulse_poses]) for one in logs
    ]
    times += [
        (path, [one.start_time_ns for one in rows if one.start_time_ns != NO_TIME])
        for path, rows in noted
    ]
    for text in clock_doubts(times):
        warn(text)
    trains = [(one.path, _times(one, keys)) for one, keys in zip(logs, same.keys, strict=True)]
    for text in (*same.warnings, *pulse_doubts(trains)):
        warn(text)
    rows = [one for _, every in noted for one in every]
    found = _positions_of_logs(
        [*zip(logs, same.keys, strict=True)], _under_keys(rows, same), how, warn
    )
    return _with_names(found, same, names)


def _numbered(tables: _Tables, same: SameTags) -> tuple[_Tables, dict[int, str]]:
    """Number the tags that tables name: with the number of the flights' tag of that name, or
    with an unused number. Also returns the names by number.
    """
    rows = [row for _, every in tables for row in every]
    numbers = {one.name: one.tag_id for one in same.tags.values() if one.name}
    used = {one.tag_id for one in same.tags.values()}
    used |= {row.tag_id for row in rows if row.tag_name is None}
    unused = (number for number in count(1) if number not in used)
    for row in rows:
        if row.tag_name is not None and row.tag_name not in numbers:
            numbers[row.tag_name] = next(unused)
    numbered: _Tables = [
        (
            path,
            [
                row if row.tag_name is None else replace(row, tag_id=numbers[row.tag_name])
                for row in every
            ],
        )
        for path, every in tables
    ]
    return numbered, {number: name for name, number in numbers.items()}


def _times(log: Recorded, keys: Mapping[int, int]) -> dict[int, list[int]]:
    """Start times of a log's pulses [ns, UTC], by the tag key that is unique over all logs."""
    times = defaultdict[int, list[int]](list)
    for one in log.log.pulse_poses:
        times[keys[one.pulse.tag_id]].append(one.pulse.start_time_ns)
    return times


def _noted(rows: Sequence[BearingRow], observers: Mapping[str, Observer]) -> list[TagBearing]:
    found = []
    for row in rows:
        if row.true_place is not None:
            continue
        known = [one for one in (row.start_time_ns, row.end_time_ns) if one is not None]
        times_ns = known or [NO_TIME]
        found.append(
            TagBearing(
                tag_id=row.tag_id,
                bearing=Bearing(
                    bearing_deg=row.bearing_deg,
                    method="noted",
                    pulses=0,
                    sigma_deg=row.sigma_deg,
                ),
                by_hand=row.observer is not None,
                observer=observers.get(row.observer or ""),
                latitude_deg=row.latitude_deg,
                longitude_deg=row.longitude_deg,
                altitude_amsl_m=math.nan
                if row.altitude_amsl_m is None
                else row.altitude_amsl_m,
                start_time_ns=times_ns[0],
                middle_time_ns=sum(times_ns) // len(times_ns),
                end_time_ns=times_ns[-1],
            )
        )
    return found


def _without_repeats(
    files: Sequence[tuple[str, list[TagBearing]]], warn: Callable[[str], None]
) -> list[tuple[str, list[TagBearing]]]:
    """Remove bearings with equal tag, position, time and angle in an earlier file."""
    key = attrgetter(
        "tag_id", "start_time_ns", "latitude_deg", "longitude_deg", "bearing.bearing_deg"
    )
    found, known = list[tuple[str, list[TagBearing]]](), set[tuple[float, ...]]()
    for path, rows in files:
        kept = [one for one in rows if key(one) not in known]
        if copies := len(rows) - len(kept):
            warn(
                f"{copies} bearings of {path} are also in another file and are not counted "
                "twice"
            )
        known.update(map(key, rows))
        found.append((path, kept))
    return found


def _under_keys(rows: Sequence[TagBearing], same: SameTags) -> list[TagBearing]:
    """Replace the tag numbers of a file by keys that are unique over all files. Raises
    `UsageError` if a number is ambiguous.
    """
    keys: dict[int, list[int]] = {}
    for key, tag in same.tags.items():
        keys.setdefault(tag.tag_id, []).append(key)
    for tag_id in sorted({one.tag_id for one in rows}):
        if len(keys.get(tag_id, ())) > 1:
            raise UsageError(
                f"tag id {tag_id} is used for different tags in these flights",
                remedy="With a bearings file, name only flights that use this id for one tag",
            )
    return [replace(one, tag_id=keys.get(one.tag_id, [one.tag_id])[0]) for one in rows]


def _with_names(
    found: Sequence[TagPosition], same: SameTags, names: Mapping[int, str]
) -> list[TagPosition]:
    named = []
    for one in found:
        unknown = NamedTag(tag_id=one.tag_id, frequency_hz=None, name=names.get(one.tag_id))
        tag = same.tags.get(one.tag_id, unknown)
        named.append(
            replace(one, tag_id=tag.tag_id, frequency_hz=tag.frequency_hz, name=tag.name)
        )
    return sorted(named, key=lambda one: (one.tag_id, one.frequency_hz or 0.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Log:
    recorded: Recorded
    heard: Heard
    keys: Mapping[int, int]

    @property
    def usable(self) -> bool:
        """False for a log with poses of the original UAV-RT, whose headings are wrong."""
        return ORIGINAL_POSES not in self.recorded.log.warnings


def _positions_of_logs(
    read: Sequence[tuple[Recorded, Mapping[int, int]]],
    noted: Sequence[TagBearing],
    how: EstimationOptions,
    warn: Callable[[str], None],
) -> list[TagPosition]:
    logs = [
        _Log(
            recorded=one,
            heard=one.heard(one.antenna if how.antenna is None else "").renamed(keys),
            keys=keys,
        )
        for one, keys in read
    ]
    over = None
    if how.elevation is not None and logs:
        over = _together(logs).over(how.elevation)
        if over is not None and len(logs) > 1:
            over = over.with_limitations(
                "heights of several flights are counted from the first one's take-off: the "
                "flights must have begun at one place"
            )
    whips = [one for one in logs if (how.antenna or one.heard.antenna) == MONOPOLE]
    turned = [one for one in logs if one not in whips]
    standing = [one for one in whips if (turned or noted) and at_one_place(one.heard)]
    whips = [one for one in whips if one not in standing]
    if whips and (turned or noted):
        warn(
            "some of these logs give bearings and some only strengths: each kind has its own "
            "positions"
        )
    found: list[TagPosition] = []
    if turned or noted or not whips:
        found += _positions_of_turns(turned, standing, noted, how, over, warn)
    if whips:
        try:
            found += survey(_together(whips), how, over)[0].values()
        except UsageError as error:
            if not (turned or noted):
                raise
            tags = {tag_id for one in whips for tag_id in one.heard.pulses}
            found += [
                TagPosition(tag_id=tag_id, position=None, reason=str(error))
                for tag_id in sorted(tags)
            ]
    return found


def _together(logs: Sequence[_Log]) -> Heard:
    return reduce(Heard.merged_with, [one.heard for one in logs])


def _positions_of_turns(
    logs: Sequence[_Log],
    standing: Sequence[_Log],
    noted: Sequence[TagBearing],
    how: EstimationOptions,
    over: FlightGround | None,
    warn: Callable[[str], None],
) -> list[TagPosition]:
    """Each tag's position from bearings and signal strengths, or why it has none."""
    usable = [one for one in logs if one.usable]
    if len(usable) < len(logs):
        warn(NO_BEARINGS_FROM_THESE)
    bearings = bearings_together([one.recorded for one in usable], how, warn)
    together = []
    for number, one in enumerate((*usable, *standing)):
        own = [
            replace(each, tag_id=one.keys.get(each.tag_id, each.tag_id))
            for each in bearings
            if each.flight == number
        ]
        # Keys are tags already: their frequencies need not be compared.
        together.append(replace(with_strengths(one.heard, how, own), frequencies_hz={}))
    own_bearings = [one for each in together for one in each.bearings]
    kept = [one for one in noted if not any(_is_copy(one, each) for each in own_bearings)]
    if copies := len(noted) - len(kept):
        warn(
            f"{copies} bearings of a file come from turns in these flights and are not "
            "counted twice"
        )
    together.append(Found(bearings=kept))
    every = Found(heard=frozenset().union(*(each.heard for each in together)))
    return place([every, *together], how, over)


def _is_copy(noted: TagBearing, own: TagBearing) -> bool:
    places = (noted.latitude_deg, noted.longitude_deg), (own.latitude_deg, own.longitude_deg)
    off_deg = abs(difference_deg(noted.bearing.bearing_deg, own.bearing.bearing_deg))
    sigmas_deg = (one.bearing.sigma_deg or _USUAL_SIGMA_DEG for one in (noted, own))
    return (
        noted.tag_id == own.tag_id
        and own.bearing.accepted
        and off_deg <= _SAME_BEARING_SIGMAS * math.hypot(*sigmas_deg)
        and own.start_time_ns <= noted.middle_time_ns <= own.end_time_ns
        and distance_m(*places[0], *places[1]) < _SAME_PLACE_M
    )


def _columns_of_named_file(path: str | os.PathLike[str]) -> int:
    """Number of columns of a bearings.csv (10, 11) or positions.csv (up to 8), else 0.

    Both kinds begin with a number and a file name, which no pulse log does.
    """
    if not Path(path).is_file():
        return 0
    every = with_commas(read_lines(path)[:_FIRST_LINES])
    lines = (line for line in every if line.strip() and line[0] != "#")
    cells = cells_of(next(lines, ""))
    if is_noted(cells):
        return _BEARING_COLUMNS
    if cells[:1] == ["tag_id"]:
        return len(cells) if {"parent_file", "bearing_file"} & set(cells) else 0
    if len(cells) < 2 or not cells[0].replace(".0", "").isdigit():
        return 0
    try:
        float(cells[1])
    except ValueError:
        return len(cells)
    return 0


def _holds_estimates(path: str | os.PathLike[str]) -> bool:
    """True for a CSV file of UCSD's position estimates, which has a column ``run`` but no
    column ``amplitude``.
    """
    if not Path(path).is_file():
        return False
    first = next((line for line in read_lines(path) if line.strip()), "")
    names = {cell.strip().lower() for cell in first.split(",")}
    return "run" in names and "easting" in names and "amplitude" not in names


def _stored_estimates(path: str | os.PathLike[str]) -> list[TagPosition]:
    """Last position of each target in UCSD's file, since later estimates are better."""
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
    """Read positions from the original UAV-RT's positions.csv: those of one method, or of all
    methods for ``bayes``.
    """
    found = []
    for row in read_position_file(path):
        for name, there in (("mle", row.mle), ("rmr", row.rmr), ("mest", row.mest)):
            if there is not None and method in ("bayes", name):
                position = Position(
                    latitude_deg=there[0], longitude_deg=there[1], method=name, stations=0
                )
                found.append(TagPosition(tag_id=row.tag_id, position=position))
    return found


def _without_copies(logs: Sequence[Recorded], warn: Callable[[str], None]) -> list[Recorded]:
    """Exclude logs that share at least half of their pulses, at equal positions, with a longer
    log.

    A pulse recorded at two positions was received by two drones, so both logs are kept.
    """
    heard = [set(map(_place_and_time, one.log.pulse_poses)) for one in logs]
    kept: list[int] = []
    for number in sorted(range(len(logs)), key=lambda one: len(heard[one]), reverse=True):
        own = heard[number]
        for other in kept:
            if own and len(own & heard[other]) >= SAME_PULSES * len(own):
                text = (
                    f"{logs[number].path} is a copy of {logs[other].path}, of the same flight"
                )
                warn(f"{text}: left out")
                break
        else:
            kept.append(number)
    return [logs[number] for number in sorted(kept)]


def _place_and_time(posed: PulsePose) -> tuple[int, int, int, int]:
    """Key equal in all copies of a pulse: tag, start time [ms] and position (to 10 m)."""
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
