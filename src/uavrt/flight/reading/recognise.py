"""Read a pulse log of any system; the format is recognised by its content.

Neither the file's name nor an option selects the format: three formats have 20 columns,
headings are missing or wrong, and files get renamed. TagTracker's variants with 20 columns are
distinguished by their values: one variant has a quaternion of length 1 in every row.
"""

import json
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from uavrt.core.earth.on_earth import OffEarthError
from uavrt.core.errors import FormatError
from uavrt.core.messages import PulsePose
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.logs.pulse_files import read_pulse_file
from uavrt.flight.logs.pulse_pose_log import COLUMNS, parse_line, read_pulse_pose_log
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.formats.pulses.pulse_log import LogKind, PulseLog, RotationMark
from uavrt.formats.pulses.pyradiotracking import NAMES, column_names, read_pyradiotracking
from uavrt.formats.pulses.sensorgnome import (
    is_detections,
    is_pulse_file,
    read_detections,
    read_pulse_lines,
)
from uavrt.formats.pulses.tagtracker import is_heading, read_tagtracker, row_kind
from uavrt.formats.pulses.ucsd import read_ucsd_pings
from uavrt.formats.text import cells_of, read_lines, with_commas

ORIGINAL_POSES = (
    "The original's uavrt_connection wrote this log, and its poses are unusable: each is "
    "half-way between the first pose since the program's start and the pose at the pulse, so a "
    "turn of 90° appears as 45° and a full turn stays within one half circle."
)
ORIGINAL_DIGITS = (
    "Each number has only six digits: latitudes are rounded to 11 m, and the expected "
    "time of the next pulse is saturated, and read as unknown, if its fraction is 0.5 or more."
)
_DECIMALS_OF_OURS = 9
_TRACKERS = ("7", "10", "11", "20")
_PATTERNS = (
    *("pulse_pose_log.txt", "pulse_pose.log.txt"),
    *("detector_log/*/output/pulse_pose_log.txt", "detector_log/*/output/pulse_pose.log.txt"),
    *("Pulse-*.csv", "Rotation-*.csv"),
)
_ENDINGS = (".csv", ".jsonl", ".txt", ".txt.gz", ".csv.gz")
_FIRST_LINES = 20
_REMEDY = (
    "Choose from flight directories, pulses of `uavrt detect`, pulse_pose_log.txt, and the "
    "CSV of TagTracker, UCSD's tracker and pyradiotracking, a SensorGnome's pulses, find_tags' "
    "detections; for positions also a bearings.csv, and a table with the columns tag_id, "
    "latitude_deg, longitude_deg and bearing_deg"
)


def read_pulses(path: str | os.PathLike[str]) -> tuple[PulsePose, ...]:
    """Read the pulses of a flight directory or a log of any format; raises `FormatError`."""
    return read_pulse_log(path).pulse_poses


def read_pulse_log(path: str | os.PathLike[str]) -> PulseLog:
    """Read a flight or a log of any known format, and warnings about its contents.

    Raises `FormatError` if it cannot be read.
    """
    place = Path(path)
    if place.name == "flight.sqlite":
        place = place.parent
    if place.is_dir():
        return _directory(place)
    match kind := recognised(place):
        case "tagtracker":
            return read_tagtracker(place)
        case "ucsd":
            return read_ucsd_pings(place)
        case "pyradiotracking":
            return read_pyradiotracking(place)
        case "sensorgnome":
            return read_pulse_lines(place)
        case "detections":
            return read_detections(place)
        case "pulse_pose_log":
            warnings = [*_original(place)]
            found = read_pulse_pose_log(place, warnings.append)
            return PulseLog(kind=kind, pulse_poses=found, warnings=tuple(warnings))
    warnings = []
    found = read_pulse_file(place, warnings.append)
    return PulseLog(kind=kind, pulse_poses=found, warnings=tuple(warnings))


