"""SQLite database of a flight in progress; its file may get damaged, removed or replaced."""

import sqlite3
from collections.abc import Callable, Iterable
from contextlib import closing, suppress
from pathlib import Path

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import RecordingError
from uavrt.core.messages import Pose, Pulse, PulsePose
from uavrt.flight.database import schema
from uavrt.flight.database.fields import Row
from uavrt.flight.flight_layout import FlightLayout

CHECKPOINT_S = 2.0
"""Time between checkpoints if commits do not wait for the disk [s]; a power cut loses at most
this time."""

WAL_BYTES = 4_000_000
"""Size at which the write-ahead log is checkpointed [bytes], reached after about ten minutes. A
page that changes several times until then is copied only once. Reading the log takes 10 ms."""

PAGE_BYTES = 512
"""Size of a database page [bytes]. It is smaller than SQLite's default of 4096, because a
commit writes ten pages that are only partly filled."""

_POISON = (sqlite3.IntegrityError, sqlite3.DataError, sqlite3.InterfaceError, OverflowError)
# Python 3.11 raises InterfaceError or ProgrammingError for a type SQLite does not know.
_UNWRITABLE = (*_POISON, sqlite3.ProgrammingError, UnicodeEncodeError)

Statement = tuple[str, Row]
CACHE_KIB = 256
"""Size of SQLite's page cache [KiB]; a small cache suffices because rows are only appended."""


