"""Read a flight directory: complete, in progress, or cut off by a power failure."""

import math
import os
import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import msgspec

from uavrt.core.earth.on_ground import GROUND_STATION, GroundStates, ground_state
from uavrt.core.errors import FormatError
from uavrt.core.messages import (
    Beep,
    FlightInfo,
    Health,
    Pose,
    PulsePose,
    SearchNote,
    SearchReport,
    StatusText,
    keep_beep,
)
from uavrt.flight.database import schema
from uavrt.flight.database.fields import Row
from uavrt.flight.database.plain_database import open_plain, require_plain_files
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.logs.pulse_logs import SELECT_PULSE_POSES
from uavrt.flight.reading.tag_names import tags_with_names

R = TypeVar("R")
_SPANS = "min(start_time_ns), max(start_time_ns), min(end_time_ns), max(end_time_ns)"
_LATER_TABLES = ("search_notes", "beeps")
LATEST_NS = 2**62
"""Latest time accepted in a flight [ns since 1970]; sums and differences fit in 64 bits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """All records of a flight; records of one kind are in order of time."""

    info: FlightInfo
    """General data of the flight; `info.directory` is the directory that was read."""
    settings_json: str | None
    pulse_poses: tuple[PulsePose, ...]
    """All pulses with the antenna's pose; the pose is None if unknown."""
    poses: tuple[Pose, ...]
    """Poses of the vehicle, not of the antenna."""
    status_texts: tuple[tuple[int, StatusText], ...]
    """Status texts for the operator, each with its time [ns, UTC]."""
    notes: tuple[tuple[int, str], ...]
    """Notes on the flight, each with its time [ns, UTC]."""
    on_ground_ns: tuple[tuple[int, int], ...] = ()
    """Begin and end of each reported stay on the ground [ns]; empty without reports."""


def read_flight(directory: str | os.PathLike[str]) -> Flight:
    """Read a flight, complete or in progress; health records are left out.

    Raises `FormatError` if the flight cannot be read.
    """
    with flight_database(Path(directory)) as database:
        return Flight(
            info=flight_info(database, Path(directory)),
            settings_json=_settings(database),
            pulse_poses=tuple(
                schema.pulse_pose_from_row(row)
                for row in database.execute(SELECT_PULSE_POSES.format(join="LEFT"))
            ),
            poses=tuple(
                pose
                for row in database.execute(
                    f"SELECT {schema.POSES.names} FROM poses ORDER BY time_ns"
                )
                if (pose := schema.pose_from_row(row)) is not None
            ),
            status_texts=tuple(
                (time_ns, StatusText(severity=severity, text=text))
                for time_ns, severity, text in msgspec.convert(
                    database.execute(
                        "SELECT time_ns, severity, text FROM status_texts ORDER BY time_ns"
                    ).fetchall(),
                    list[tuple[int, int, str]],
                )
            ),
            notes=msgspec.convert(
                database.execute("SELECT time_ns, text FROM notes ORDER BY time_ns").fetchall(),
                tuple[tuple[int, str], ...],
            ),
            on_ground_ns=ground_states_in(database).spans(),
        )


def ground_states_in(database: sqlite3.Connection) -> GroundStates:
    """Arming and landing states of the autopilot, as recorded by drone or ground station."""
    rows = database.execute(
        f"SELECT {schema.HEALTH.names} FROM health"
        " WHERE process IN ('connection', ?) ORDER BY time_ns",
        (GROUND_STATION,),
    )
    states = GroundStates()
    for one in map(schema.HEALTH.record, rows):
        states.add(one.time_ns, *ground_state(one))
    return states


def read_health(directory: str | os.PathLike[str]) -> tuple[Health, ...]:
    """Read the health records of all processes; raises `FormatError`."""
    return _records(directory, "health", schema.HEALTH.names, schema.HEALTH.record)


def read_search_reports(directory: str | os.PathLike[str]) -> tuple[SearchReport, ...]:
    """Read the reports of searches without a detection; raises `FormatError`."""
    columns, of_row = schema.SEARCHED.names, schema.SEARCHED.record
    return _records(directory, "search_reports", columns, of_row, order="time_ns, tag_id")