def pulse_logs_in(path: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Find all flights and pulse logs at and below a path; raises `FormatError` if none."""
    place = Path(path)
    if not place.is_dir() or _holds_a_log(place):
        return (place,)
    found = tuple(_logs_below(place))
    if not found:
        raise _none_in(place)
    return found


def _none_in(directory: Path) -> FormatError:
    """Create the error for a folder without pulses; it names recordings of samples there."""
    samples = next(iter(sorted(directory.glob("*.sigmf-meta"))), None)
    tags = next((one for one in (directory / "tags.toml",) if one.is_file()), "TAGS")
    return FormatError(
        f"{directory} contains no flight and no pulse log",
        remedy=_REMEDY
        if samples is None
        else f"Find the pulses first: uavrt detect {samples} --tags {tags} -o pulses.jsonl",
    )


def _logs_below(directory: Path) -> Iterator[Path]:
    for child in sorted(directory.iterdir()):
        if child.is_dir():
            if _holds_a_log(child):
                yield child
            elif not child.is_symlink():
                yield from _logs_below(child)
        elif child.name.lower().endswith(_ENDINGS) and _is_log(child):
            yield child


def _is_log(path: Path) -> bool:
    """True if a file is a log of received pulses, not an empty file or a simulation's list."""
    if path.name == "truth.csv":
        return False
    try:
        return recognised(path) is not None and any(map(str.strip, read_lines(path)))
    except FormatError:
        return False


def _holds_a_log(directory: Path) -> bool:
    inside = (path for pattern in _PATTERNS for path in directory.glob(pattern))
    return FlightLayout(directory).database.is_file() or any(True for _ in inside)


def recognised(path: str | os.PathLike[str]) -> LogKind:
    """Recognise a file's format by its first line; raises `FormatError` if it is unknown."""
    lines = read_lines(path)
    first = next((line for line in lines if line.strip()), "")
    cells = cells_of(first)
    if _is_jsonl(lines):
        return "uavrt-jsonl"
    if not cells:
        # A flight in which nothing was heard leaves an empty log.
        return "uavrt-jsonl" if Path(path).suffix == ".jsonl" else "pulse_pose_log"
    if _is_tag_list(path, cells):
        raise FormatError(
            f"{os.fspath(path)} is a list of tags, not of pulses",
            remedy="Name the flight or the pulse log; `uavrt tags check` checks tag lists",
        )
    if cells[0] == "tag_id" and "start_time_ns" in cells:
        return "uavrt-csv"
    if cells[0].lower() == "run":
        return "ucsd"
    if is_pulse_file(lines):
        return "sensorgnome"
    if is_detections(cells):
        return "detections"
    if ";" in first and not set(NAMES) - set(column_names(cells_of(first, ";"))):
        return "pyradiotracking"
    if len(cells) == COLUMNS and _is_thesis(first):
        return "pulse_pose_log"
    if _is_tagtracker(lines):
        return "tagtracker"
    if is_heading(cells) or row_kind(cells[0]) in _TRACKERS:
        return "tagtracker"
    if cells[0].isdigit() and len(lines) <= 2:
        return "pulse_pose_log"  # a single line, cut off
    raise FormatError(f"{os.fspath(path)} is not a known pulse log format", remedy=_REMEDY)


def _is_tag_list(path: str | os.PathLike[str], cells: Sequence[str]) -> bool:
    """True if a file is a tag list that lies in a folder of flights and recordings."""
    heading = [cell.lower() for cell in cells[:2]]
    return Path(path).name.lower() == "taginfo.txt" or (
        heading[0].strip("# ") == "id" and heading[1:] == ["freq_hz"]
    )


def _is_tagtracker(lines: Sequence[str]) -> bool:
    """True if a file has the rows of a TagTracker log.

    The cells may be separated by commas, semicolons or tabs, as spreadsheets write them.
    """
    rows = (cells_of(line) for line in with_commas(lines[:_FIRST_LINES]) if line.strip())
    first = next(rows, [])
    return len(first) > 3 and (is_heading(first) or row_kind(first[0]) in _TRACKERS)


def _is_jsonl(lines: Sequence[str]) -> bool:
    """True if one of the first non-empty lines is a pulse in JSON, complete or truncated."""
    some = [line.strip() for line in lines if line.strip()][:_FIRST_LINES]
    return any(map(_is_record, some))


def _is_record(line: str) -> bool:
    if not line.startswith("{"):
        return False
    try:
        return "tag_id" in json.loads(line)
    except (ValueError, RecursionError):
        return line[1:].lstrip().startswith('"tag_id"')


def _is_thesis(line: str) -> bool:
    try:
        parse_line(line)
    except OffEarthError:
        return True
    except (ValueError, OverflowError):
        return False
    return True


def _original(path: Path) -> tuple[str, ...]:
    """Warnings for a pulse_pose_log.txt of the original system, which has fewer decimals."""
    rows = [cells for line in read_lines(path) if len(cells := cells_of(line)) == COLUMNS]
    if all(len(cells[1].partition(".")[2]) == _DECIMALS_OF_OURS for cells in rows):
        return ()
    return ORIGINAL_POSES, ORIGINAL_DIGITS


def _directory(directory: Path) -> PulseLog:
    if FlightLayout(directory).database.is_file():
        return PulseLog(kind="flight", pulse_poses=read_flight(directory).pulse_poses)
    # The flight's own log holds what the tags' logs hold.
    for group in (_PATTERNS[:2], _PATTERNS[2:4], _PATTERNS[4:]):
        paths = sorted(path for pattern in group for path in directory.glob(pattern))
        if paths:
            return _merged(map(read_pulse_log, paths))
    raise _none_in(directory)


def _merged(logs: Iterable[PulseLog]) -> PulseLog:
    """Merge several logs in order of time, without duplicate pulses or warnings."""
    everything = list(logs)
    if len(everything) == 1:
        return everything[0]
    pulses: dict[tuple[int, int, int], PulsePose] = {}
    marks: list[RotationMark] = []
    for log in everything:
        marks += [
            replace(mark, before_pulse=len(pulses) + mark.before_pulse) for mark in log.marks
        ]
        for number, one in enumerate(log.pulse_poses):
            key = (one.pulse.tag_id, one.pulse.start_time_ns, one.pulse.group_sequence)
            same = pulses.get(key)
            if same is None or same.pulse.snr_db == one.pulse.snr_db:
                pulses[key] = one
            else:
                # Rounded times: another pulse, not the same.
                pulses[(one.pulse.tag_id, one.pulse.start_time_ns, -1 - number)] = one
    ordered = sorted(pulses.values(), key=lambda one: one.pulse.start_time_ns)
    return PulseLog(
        kind=everything[0].kind,
        pulse_poses=tuple(ordered),
        marks=tuple(marks),
        warnings=tuple(dict.fromkeys(text for log in everything for text in log.warnings)),
        passed_over=sum(log.passed_over for log in everything),
    )
