"""Define the tables of ``flight.sqlite``, and convert records to rows and back.

Times are nanoseconds UTC, names contain the units, and missing values are NULL. SQLite stores
NaN as NULL, so columns that may be NaN allow NULL. This also lets a record with one invalid
value be stored.
"""

import json
import math
import sqlite3
from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

import msgspec

from uavrt.core.messages import (
    Beep,
    BurstInside,
    Command,
    CommandReply,
    DetectionStatus,
    Health,
    Pose,
    Pulse,
    PulsePose,
    SearchNote,
    SearchReport,
    Tag,
)
from uavrt.flight.database.fields import Columns, Row

VERSION = 6
"""Version number of a flight's tables. Version 2 added pulses with doubtful origin, 3 searches,
4 coded tags, 5 the usable share of time and the weakest tag in search reports, 6 unlisted
beeping senders."""
SEARCHED = Columns(
    SearchReport,
    (
        *("time_ns", "tag_id", "frequency_hz", "noise_psd", "best_score"),
        *("usable_share", "weakest_enr_db"),
    ),
)
PULSES, BEEPS = Columns(Pulse), Columns(Beep)
POSES = Columns(Pose, spread={"quaternion_wxyz": [f"quaternion_{one}" for one in "wxyz"]})
HEALTH = Columns(Health, ("time_ns", "process", "status", "ok", "counters"))
TAGS = Columns(
    Tag,
    (
        *("tag_id", "name", "frequency_hz", "pulse_width_s", "pulse_intervals_s"),
        *("interval_uncertainty_s", "interval_jitter_s", "k", "false_alarm_probability"),
        "gaps_s",
    ),
    lists_as_json=True,
)
_COLUMNS = {
    "pulses": PULSES.types,
    "tags": {"gaps_s": "TEXT"},
    "search_reports": {"usable_share": "REAL", "weakest_enr_db": "REAL"},
}
"""SQL types of columns that flights of older versions may lack, by table."""
PULSE_COLUMNS = PULSES.names
"""Column names of a pulse for queries; a column that an older flight lacks is read as NULL."""
PULSE_POSE_COLUMNS = ", ".join(
    [
        *(f"pulses.{name}" for name in PULSES.types),
        *(f"pulse_poses.{name}" for name in POSES.types),
    ]
)
"""Column names of pulses joined with their poses."""

TABLES = f"""
CREATE TABLE IF NOT EXISTS flight (
    start_time_ns INTEGER, clock_offset_ns INTEGER, center_frequency_hz REAL,
    sample_rate_hz REAL, settings TEXT, uavrt_version TEXT
);
CREATE TABLE IF NOT EXISTS tags (
    {TAGS.declared.replace("INTEGER", "INTEGER PRIMARY KEY", 1)}
);
CREATE TABLE IF NOT EXISTS pulses (
    pulse_id INTEGER PRIMARY KEY, {PULSES.declared},
    UNIQUE (tag_id, start_time_ns)
);
CREATE TABLE IF NOT EXISTS pulse_poses (
    pulse_id INTEGER PRIMARY KEY REFERENCES pulses, {POSES.declared}
);
CREATE TABLE IF NOT EXISTS poses (
    {POSES.declared.replace("INTEGER", "INTEGER PRIMARY KEY", 1)}
);
CREATE TABLE IF NOT EXISTS health ({HEALTH.declared});
CREATE TABLE IF NOT EXISTS status_texts (time_ns INTEGER, severity INTEGER, text TEXT);
CREATE TABLE IF NOT EXISTS commands (
    time_ns INTEGER, request_id INTEGER, name TEXT, source TEXT, detail TEXT,
    accepted INTEGER, message TEXT
);
CREATE TABLE IF NOT EXISTS search_reports ({SEARCHED.declared});
CREATE TABLE IF NOT EXISTS beeps ({BEEPS.declared});
CREATE TABLE IF NOT EXISTS search_notes (
    time_ns INTEGER, order_id INTEGER, event TEXT, text TEXT, reason TEXT, detail TEXT
);
CREATE TABLE IF NOT EXISTS deliveries (
    pulse_id INTEGER, store INTEGER, time_ns INTEGER, PRIMARY KEY (pulse_id, store)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS notes (time_ns INTEGER, text TEXT);
"""


