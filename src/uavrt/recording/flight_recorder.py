"""Writes a flight so that nothing recorded is ever lost.

A pulse is *recorded* when `FlightRecorder.commit` returns. SQLite in WAL mode keeps every
committed record through ``kill -9``. In a flight that is received or flown each also reaches
the disk (``synchronous=FULL``, one fsync), and the write-ahead log is folded into the database
when it has grown to `WAL_BYTES`; elsewhere a checkpoint every `CHECKPOINT_S` does both. The
text log is a second copy. On a disk that is full or read-only the records wait in memory and
every commit tries again.
"""

import itertools
import json
import math
import os
import shutil
import sqlite3
from collections import deque
from collections.abc import Iterable
from contextlib import closing, suppress
from dataclasses import asdict
from pathlib import Path

import uavrt
from uavrt.clock import Clock, monotonic_s
from uavrt.config.settings import DetectionSettings, Settings
from uavrt.errors import RecordingError
from uavrt.messages import (
    Beep,
    BurstInside,
    Command,
    CommandReply,
    Delivered,
    FlightInfo,
    Health,
    Pose,
    Poses,
    Pulse,
    PulsePose,
    SearchNote,
    SearchReport,
    StatusText,
    Tag,
)
from uavrt.recording import schema
from uavrt.recording.detector_configs import detector_config, write_detector_config
from uavrt.recording.layout import FlightLayout
from uavrt.recording.pulse_logs import AT_ONCE, PulseLogs
from uavrt.recording.pulse_pose_log import PulsePoseLog

CHECKPOINT_S = 2.0
"""Time between checkpoints without a sync at each commit [s]; the most a power cut loses."""

WAL_BYTES = 4_000_000
"""Size at which the write-ahead log is folded into the database, after some ten minutes. Pages
rewritten meanwhile are copied once; reading the log takes 10 ms."""

LEAST_FREE_BYTES = 1_000_000
"""Free space below which a commit may be refused at any moment."""

PAGE_BYTES = 512
"""Size of a page, below SQLite's 4096: each commit writes some ten partly filled ones."""

MAX_WAITING_PULSES = 100_000
"""Pulses kept in memory while the disk fails: 84 MB, 3.5 hours at 8 pulses a second."""

MAX_WAITING_OTHERS = 20_000
"""Poses and health kept in memory: half an hour; pulses carry their own poses."""

_POISON = (sqlite3.IntegrityError, sqlite3.DataError, sqlite3.InterfaceError, OverflowError)
# Python 3.11 raises InterfaceError or ProgrammingError for a type SQLite does not know.
_UNWRITABLE = (*_POISON, sqlite3.ProgrammingError, UnicodeEncodeError)

Statement = tuple[str, schema.Row]
CACHE_KIB = 256
"""SQLite's page cache; small, since rows are only appended."""


