"""Write a flight so that no recorded pulse is ever lost.

A pulse is *recorded* when `FlightRecorder.commit` returns. SQLite in WAL mode preserves every
committed record after ``kill -9``. With `durable`, each commit also waits for the disk
(``synchronous=FULL``, one fsync), and the write-ahead log is checkpointed at a size of
`WAL_BYTES`. Without `durable`, a checkpoint every `CHECKPOINT_S` writes the records to the
disk. The text log is a second copy. While the disk is full or read-only, records wait in
memory, and every commit tries again.
"""

import itertools
import json
import math
import os
import shutil
import sqlite3
from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TypeVar

import uavrt
from uavrt.config.settings import DetectionSettings, Settings
from uavrt.core.clock import Clock
from uavrt.core.errors import RecordingError
from uavrt.core.messages import (
    Beep,
    BurstInside,
    Command,
    CommandReply,
    Delivered,
    FlightInfo,
    Health,
    Pose,
    Pulse,
    PulsePose,
    SearchNote,
    SearchReport,
    StatusText,
    Tag,
)
from uavrt.flight.database import schema
from uavrt.flight.database.flight_database import FlightDatabase, Statement, is_damage
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.logs.detector_configs import detector_config, write_detector_config
from uavrt.flight.logs.pulse_logs import AT_ONCE, PulseLogs
from uavrt.flight.logs.pulse_pose_log import PulsePoseLog

T = TypeVar("T")

LEAST_FREE_BYTES = 1_000_000
"""Free space below which any commit may fail [bytes]."""

MAX_WAITING_PULSES = 100_000
"""Maximum number of pulses waiting in memory while the disk fails: 84 MB, or 3.5 h at 8 a
second."""

MAX_WAITING_OTHERS = 20_000
"""Maximum number of other records that wait in memory while the disk fails: half an hour of
poses and health records."""

Writable = Beep | Health | Pose | SearchNote | SearchReport | Tag


