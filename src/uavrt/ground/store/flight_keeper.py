"""Start, resume and end the ground station's own recording of a flight."""

import math
import sqlite3
from collections.abc import Callable, Iterable
from contextlib import closing
from pathlib import Path

from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.earth.on_ground import ARMED, GROUND_STATION, LANDED
from uavrt.core.errors import RecordingError
from uavrt.core.log import get_logger
from uavrt.core.messages import (
    BurstInside,
    FlightInfo,
    Health,
    Pose,
    PulsePose,
    StatusText,
    Tag,
)
from uavrt.core.runtime.disk_thread import Disk, at_once
from uavrt.flight.database.plain_database import open_plain
from uavrt.flight.flight_layout import FlightLayout, new_flight_directory
from uavrt.flight.flight_order import new_copy_directory
from uavrt.flight.flight_recorder import FlightRecorder, Writable
from uavrt.flight.reading.flight_reader import ground_states_in
from uavrt.ground.store.drone_directory import is_drone_directory
from uavrt.ground.store.flight_queue import FlightQueue
from uavrt.ground.store.flight_writer import FlightWriter, Stored
from uavrt.ground.store.live_columns import LiveColumns
from uavrt.ground.store.stored_flights import Columns

log = get_logger()

BURST_TIMEOUT_S = 60.0
"""Longest wait for a coded burst whose pulse times arrived first [s]. The drone repeats the
burst until it is acknowledged. A burst that does not arrive belongs to another ground station's
flight."""
MOST_EARLY = 1000
"""Maximum number of messages with pulse times that wait for their burst."""