class FlightRecorder:
    """One flight directory being written; made by `create`, `reopen` or `open`."""

    def __init__(self, directory: Path, *, durable: bool = False) -> None:
        self.layout = FlightLayout(directory)
        self._durable = durable
        self._database: sqlite3.Connection | None = None
        self._file: tuple[int, int] | None = None
        """Device and number of the open database."""
        self._origin: tuple[FlightInfo, Settings | None] | None = None
        self._begun = True
        self._restoring = False
        """Whether pulses of the text log are still missing in the new database."""
        self._pulses: deque[Pulse | PulsePose] = deque()
        self._urgent: deque[Statement] = deque()
        """Deliveries and other records committed with the pulses."""
        self._others: deque[Statement] = deque()
        self._logs = PulseLogs(self.layout)
        self._checkpoint_at_s = monotonic_s() + CHECKPOINT_S
        self.syncs = 0
        """Calls of fsync: one for a commit, two for a checkpoint."""
        self.committed_pulses = 0
        """New pulses written since this recorder was made."""
        self.repeated_pulses = 0
        """Pulses recorded before, as when a sender repeats after a restart."""
        self.failed_commits = 0
        self.dropped_records = 0
        """Records dropped because too many waited for a disk that did not recover."""
        self.refused_records = 0
        """Records that no database can hold, such as numbers beyond 64 bits."""
        self.mended = ""
        """The last database fault that was repaired, for the operator."""

    @classmethod
    def create(cls, info: FlightInfo, settings: Settings | None = None) -> "FlightRecorder":
        """Begin a flight in `info.directory`: its directories, configs and database.

        Raises `RecordingError` if it cannot be written, or contains a flight.
        """
        recorder = cls(Path(info.directory))
        if recorder.layout.database.exists():
            raise RecordingError(
                f"{info.directory} already holds a flight",
                remedy="Reopen it, or choose another directory",
            )
        recorder._origin, recorder._begun = (info, settings), False
        recorder.commit()
        return recorder

    @classmethod
    def reopen(cls, directory: str | Path, *, durable: bool = False) -> "FlightRecorder":
        """Continue a flight after a kill or a power cut, without lost or double records.

        `durable` as in `open`. Raises `RecordingError` if there is no flight, or it cannot be
        written.
        """
        recorder = cls(Path(directory), durable=durable)
        if not recorder.layout.database.exists():
            raise RecordingError(
                f"{directory} holds no flight.sqlite", remedy="Start a new flight"
            )
        try:
            recorder._logs.complete_from(recorder._connected())
        except (sqlite3.Error, OSError) as error:
            raise recorder._failure(error) from error
        return recorder

    @classmethod
    def open(
        cls, info: FlightInfo, settings: Settings | None = None, *, durable: bool = False
    ) -> "FlightRecorder":
        """Begin the flight, or continue it if it exists.

        Never fails: on a full disk records wait in memory, and every commit reports it and
        tries again. A damaged database is put aside, and a new one starts with the pulses of
        the text log. With `durable` each commit waits for the disk.
        """
        recorder = cls(Path(info.directory), durable=durable)
        recorder._origin, recorder._begun = (info, settings), False
        with suppress(RecordingError):
            recorder.commit()
        return recorder

    @property
    def waiting_records(self) -> int:
        """Number of records not committed yet."""
        return self.waiting_pulses + len(self._others)

    @property
    def waiting_pulses(self) -> int:
        """Number of pulses, and records that belong to them, not committed yet."""
        return len(self._pulses) + len(self._urgent)

    def write_pulses(self, pulses: Iterable[Pulse]) -> None:
        """Add pulses as detected; recorded with the next commit."""
        self._pulses.extend(pulses)
        self._bound(self._pulses, MAX_WAITING_PULSES)

    def write_pulse_poses(self, pulse_poses: Iterable[PulsePose]) -> None:
        """Add pulses with their poses, whether or not the pulse was written before."""
        self._pulses.extend(pulse_poses)
        self._bound(self._pulses, MAX_WAITING_PULSES)

    def write_inside(self, burst: BurstInside) -> None:
        """Add the content of a recorded burst; committed with the pulses."""
        self._urgent.append((schema.UPDATE_INSIDE, schema.inside_row(burst)))
        self._bound(self._urgent, MAX_WAITING_OTHERS)

    def without_pose(self, most: int) -> list[Pulse]:
        """Get up to `most` recorded pulses whose pose is open, the oldest first.

        None while the disk fails.
        """
        with suppress(sqlite3.Error, OSError, ValueError, TypeError):
            rows = self._connected().execute(schema.SELECT_PULSES_WITHOUT_POSE, (most,))
            return [schema.pulse_from_row(row) for row in rows]
        return []

    def poses_around(self, time_ns: int, reach_ns: int) -> list[Pose]:
        """Get the committed poses of the vehicle around a time; none while the disk fails."""
        with suppress(sqlite3.Error, OSError, ValueError, TypeError):
            span = (time_ns - reach_ns, time_ns + reach_ns)
            found = map(
                schema.pose_from_row, self._connected().execute(schema.SELECT_POSES, span)
            )
            return [pose for pose in found if pose is not None]
        return []

    def write_poses(self, poses: Poses) -> None:
        """Add raw vehicle poses."""
        for pose in poses.poses:
            self._take(schema.INSERT_POSE, schema.pose_row(pose))

    def write_health(self, health: Health) -> None:
        """Add a process's health record."""
        self._take(schema.INSERT_HEALTH, schema.health_row(health))

    def write_status_text(self, text: StatusText, time_ns: int) -> None:
        """Add a text for the operator, shown at `time_ns`."""
        self._take(schema.INSERT_STATUS_TEXT, (time_ns, text.severity, text.text))

    def write_search_report(self, report: SearchReport) -> None:
        """Add a search without a detection, with its noise floor."""
        self._take(schema.INSERT_SEARCH_REPORT, schema.search_report_row(report))

    def write_tags(self, tags: Iterable[Tag]) -> None:
        """Replace tags by corrected ones."""
        for tag in tags:
            self._take(schema.REPLACE_TAG, schema.tag_row(tag))

    def write_beep(self, beep: Beep) -> None:
        """Add a measurement of a sender of pulses."""
        self._take(schema.INSERT_BEEP, schema.beep_row(beep))

    def write_search_note(self, note: SearchNote) -> None:
        """Add a search's decision or result."""
        self._take(schema.INSERT_SEARCH_NOTE, schema.search_note_row(note))

    def write_delivered(self, delivered: Delivered) -> None:
        """Record which pulses have reached the ground."""
        for tag_id, start_time_ns in delivered.pulses:
            row = (delivered.store, delivered.time_ns, tag_id, start_time_ns)
            self._urgent.append((schema.INSERT_DELIVERY, row))
        self._bound(self._urgent, MAX_WAITING_OTHERS)

    def write_command(self, command: Command, reply: CommandReply | None, time_ns: int) -> None:
        """Add a command and its answer."""
        self._take(schema.INSERT_COMMAND, schema.command_row(command, reply, time_ns))

    def write_note(self, text: str, time_ns: int) -> None:
        """Add a remark on the flight: a corrected clock, a restart."""
        self._take(schema.INSERT_NOTE, (time_ns, text))

    def commit(self, *, pulses_only: bool = False) -> None:
        """Commit the written records; a kill afterwards loses none of them.

        `pulses_only`: only pulses with their poses and deliveries; later commits then write
        fewer half-full pages. Raises `RecordingError` if the disk is full or cannot be written;
        the records then wait in memory for the next commit.
        """
        try:
            if not self._begun:
                self._begin()
            if self._is_gone():
                self._write_again()
            database = self._connected()
            others = deque[Statement]() if pulses_only else self._others
            if self._pulses or self._urgent or others:
                self._insert_all(database, others)
        except (sqlite3.Error, OSError, RecordingError) as error:
            self.failed_commits += 1
            raise self._failure(error) from error
        self._logs.write(database)
        self._checkpoint(database)

    def is_suspect(self) -> bool:
        """Whether the disk may refuse the next commit, as far as can be seen without trying."""
        root = self.layout.root
        try:
            full = shutil.disk_usage(root).free < LEAST_FREE_BYTES
        except OSError:
            return True
        return full or not self._begun or self._is_gone() or not os.access(root, os.W_OK)

    def close(self) -> None:
        """Commit, fold the log into the database file and close, even if the commit fails.

        Raises `RecordingError` if it failed.
        """
        try:
            self.commit()
            if self._database is not None:
                self._database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
                self.syncs += 1
        except sqlite3.Error as error:
            raise self._failure(error) from error
        finally:
            self._disconnect()

    def _begin(self) -> None:
        """Make what a flight has from its first moment; can be repeated."""
        if self._origin is None:
            return
        info, settings = self._origin
        searched = DetectionSettings() if settings is None else settings.detection
        self.layout.make([tag.tag_id for tag in info.tags])
        for tag in info.tags:
            path = self.layout.tag_config(tag.tag_id)
            # A ground station records too, without the radio's frequency.
            if not path.exists() and math.isfinite(info.center_frequency_hz):
                output = str(self.layout.tag_pulse_pose_log(tag.tag_id).parent)
                sent = None if settings is None else settings.udp_channels
                config = detector_config(
                    tag,
                    info.center_frequency_hz,
                    output,
                    ports="thesis" if sent is None or not sent.enabled else sent.ports,
                    operating_mode=searched.operating_mode,
                )
                write_detector_config(path, config, info.start_time_ns)
        try:
            self._logs.complete_from(self._connected())
        except sqlite3.DatabaseError as error:
            if not _damaged(error):
                raise
            self._disconnect()
            self._put_aside(Clock(info.clock_offset_ns).now_ns(), str(error))
        if self._restoring:
            self._restore(self._connected())
        self._urgent.extend(_info_statements(info, settings))
        self._begun = True

    def _restore(self, database: sqlite3.Connection) -> None:
        """Copy some pulses of the text log into a new database."""
        logged = PulsePoseLog(self.layout.pulse_pose_log).pulse_poses()
        waiting = self._pulses
        try:
            while some := list(itertools.islice(logged, AT_ONCE)):
                self._pulses = deque(some)
                self._insert_all(database, deque())
        finally:
            self._pulses = waiting
        self._restoring = False

    def _put_aside(self, now_ns: int, why: str) -> None:
        """Begin a new database with the pulses of the text log; keep the damaged one."""
        aside = self._rename()
        self._logs.compare_first()
        self._restoring = True
        self.mended = f"database damaged ({why}), put aside as {aside}"
        self.write_note(self.mended, now_ns)

    def _rename(self) -> str:
        """Rename the file with the database's name; return the new name."""
        database = self.layout.database
        number = 1
        while (aside := database.with_name(f"{database.name}.damaged-{number}")).exists():
            number += 1
        for suffix in ("", "-wal", "-shm"):
            file = database.with_name(f"{database.name}{suffix}")
            if file.exists():
                file.replace(aside.with_name(f"{aside.name}{suffix}"))
        return aside.name

    def _is_gone(self) -> bool:
        """Whether the open database's file was removed or replaced, so readers miss it."""
        return self._database is not None and _identity(self.layout.database) != self._file

    def _write_again(self) -> None:
        """Copy the open database, whose file was removed or replaced, to its place."""
        root, old = self.layout.root, self._database
        assert old is not None
        assert self._file is not None
        there = next(path for path in root.parents if path.exists())
        if there.stat().st_dev != self._file[0]:
            raise RecordingError(f"the disk of {root} is gone", remedy="Connect it again")
        self.layout.make([])
        copy = root / ".flight.sqlite"
        copy.unlink(missing_ok=True)
        with closing(sqlite3.connect(copy)) as new:
            old.backup(new)
        self._disconnect()  # before the new one has a log, which this would remove
        self._rename()
        copy.replace(self.layout.database)
        self._logs.compare_first()
        self.mended = "the flight's database was removed or replaced, and is written again"

    def _take(self, sql: str, row: schema.Row) -> None:
        self._others.append((sql, row))
        self._bound(self._others, MAX_WAITING_OTHERS)

    def _bound(self, waiting: "deque[Pulse | PulsePose] | deque[Statement]", most: int) -> None:
        while len(waiting) > most:
            waiting.popleft()
            self.dropped_records += 1

    def _connected(self) -> sqlite3.Connection:
        if self._database is None:
            database = sqlite3.connect(
                self.layout.database, isolation_level=None, timeout=2.0, cached_statements=16
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
            self._database, self._file = database, _identity(self.layout.database)
        return self._database

    def _disconnect(self) -> None:
        if self._database is not None:
            self._database.close()
            self._database = None

    def _insert_all(self, database: sqlite3.Connection, others: deque[Statement]) -> None:
        """Insert all rows in one transaction."""
        new: list[PulsePose] = []
        counts = {"pulses": 0, "repeated": 0, "refused": 0}
        database.execute("BEGIN IMMEDIATE")
        for record in self._pulses:
            try:
                self._insert_pulse(database, record, new, counts)
            except _UNWRITABLE:
                counts["refused"] += 1
        for statements in (self._urgent, others):
            for sql, row in statements:
                try:
                    database.execute(sql, row)
                except _UNWRITABLE:
                    counts["refused"] += 1
        database.execute("COMMIT")
        self.syncs += self._durable
        self._pulses.clear()
        self._urgent.clear()
        others.clear()
        self.committed_pulses += counts["pulses"]
        self.repeated_pulses += counts["repeated"]
        self.refused_records += counts["refused"]
        self._logs.take(new)

    def _insert_pulse(
        self,
        database: sqlite3.Connection,
        record: Pulse | PulsePose,
        new: list[PulsePose],
        counts: dict[str, int],
    ) -> None:
        pulse = record.pulse if isinstance(record, PulsePose) else record
        inserted = database.execute(schema.INSERT_PULSE, schema.pulse_row(pulse)).rowcount
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

    def _checkpoint(self, database: sqlite3.Connection) -> None:
        """Fold the write-ahead log into the database file, with a disk sync."""
        if self._durable:
            with suppress(OSError):
                if self.layout.write_ahead_log.stat().st_size > WAL_BYTES:
                    self._fold(database)
            return
        now_s = monotonic_s()
        if now_s >= self._checkpoint_at_s:
            self._checkpoint_at_s = now_s + CHECKPOINT_S
            self._fold(database)

    def _fold(self, database: sqlite3.Connection) -> None:
        self._logs.sync()
        self.syncs += 2  # this one, and the checkpoint's of the database
        try:
            database.execute("PRAGMA wal_checkpoint(PASSIVE)")
        except sqlite3.Error:
            # Committed records are safe in the log, and a full disk shows in the next commit.
            self.failed_commits += 1

    def _failure(self, error: Exception) -> RecordingError:
        """Roll back, close the file (it may be on another disk soon), and return the error."""
        if isinstance(error, RecordingError):
            return error
        if _damaged(error):
            self._begun = False
        if self._database is not None:
            try:
                if self._database.in_transaction:
                    self._database.execute("ROLLBACK")
                if not self._is_gone():
                    self._disconnect()
            except sqlite3.Error:
                self._database = None
        waiting = f"{self.waiting_records} records wait in memory"
        return RecordingError(
            f"cannot write the flight {self.layout.root}: {error}",
            remedy=f"Free space or repair the disk; {waiting}",
        )


def _identity(path: Path) -> tuple[int, int] | None:
    """Device and number of a file; None where there is none."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_dev, stat.st_ino


def _damaged(error: Exception) -> bool:
    code = getattr(error, "sqlite_errorcode", None)
    return code in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


def _info_statements(info: FlightInfo, settings: Settings | None) -> list[Statement]:
    columns = "start_time_ns, clock_offset_ns, center_frequency_hz, sample_rate_hz, settings, "
    row = (
        info.start_time_ns,
        info.clock_offset_ns,
        info.center_frequency_hz,
        info.sample_rate_hz,
        None if settings is None else json.dumps(asdict(settings)),
        uavrt.__version__,
    )
    flight = (
        f"INSERT INTO flight ({columns} uavrt_version) SELECT ?, ?, ?, ?, ?, ? "
        "WHERE NOT EXISTS (SELECT 1 FROM flight)"
    )
    return [(flight, row), *((schema.INSERT_TAG, schema.tag_row(tag)) for tag in info.tags)]