class FlightRecorder:
    """Writes one flight directory; use `create`, `reopen` or `open` to begin."""

    def __init__(self, directory: Path, *, durable: bool = False) -> None:
        self.layout = FlightLayout(directory)
        self.database = FlightDatabase(self.layout, durable=durable)
        self._origin: tuple[FlightInfo, Settings | None] | None = None
        self._begun = True
        self._restoring = False
        """True while a new database lacks pulses of the text log."""
        self._pulses: deque[Pulse | PulsePose] = deque()
        self._urgent: deque[Statement] = deque()
        """Waiting deliveries and other records to be committed together with pulses."""
        self._others: deque[Statement] = deque()
        self._logs = PulseLogs(self.layout)
        self.failed_commits = 0
        self.dropped_records = 0
        """Number of records dropped because too many waited for a failing disk."""
        self.mended = ""
        """Operator text on the last repair of a damaged database; empty if there was none."""

    @classmethod
    def create(cls, info: FlightInfo, settings: Settings | None = None) -> "FlightRecorder":
        """Begin a flight in `info.directory`, with its folders, configurations and database."""
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
        """Continue a flight after a kill or a power cut, without lost or duplicate records.

        With `durable`, each commit waits for the disk.
        """
        recorder = cls(Path(directory), durable=durable)
        if not recorder.layout.database.exists():
            raise RecordingError(
                f"{directory} holds no flight.sqlite", remedy="Start a new flight"
            )
        try:
            recorder._logs.complete_from(recorder.database.connected())
        except (sqlite3.Error, OSError) as error:
            raise recorder._failure(error) from error
        return recorder

    @classmethod
    def open(
        cls, info: FlightInfo, settings: Settings | None = None, *, durable: bool = False
    ) -> "FlightRecorder":
        """Begin a flight or continue an existing one; never fails, even on a full disk.

        On a full disk, records wait in memory; every commit reports this and tries again. A
        damaged database is renamed, and a new one is started with the pulses in the text log.
        With `durable`, each commit waits for the disk.
        """
        recorder = cls(Path(info.directory), durable=durable)
        recorder._origin, recorder._begun = (info, settings), False
        with suppress(RecordingError):
            recorder.commit()
        return recorder

    @property
    def waiting_records(self) -> int:
        """Number of records that are not committed yet."""
        return self.waiting_pulses + len(self._others)

    @property
    def waiting_pulses(self) -> int:
        """Number of uncommitted pulses and of uncommitted records that belong to pulses."""
        return len(self._pulses) + len(self._urgent)

    def write_pulses(self, pulses: Iterable[Pulse | PulsePose]) -> None:
        """Add new pulses, or earlier pulses with their poses; the next commit records them."""
        self._add(self._pulses, pulses, MAX_WAITING_PULSES)

    def write_inside(self, burst: BurstInside) -> None:
        """Add the single pulses of a coded tag's burst; the next commit records them."""
        self._add(self._urgent, [(schema.UPDATE_INSIDE, schema.inside_row(burst))])

    def write(self, *records: Writable) -> None:
        """Add records other than pulses; a tag replaces an earlier tag with the same id."""
        for record in records:
            sql, row_of = schema.WRITTEN[type(record)]
            self._add(self._others, [(sql, row_of(record))])

    def write_status_text(self, text: StatusText, time_ns: int) -> None:
        """Add a status text that the operator received at `time_ns`."""
        row = (time_ns, text.severity, text.text)
        self._add(self._others, [(schema.INSERT_STATUS_TEXT, row)])

    def write_delivered(self, delivered: Delivered) -> None:
        """Record which pulses have been received by a ground station."""
        head = (delivered.store, delivered.time_ns)
        rows = [(schema.INSERT_DELIVERY, (*head, *key)) for key in delivered.pulses]
        self._add(self._urgent, rows)

    def write_command(self, command: Command, reply: CommandReply | None, time_ns: int) -> None:
        """Record a command and its answer; `reply` is None if the supervisor did not answer."""
        row = schema.command_row(command, reply, time_ns)
        self._add(self._others, [(schema.INSERT_COMMAND, row)])

    def write_note(self, text: str, time_ns: int) -> None:
        """Add a note on the flight, such as a clock correction or a restart."""
        self._add(self._others, [(schema.INSERT_NOTE, (time_ns, text))])

    def commit(self, *, pulses_only: bool = False) -> None:
        """Commit all waiting records; after an error they stay in memory.

        `pulses_only`: commit only pulses, their poses and their deliveries. The other records
        wait, so that fewer half-full pages are written.
        """
        try:
            if not self._begun:
                self._begin()
            if self.database.is_gone():
                self.database.write_again()
                self._logs.compare_first()
                self.mended = (
                    "the flight's database was removed or replaced, and is written again"
                )
            database = self.database.connected()
            others = [self._urgent] if pulses_only else [self._urgent, self._others]
            if self._pulses or any(others):
                new = self.database.insert(self._pulses, *others)
                self._pulses.clear()
                for written in others:
                    written.clear()
                self._logs.add(new)
        except (sqlite3.Error, OSError, RecordingError) as error:
            self.failed_commits += 1
            raise self._failure(error) from error
        self._logs.write(database)
        self.failed_commits += not self.database.checkpoint(self._logs.sync)

    def is_suspect(self) -> bool:
        """True if the next commit may fail: disk full or read-only, or database file gone."""
        root = self.layout.root
        try:
            full = shutil.disk_usage(root).free < LEAST_FREE_BYTES
        except OSError:
            return True
        gone = not self._begun or self.database.is_gone()
        return full or gone or not os.access(root, os.W_OK)

    def close(self) -> None:
        """Commit and checkpoint, then close the database even if one of these fails."""
        try:
            self.commit()
            self.database.fold_all()
        except sqlite3.Error as error:
            raise self._failure(error) from error
        finally:
            self.database.disconnect()

    def _begin(self) -> None:
        """Create the files of a new flight; repeated calls do no harm."""
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
            self._logs.complete_from(self.database.connected())
        except sqlite3.DatabaseError as error:
            if not is_damage(error):
                raise
            self.database.disconnect()
            aside = self.database.move_aside()
            self._logs.compare_first()
            self._restoring = True
            self.mended = f"database damaged ({error}), put aside as {aside}"
            self.write_note(self.mended, Clock(info.clock_offset_ns).now_ns())
        if self._restoring:
            self._restore()
        self._urgent.extend(_info_statements(info, settings))
        self._begun = True

    def _restore(self) -> None:
        logged = PulsePoseLog(self.layout.pulse_pose_log).pulse_poses()
        while some := list(itertools.islice(logged, AT_ONCE)):
            new = self.database.insert(some, self._urgent)
            self._urgent.clear()
            self._logs.add(new)
        self._restoring = False

    def _add(
        self, waiting: deque[T], records: Iterable[T], most: int = MAX_WAITING_OTHERS
    ) -> None:
        """Add records to those that wait; if there are too many, drop the oldest."""
        waiting.extend(records)
        while len(waiting) > most:
            waiting.popleft()
            self.dropped_records += 1

    def _failure(self, error: Exception) -> RecordingError:
        """Roll back, close the file until the next commit, and return the error to raise."""
        if isinstance(error, RecordingError):
            return error
        if is_damage(error):
            self._begun = False
        self.database.roll_back()
        waiting = f"{self.waiting_records} records wait in memory"
        return RecordingError(
            f"cannot write the flight {self.layout.root}: {error}",
            remedy=f"Free space or repair the disk; {waiting}",
        )


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
    return [(flight, row), *((schema.INSERT_TAG, schema.TAGS.row(tag)) for tag in info.tags)]