def read_search_notes(directory: str | os.PathLike[str]) -> tuple[SearchNote, ...]:
    """Read the decisions and results of autonomous searches; raises `FormatError`."""
    columns = schema.SEARCH_NOTE_COLUMNS
    return _records(directory, "search_notes", columns, schema.search_note_from_row)


def read_beeps(directory: str | os.PathLike[str]) -> tuple[Beep, ...]:
    """Read the last measurement of each unlisted beeping sender; raises `FormatError`."""
    found: list[Beep] = []
    for row in _records(directory, "beeps", schema.BEEPS.names, tuple):
        with suppress(ValueError):  # a kind of a newer version
            keep_beep(found, schema.BEEPS.record(row))
    return tuple(found)


def read_stops(directory: str | os.PathLike[str]) -> tuple[int, ...]:
    """Read the times when detection was stopped by command [ns, UTC]; raises `FormatError`."""
    stops = "commands WHERE name = 'stop_detection' AND accepted"
    return _records(directory, stops, "time_ns", lambda row: row[0])


def _records(
    directory: str | os.PathLike[str],
    source: str,
    columns: str,
    of_row: Callable[[Row], R],
    order: str = "time_ns, rowid",
) -> tuple[R, ...]:
    """Records of a table in order of time; empty if an older flight lacks the table."""
    with flight_database(Path(directory)) as database:
        tables = "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?"
        if source in _LATER_TABLES and not database.execute(tables, (source,)).fetchone():
            return ()
        rows = database.execute(f"SELECT {columns} FROM {source} ORDER BY {order}")
        return tuple(map(of_row, rows))


DAMAGED = (
    *(sqlite3.Error, OSError, ValueError, TypeError, ArithmeticError, LookupError),
    RecursionError,
)
"""Error types raised for a damaged database or impossible values."""


@contextmanager
def flight_database(directory: Path) -> Iterator[sqlite3.Connection]:
    """Open a flight's database for reading; missing columns of older versions are NULL."""
    path = FlightLayout(directory).database
    if not path.is_file():
        raise FormatError(
            f"{directory} is not a flight: it has no flight.sqlite",
            remedy="Name a directory like flight_log_2026-05-01_08-15-00",
        )
    try:
        with ExitStack() as stack:
            opened = stack.enter_context(closing(_open(path, stack)))
            schema.read_older(opened)
            yield opened
    except DAMAGED as error:
        raise FormatError(
            f"{path} cannot be read: {error}",
            remedy="Give the flight's pulse_pose_log.txt instead, which has the same pulses",
        ) from error


def _open(path: Path, stack: ExitStack) -> sqlite3.Connection:
    """Open a database read-only, or a copy of it if the disk allows no lock files."""
    try:
        return open_plain(path)
    except sqlite3.OperationalError:
        require_plain_files(path)
    scratch = stack.enter_context(tempfile.TemporaryDirectory())
    for name in (path.name, f"{path.name}-wal"):
        if (path.parent / name).exists():
            shutil.copyfile(path.parent / name, Path(scratch) / name)
    return open_plain(Path(scratch) / path.name, mode="rw")


def flight_info(database: sqlite3.Connection, directory: Path) -> FlightInfo:
    """Read the general data of a flight; raises `ValueError` if there are none."""
    columns = "start_time_ns, clock_offset_ns, center_frequency_hz, sample_rate_hz"
    row = database.execute(f"SELECT {columns} FROM flight").fetchone()
    if row is None:
        raise ValueError("the flight has no start time: recording ended too early")
    times_ns = [
        one
        for one in (*row[:2], *database.execute(f"SELECT {_SPANS} FROM pulses").fetchone())
        if one is not None
    ]
    if not all(isinstance(one, int) and abs(one) < LATEST_NS for one in times_ns):
        raise ValueError("the flight has an invalid time")
    tags = database.execute(f"SELECT {schema.TAGS.names} FROM tags ORDER BY tag_id")
    return FlightInfo(
        directory=str(directory),
        start_time_ns=int(row[0]),
        clock_offset_ns=int(row[1]),
        center_frequency_hz=math.nan if row[2] is None else float(row[2]),
        sample_rate_hz=math.nan if row[3] is None else float(row[3]),
        tags=tags_with_names(map(schema.tag_from_row, tags), directory),
    )


def _settings(database: sqlite3.Connection) -> str | None:
    (text,) = database.execute("SELECT settings FROM flight").fetchone()
    return None if text is None else str(text)