class FlightDatabase:
    """Database of a flight in progress; with `durable`, each commit waits for the disk."""

    def __init__(self, layout: FlightLayout, *, durable: bool) -> None:
        self._layout = layout
        self._durable = durable
        self._open: sqlite3.Connection | None = None
        self._file: tuple[int, int] | None = None
        """Device and inode number of the open file; None if no file is open."""
        self._checkpoint_at_s = monotonic_s() + CHECKPOINT_S
        self.syncs = 0
        """Number of fsync calls: one per commit, two per checkpoint."""
        self.committed_pulses = 0
        """Number of new pulses committed by this object."""
        self.repeated_pulses = 0
        """Number of pulses already recorded before, such as after a sender's restart."""
        self.refused_records = 0
        """Number of records dropped as SQLite cannot store them, such as huge integers."""

    def connected(self) -> sqlite3.Connection:
        """Connection to the database, opened if necessary."""
        if self._open is None:
            database = sqlite3.connect(
                self._layout.database, isolation_level=None, timeout=2.0, cached_statements=16
            )
            try:
                database.execute(f"PRAGMA page_size={PAGE_BYTES}")  # of a new one
                database.execute("PRAGMA journal_mode=WAL")
                database.execute(f"PRAGMA synchronous={'FULL' if self._durable else 'NORMAL'}")
                database.execute("PRAGMA wal_autocheckpoint=0")
                if self._durable:  # its size says how much there is to fold
                    database.execute("PRAGMA journal_size_limit=0")
                database.execute(f"PRAGMA cache_size=-{CACHE_KIB}")
                schema.bring_up_to_date(database)
            except sqlite3.Error:
                database.close()
                raise
            self._open, self._file = database, _identity(self._layout.database)
        return self._open

    def disconnect(self) -> None:
        """Close the database file."""
        if self._open is not None:
            self._open.close()
            self._open = None

    def roll_back(self) -> None:
        """Roll back after a failure and close the file; the next commit opens it again."""
        if self._open is not None:
            try:
                if self._open.in_transaction:
                    self._open.execute("ROLLBACK")
                if not self.is_gone():
                    self.disconnect()
            except sqlite3.Error:
                self._open = None

    def is_gone(self) -> bool:
        """True if the open database file was removed or replaced, so readers cannot see it."""
        return self._open is not None and _identity(self._layout.database) != self._file

    def write_again(self) -> None:
        """Write the open database to its path again, after the file was removed or replaced."""
        root, old = self._layout.root, self._open
        assert old is not None
        assert self._file is not None
        there = next(path for path in root.parents if path.exists())
        if there.stat().st_dev != self._file[0]:
            raise RecordingError(
                f"the disk with {root} is not connected", remedy="Connect it again"
            )
        self._layout.make([])
        copy = root / ".flight.sqlite"
        copy.unlink(missing_ok=True)
        with closing(sqlite3.connect(copy)) as new:
            old.backup(new)
        self.disconnect()  # before the new one has a log, which this would remove
        self.move_aside()
        copy.replace(self._layout.database)

    def move_aside(self) -> str:
        """Rename the database file and return its new name."""
        database = self._layout.database
        number = 1
        while (aside := database.with_name(f"{database.name}.damaged-{number}")).exists():
            number += 1
        for suffix in ("", "-wal", "-shm"):
            file = database.with_name(f"{database.name}{suffix}")
            if file.exists():
                file.replace(aside.with_name(f"{aside.name}{suffix}"))
        return aside.name

    def insert(
        self, pulses: Iterable[Pulse | PulsePose], *others: Iterable[Statement]
    ) -> list[PulsePose]:
        """Insert all rows in one transaction; return the pulses that still have no pose."""
        database = self.connected()
        new: list[PulsePose] = []
        counts = {"pulses": 0, "repeated": 0, "refused": 0}
        database.execute("BEGIN IMMEDIATE")
        for record in pulses:
            try:
                _insert_pulse(database, record, new, counts)
            except _UNWRITABLE:
                counts["refused"] += 1
        for statements in others:
            for sql, row in statements:
                try:
                    database.execute(sql, row)
                except _UNWRITABLE:
                    counts["refused"] += 1
        database.execute("COMMIT")
        self.syncs += self._durable
        self.committed_pulses += counts["pulses"]
        self.repeated_pulses += counts["repeated"]
        self.refused_records += counts["refused"]
        return new

    def checkpoint(self, first: Callable[[], None]) -> bool:
        """Checkpoint the write-ahead log if it is due; False on failure.

        `first` is called before the checkpoint.
        """
        if self._durable:
            with suppress(OSError):
                if self._layout.write_ahead_log.stat().st_size > WAL_BYTES:
                    return self._fold(first)
            return True
        now_s = monotonic_s()
        if now_s < self._checkpoint_at_s:
            return True
        self._checkpoint_at_s = now_s + CHECKPOINT_S
        return self._fold(first)

    def _fold(self, first: Callable[[], None]) -> bool:
        first()
        self.syncs += 2  # this one, and the checkpoint's of the database
        try:
            self.connected().execute("PRAGMA wal_checkpoint(PASSIVE)")
        except sqlite3.Error:
            # Committed records are safe in the log, and a full disk shows in the next commit.
            return False
        return True

    def fold_all(self) -> None:
        """Checkpoint the whole write-ahead log into the database, and delete the log."""
        if self._open is not None:
            self._open.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            self.syncs += 1

    def without_pose(self, most: int) -> list[Pulse]:
        """Oldest recorded pulses without a pose, at most `most`; empty if the disk fails."""
        with suppress(sqlite3.Error, OSError, ValueError, TypeError):
            rows = self.connected().execute(schema.SELECT_PULSES_WITHOUT_POSE, (most,))
            return [schema.pulse_from_row(row) for row in rows]
        return []

    def poses_around(self, time_ns: int, reach_ns: int) -> list[Pose]:
        """Committed vehicle poses within `reach_ns` of a time; empty while the disk fails."""
        with suppress(sqlite3.Error, OSError, ValueError, TypeError):
            span = (time_ns - reach_ns, time_ns + reach_ns)
            rows = self.connected().execute(schema.SELECT_POSES, span)
            return [pose for row in rows if (pose := schema.pose_from_row(row)) is not None]
        return []


def is_damage(error: Exception) -> bool:
    """True if an error means that the database file is damaged."""
    code = getattr(error, "sqlite_errorcode", None)
    return code in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


def _identity(path: Path) -> tuple[int, int] | None:
    """Device and inode number of a file; None if it does not exist."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_dev, stat.st_ino


def _insert_pulse(
    database: sqlite3.Connection,
    record: Pulse | PulsePose,
    new: list[PulsePose],
    counts: dict[str, int],
) -> None:
    pulse = record.pulse if isinstance(record, PulsePose) else record
    inserted = database.execute(schema.INSERT_PULSE, schema.PULSES.row(pulse)).rowcount
    counts["pulses"] += inserted
    if not isinstance(record, PulsePose):
        counts["repeated"] += not inserted
        return
    key = (pulse.tag_id, pulse.start_time_ns)
    (pulse_id,) = database.execute(
        "SELECT pulse_id FROM pulses WHERE tag_id = ? AND start_time_ns = ?", key
    ).fetchone()
    row = (pulse_id, *schema.pose_row(record.pose))
    if database.execute(schema.INSERT_PULSE_POSE, row).rowcount:
        new.append(record)
    else:
        counts["repeated"] += 1