class FlightKeeper:
    """Writes all received data into a flight directory of the ground station.

    Its methods do not wait for the disk: `queue` takes the writes and counts how many are
    durable.

    `directory`: parent of the flight directories.
    `disk`: thread for writing; without one, a commit writes before it returns.
    `also`: called in that thread with each pulse and burst content before its flight is
    committed. If it raises `RecordingError`, it is called again later and the flight waits.
    `on_written`: called after each write, successful or not.
    `begun`: flights begun, also by other keepers, that may not be on the disk yet.
    """

    def __init__(
        self,
        directory: Path,
        clock: Clock,
        disk: Disk = at_once,
        *,
        also: Callable[[Stored], object] = lambda _item: None,
        on_written: Callable[[], None] = lambda: None,
        begun: set[Path] | None = None,
    ) -> None:
        self._directory = directory
        self._clock = clock
        self.queue = FlightQueue(directory, disk, also, on_written)
        self._live = LiveColumns()
        self._path: Path | None = None
        """Directory of the open flight; None without one."""
        self._begun: set[Path] = set() if begun is None else begun
        self._before: tuple[Path | None, frozenset[tuple[int, int]]] = (None, frozenset())
        self._early_s: dict[tuple[int, int], float] = {}
        """Time at which pulse times of each missing burst first arrived [s]."""
        self.without_burst = 0
        """Number of messages with pulse times discarded because their burst did not arrive."""
        self.flight_id: str | None = None
        self.start_time_ns = 0
        self.ended = True

    @property
    def pulses(self) -> int:
        """Number of different pulses in this flight."""
        return len(self._live.keys)

    def begin(self, tags: Iterable[Tag], flown: Path | None = None) -> str:
        """Begin a flight; return its name. `flown`: the drone's recording with that name."""

        def is_taken(path: Path) -> bool:
            return path in self._begun or path.exists()

        self.close()
        now_ns = self._clock.now_ns()
        if flown is None:
            path = new_flight_directory(self._directory, now_ns, is_taken)
        else:
            path = new_copy_directory(flown, is_taken)
        self._begun.add(path)
        info = FlightInfo(
            directory=str(path),
            start_time_ns=now_ns,
            clock_offset_ns=self._clock.offset_ns,
            center_frequency_hz=math.nan,
            sample_rate_hz=math.nan,
            tags=tuple(tags),
        )
        among = flown is None and is_drone_directory(self._directory)
        self.queue.put(lambda writer: writer.begin(info, among_the_drones=among))
        self._path = path
        self._forget(path.name, now_ns)
        self.ended = False
        self.queue.commit()
        return path.name

    def resume(self, flight_id: str) -> bool:
        """Continue a flight after a restart; False if it is unreadable. Waits for the disk."""
        path = self._directory / flight_id
        if Path(flight_id).name != flight_id:
            return False
        try:
            self.queue.writer.go_on(path)
            with closing(open_plain(FlightLayout(path).database)) as database:
                (start_ns,) = database.execute("SELECT start_time_ns FROM flight").fetchone()
                self._forget(flight_id, start_ns)
                keys = database.execute("SELECT tag_id, start_time_ns FROM pulses")
                self._live.resume(keys.fetchall(), ground_states_in(database))
        except (RecordingError, sqlite3.Error, TypeError) as error:
            log.warning(
                "the earlier flight cannot be resumed", flight=flight_id, reason=str(error)
            )
            self.queue.writer.end()
            self.flight_id = None
            return False
        self._path = path
        self.ended = False
        return True

    def load(self, columns: Columns) -> None:
        """Load the pulses and poses of a resumed flight for the estimates."""
        self._live.load(columns)

    def _store(self, item: Stored) -> None:
        """Queue a pulse of the open flight; raises `RecordingError` if the queue is full."""
        if self._path is None:
            raise RecordingError("no flight is open")
        self.queue.store(lambda writer: writer.store(item))

    def _record(self, write: Callable[[FlightRecorder], None]) -> None:
        """Queue a record that needs no receipt; after the end of the flight it is ignored."""
        if not self.ended:
            self.queue.record(write)

    def add_pulse(self, item: PulsePose) -> bool:
        """Add a pulse; False for a repeated one. Raises `RecordingError` if too many wait."""
        key = item.pulse.key
        if key in self._live.keys:
            return False
        self._store(item)
        self._live.add_pulse(item)
        self._early_s.pop(key, None)
        return True

    def put_inside(self, burst: BurstInside) -> bool:
        """Store the pulse times of a burst; False if the burst belongs to another flight."""
        if burst.key in self._live.keys:
            self._store(burst)
            if burst.also_possible_tag_ids:
                self._live.doubt(burst)
            return True
        path, keys = self._before
        if path is not None and burst.key in keys:
            before = path
            self.queue.put(lambda writer: writer.store_before(before, burst), counts=True)
            return False
        if len(self._early_s) >= MOST_EARLY:
            self._early_s.clear()
        now_s = monotonic_s()
        if now_s < self._early_s.setdefault(burst.key, now_s) + BURST_TIMEOUT_S:
            raise RecordingError(
                "the times of single pulses have arrived, but not the report of their burst"
            )
        del self._early_s[burst.key]
        self.without_burst += 1
        log.seldom(
            self.without_burst, "pulse times were discarded, because their burst did not arrive"
        )
        return False

    def add_pose(self, pose: Pose) -> None:
        """Add a pose of the vehicle."""
        if not self.ended and self._live.add_pose(pose):
            self.write(pose)

    def add_state(self, time_ns: int, armed: bool | None, landed: bool | None) -> None:
        """Record whether the vehicle is armed and landed; only changes are written."""
        if self.ended or not self._live.add_state(time_ns, armed, landed):
            return
        said = {ARMED: armed, LANDED: landed}
        counters = {name: float(one) for name, one in said.items() if one is not None}
        health = Health(
            process=GROUND_STATION, time_ns=time_ns, status="ready", ok=True, counters=counters
        )
        self.write(health)

    def write(self, record: Writable) -> None:
        """Add a record, such as a search report; a `Tag` replaces the tag of the same id."""
        self._record(lambda flight: flight.write(record))

    def add_text(self, severity: int, text: str, time_ns: int) -> None:
        """Add a status text for the operator."""
        said = StatusText(severity=severity, text=text)
        self._record(lambda flight: flight.write_status_text(said, time_ns))

    def add_note(self, text: str, time_ns: int) -> None:
        """Add a remark of the operator, also after the end of the flight."""
        if self._path is not None:
            self.queue.record(lambda flight: flight.write_note(text, time_ns))

    def columns(self) -> Columns:
        """Copy the columns of the flight for use in another thread."""
        return self._live.columns(goes_on=not self.ended)

    def end(self) -> None:
        """Mark the flight as ended; late pulses of it are still added."""
        self.ended = True

    def close(self) -> None:
        """Close the recording; a later `commit` makes writes that the disk refuses now."""
        if self._path is not None:
            self._before = self._path, frozenset(self._live.keys)
            self.queue.put(FlightWriter.end)
        self._path = None
        self.ended = True
        self.queue.commit(at_once=True)

    def _forget(self, flight_id: str, start_time_ns: int) -> None:
        self.flight_id, self.start_time_ns = flight_id, start_time_ns
        self._live = LiveColumns()