def insertion(table: str, columns: str) -> str:
    """SQL statement that adds a row unless a row with equal key exists."""
    marks = ", ".join("?" * len(columns.split(",")))
    return f"INSERT OR IGNORE INTO {table} ({columns}) VALUES ({marks})"


INSERT_TAG = insertion("tags", TAGS.names)
INSERT_PULSE = insertion("pulses", PULSE_COLUMNS)
INSERT_PULSE_POSE = insertion("pulse_poses", f"pulse_id, {POSES.names}")
INSERT_STATUS_TEXT = insertion("status_texts", "time_ns, severity, text")
INSERT_COMMAND = insertion(
    "commands", "time_ns, request_id, name, source, detail, accepted, message"
)
SEARCH_NOTE_COLUMNS = "time_ns, order_id, event, text, reason, detail"
"""Columns of search notes that queries use; the column ``detail`` contains the whole record."""
INSERT_DELIVERY = (
    "INSERT OR IGNORE INTO deliveries (pulse_id, store, time_ns) "
    "SELECT pulse_id, ?, ? FROM pulses WHERE tag_id = ? AND start_time_ns = ?"
)
_INSIDE = ("burst_starts_ns", "burst_snrs_db", "also_possible_tag_ids")
UPDATE_INSIDE = (
    f"UPDATE pulses SET {', '.join(f'{name} = ?' for name in _INSIDE)} "
    "WHERE tag_id = ? AND start_time_ns = ?"
)
INSERT_NOTE = insertion("notes", "time_ns, text")
SELECT_PULSES_WITHOUT_POSE = (
    f"SELECT {PULSE_COLUMNS} FROM pulses WHERE NOT EXISTS (SELECT 1 FROM pulse_poses"
    " WHERE pulse_poses.pulse_id = pulses.pulse_id) ORDER BY pulse_id LIMIT ?"
)
SELECT_POSES = f"SELECT {POSES.names} FROM poses WHERE time_ns BETWEEN ? AND ? ORDER BY time_ns"


def bring_up_to_date(database: sqlite3.Connection) -> None:
    """Create the tables of a flight, or add missing columns; raises `sqlite3.Error`."""
    database.executescript(TABLES)
    for table, columns in _lacking(database).items():
        for column in columns:
            kind = _COLUMNS[table][column]
            database.execute(f"ALTER TABLE {table} ADD COLUMN {column} {kind}")
    database.execute(f"PRAGMA user_version={VERSION}")


def read_older(database: sqlite3.Connection) -> None:
    """Make columns that an older flight lacks readable as NULL; raises `sqlite3.Error`."""
    for table, columns in _lacking(database).items():
        nulls = ", ".join(f"NULL AS {column}" for column in columns)
        database.execute("PRAGMA temp_store=MEMORY")
        # Temporary views take precedence over tables of the same name.
        database.execute(f"CREATE TEMP VIEW {table} AS SELECT *, {nulls} FROM main.{table}")


def _lacking(database: sqlite3.Connection) -> dict[str, list[str]]:
    """Columns that a database's tables lack; missing tables are not considered."""
    names = " UNION ALL ".join(
        f"SELECT '{table}', name FROM pragma_table_info('{table}', 'main')"
        for table in _COLUMNS
    )
    present: dict[str, set[str]] = {}
    for table, column in database.execute(names):
        present.setdefault(table, set()).add(column)
    lacking = {
        table: [column for column in _COLUMNS[table] if column not in there]
        for table, there in present.items()
    }
    return {table: columns for table, columns in lacking.items() if columns}


def inside_row(burst: BurstInside) -> Row:
    """Values of the single pulses in a coded tag's burst, in the order of `UPDATE_INSIDE`."""
    cells = (getattr(burst, name) for name in _INSIDE)
    return (*(" ".join(map(repr, numbers)) or None for numbers in cells), *burst.key)


