"""Write the text logs of a flight, which contain the pulses of its database."""

import contextlib
import sqlite3
from collections.abc import Iterator

from uavrt.core.clock import monotonic_s
from uavrt.core.messages import PulsePose
from uavrt.flight.database import schema
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.logs.pulse_pose_log import PulsePoseLog, format_line

_RETRY_S = 5.0
"""Time after a failed write until the log is completed from the database [s]."""

AT_ONCE = 500
_TEMPORARY_KIB = 512
_MAKE_LOGGED = (
    "CREATE TABLE IF NOT EXISTS temp.logged (tag_id INTEGER, start_time_ns INTEGER,"
    " PRIMARY KEY (tag_id, start_time_ns)) WITHOUT ROWID"
)

SELECT_PULSE_POSES = (
    f"SELECT {schema.PULSE_POSE_COLUMNS} FROM pulses {{join}} JOIN pulse_poses USING (pulse_id)"
    " ORDER BY pulses.start_time_ns, pulses.tag_id"
)
_MISSING = SELECT_PULSE_POSES.format(join="").replace(
    " ORDER BY",
    " WHERE (:tag_id IS NULL OR pulses.tag_id = :tag_id) AND NOT EXISTS (SELECT 1 FROM"
    " temp.logged WHERE logged.tag_id = pulses.tag_id"
    " AND logged.start_time_ns = pulses.start_time_ns) ORDER BY",
)


class PulseLogs:
    """Text logs of the flight and of each tag, completed from the database after a failed
    write.
    """

    def __init__(self, layout: FlightLayout) -> None:
        self._layout = layout
        self._new: list[PulsePose] = []
        self._behind = False
        self._retry_at_s = 0.0

    def add(self, pulse_poses: list[PulsePose]) -> None:
        """Add committed pulses, which the next `write` appends to the logs."""
        self._new.extend(pulse_poses)

    def compare_first(self) -> None:
        """Make the next `write` append only pulses that the logs lack, by tag and time."""
        self._behind = True
        self._retry_at_s = 0.0

    def write(self, database: sqlite3.Connection) -> None:
        """Append the added pulses to the logs; after a failure, repair them from `database`."""
        if not self._new and not self._behind:
            return
        if self._behind:
            self._new.clear()
            if monotonic_s() >= self._retry_at_s:
                with contextlib.suppress(OSError, sqlite3.Error):
                    self.complete_from(database)
            return
        new, self._new = self._new, []
        try:
            self._append(new)
        except OSError:
            self._behind = True
            self._retry_at_s = monotonic_s() + _RETRY_S

    def sync(self) -> None:
        """Write the flight's log to the disk (fsync); tags' logs can be restored from it."""
        with contextlib.suppress(OSError):
            PulsePoseLog(self._layout.pulse_pose_log).sync()

    def complete_from(self, database: sqlite3.Connection) -> None:
        """Remove incomplete lines from the logs and append the database's missing pulses."""
        self._retry_at_s = monotonic_s() + _RETRY_S
        self._complete(database, PulsePoseLog(self._layout.pulse_pose_log), None)
        for (tag_id,) in database.execute("SELECT DISTINCT tag_id FROM pulses").fetchall():
            self._complete(database, self._tag_log(tag_id), tag_id)
        self._behind = False

    def _append(self, pulse_poses: list[PulsePose]) -> None:
        lines: dict[int, list[str]] = {}
        everything: list[str] = []
        for pulse_pose in pulse_poses:
            line = format_line(pulse_pose)
            everything.append(line)
            lines.setdefault(pulse_pose.pulse.tag_id, []).append(line)
        PulsePoseLog(self._layout.pulse_pose_log).append(everything)
        for tag_id, own in lines.items():
            self._tag_log(tag_id).append(own)

    def _complete(
        self, database: sqlite3.Connection, log: PulsePoseLog, tag_id: int | None
    ) -> None:
        """Append the pulses that a log lacks, of one tag or of all tags.

        SQLite compares log and database in a temporary file, so memory does not grow with the
        flight.
        """
        log.repair()
        with _keys_of(log, database):
            rows = database.execute(_MISSING, {"tag_id": tag_id})
            while some := rows.fetchmany(AT_ONCE):
                log.append(format_line(schema.pulse_pose_from_row(row)) for row in some)

    def _tag_log(self, tag_id: int) -> PulsePoseLog:
        path = self._layout.tag_pulse_pose_log(tag_id)
        path.parent.mkdir(parents=True, exist_ok=True)
        return PulsePoseLog(path)


@contextlib.contextmanager
def _keys_of(log: PulsePoseLog, database: sqlite3.Connection) -> Iterator[None]:
    """Insert tag and start time of all lines of a log into the table `logged`."""
    database.execute(f"PRAGMA temp.cache_size=-{_TEMPORARY_KIB}")
    try:
        _fill(log, database)
    except sqlite3.OperationalError:
        # No place for temporary files: then in memory.
        database.execute("PRAGMA temp_store=MEMORY")
        _fill(log, database)
    try:
        yield
    finally:
        database.execute("DROP TABLE IF EXISTS temp.logged")


def _fill(log: PulsePoseLog, database: sqlite3.Connection) -> None:
    database.execute(_MAKE_LOGGED)
    database.execute("SAVEPOINT logged")
    try:
        # Only what the table's integers can hold: a damaged line has any number.
        sql = "INSERT OR IGNORE INTO temp.logged VALUES (?, ?)"
        database.executemany(sql, log.keys())
    finally:
        database.execute("RELEASE logged")