def pulse_from_row(row: Row) -> Pulse:
    """Create a pulse from a row; raises `ValueError` or `TypeError` for invalid values.

    NULL in a column of real numbers becomes NaN. A status that only a newer version knows is
    preserved.
    """
    try:
        return PULSES.record(row)
    except msgspec.ValidationError:
        record = PULSES.values(row)
        status = msgspec.convert(record.pop("detection_status"), str)
        pulse = msgspec.convert(record | {"detection_status": "detected"}, Pulse)
        return replace(pulse, detection_status=cast("DetectionStatus", status))


def pose_row(pose: Pose | None) -> Row:
    """Values of a pose in the order of the columns `POSES`; without a pose, all are NULL."""
    return (None,) * len(POSES.types) if pose is None else POSES.row(pose)


def pose_from_row(row: Row) -> Pose | None:
    """Create a pose from a row; None if all values are NULL.

    Raises `ValueError` for invalid values.
    """
    return None if row[0] is None else POSES.record(row)


def pulse_pose_from_row(row: Row) -> PulsePose:
    """Create a pulse with its pose from a row of `PULSE_POSE_COLUMNS`."""
    width = len(PULSES.types)
    return PulsePose(pulse=pulse_from_row(row[:width]), pose=pose_from_row(row[width:]))


def tag_from_row(row: Row) -> Tag:
    """Create a tag from a row; raises `ValueError` or `TypeError` for invalid values."""
    try:
        tag = TAGS.record(row)
    except msgspec.ValidationError as error:
        raise ValueError(f"tag {row[0]}: {error}") from error
    numbers = (tag.frequency_hz, tag.pulse_width_s, *(tag.pulse_intervals_s or (0.0,)))
    if not all(0.0 < one < math.inf for one in numbers):
        raise ValueError(f"tag {row[0]}: a frequency, pulse width or interval is not above 0")
    tolerances = tag.interval_uncertainty_s, tag.interval_jitter_s, tag.false_alarm_probability
    if any(map(math.isnan, tolerances)):
        raise ValueError(f"tag {row[0]}: a tolerance is missing")
    return tag


def search_note_row(note: SearchNote) -> Row:
    """Values of a search note in the order of its columns."""
    detail = msgspec.json.encode(note).decode()
    return (note.time_ns, note.order_id, note.event, note.text, note.reason, detail)


def search_note_from_row(row: Row) -> SearchNote:
    """Create a search note from a row of the table of search notes."""
    return msgspec.json.decode(row[5], type=SearchNote)


def command_row(command: Command, reply: CommandReply | None, time_ns: int) -> Row:
    """Values of a command and its answer, in the order of the columns."""
    detail = {
        "tag_id": None if command.tag is None else command.tag.tag_id,
        "center_frequency_hz": command.center_frequency_hz,
        "gain": command.gain,
        "parameter": command.parameter,
        "value": command.value,
    }
    given = {key: value for key, value in detail.items() if value is not None}
    return (
        time_ns,
        command.request_id,
        command.name,
        command.source,
        json.dumps(given | command.values),
        None if reply is None else int(reply.accepted),
        None if reply is None else reply.message,
    )


WRITTEN: dict[type, tuple[str, Callable[[Any], Row]]] = {
    Beep: (insertion("beeps", BEEPS.names), BEEPS.row),
    Health: (insertion("health", HEALTH.names), HEALTH.row),
    Pose: (insertion("poses", POSES.names), POSES.row),
    SearchNote: (insertion("search_notes", SEARCH_NOTE_COLUMNS), search_note_row),
    SearchReport: (insertion("search_reports", SEARCHED.names), SEARCHED.row),
    Tag: (INSERT_TAG.replace("OR IGNORE", "OR REPLACE"), TAGS.row),
}
"""For each type of record: the SQL statement that stores a record, and the function that
converts the record to a row."""
