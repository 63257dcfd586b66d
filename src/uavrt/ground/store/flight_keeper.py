"""The ground's own flight recording: start, resume after a restart, end."""

import asyncio
import math
import sqlite3
from array import array
from collections.abc import Callable, Iterable
from contextlib import closing
from pathlib import Path

import numpy as np

from uavrt.clock import Clock, monotonic_s
from uavrt.errors import RecordingError
from uavrt.ground.store.beside_drone import is_the_drones
from uavrt.ground.store.flight_writer import FlightWriter, Stored, Written
from uavrt.ground.store.flights import PULSE_COLUMNS, Columns, pulse_cells
from uavrt.log import get_logger
from uavrt.messages import (
    Beep,
    BurstInside,
    FlightInfo,
    Health,
    Pose,
    Poses,
    PulsePose,
    SearchReport,
    StatusText,
    Tag,
)
from uavrt.on_ground import ARMED, GROUND_STATION, LANDED, GroundStates
from uavrt.recording.disk_thread import Disk, DiskBatches, at_once
from uavrt.recording.flight_order import copy_beside
from uavrt.recording.flight_reader import ground_states_in
from uavrt.recording.flight_recorder import FlightRecorder
from uavrt.recording.layout import FlightLayout, new_flight_directory
from uavrt.recording.plain_database import open_plain

log = get_logger()

POSE_STEP_NS = 190_000_000
"""Poses are kept five times a second at most: 36 000 in two hours."""
MOST_WAITING = 10_000
"""Pulses that wait in memory for a disk that fails. More stay with the drone, which sends again
what is not acknowledged."""
MOST_OTHERS = 20_000
"""Poses, notes and the like that wait while the disk does not answer."""
RETRY_S = 1.0
"""Between two tries of a disk that fails."""
SLOW_S = 2.0
"""A write that takes longer is reported [s]; a healthy memory card takes some milliseconds."""
TURN_S = 0.01
"""Between two looks at whether the disk has written."""
BURST_COMES_WITHIN_S = 60.0
"""Longest wait for a burst whose content came first [s]; each is sent until acknowledged. A
burst that does not come belongs to a flight that this ground station does not have."""
MOST_EARLY = 1000
"""Most bursts whose content is kept waiting."""
PULSE_WIDTH = len(PULSE_COLUMNS)
POSE_WIDTH = 8


class FlightKeeper:
    """Writes everything that is received into a flight directory of the ground's own.

    Nothing here waits for the disk: `commit` hands over what was taken, and `progress` says
    how much of it is durable.

    `directory`: where flights are made.
    `disk`: where the writing is done; without one `commit` does it before it returns.
    `also`: called where the writing is done, with each pulse and content of a burst before its
    flight is committed. A `RecordingError` has it called again, and the flight waits.
    `on_written`: called after each write, whether the disk took it or not.
    `begun`: flights that were begun, also by other keepers; the disk may not have them yet.
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
        self._writer = FlightWriter(also)
        self._works: DiskBatches[tuple[bool, Callable[[FlightWriter], None]], Written] = (
            DiskBatches(disk, self._writer.write, self._written)
        )
        """What the writer is to do; True for what receipts wait for."""
        self._on_written = on_written
        self._path: Path | None = None
        """Of the flight that is open."""
        self._begun: set[Path] = set() if begun is None else begun
        self._taken = self._applied = self._durable = 0
        self._left_out = 0
        self._retry_at_s = 0.0
        self._reported = False
        self._error: str | None = None
        self._mended = ""
        self._before: tuple[Path | None, frozenset[tuple[int, int]]] = (None, frozenset())
        self._keys: set[tuple[int, int]] = set()
        self._early_s: dict[tuple[int, int], float] = {}
        """Bursts that have not come, and the time at which their content first came [s]."""
        self.without_burst = 0
        """Contents discarded because their burst did not come."""
        self._pulses = array("d")
        self._poses = array("d")
        self._told = GroundStates()
        self._last_pose_ns = 0
        self._takeoff: tuple[float, float] = math.inf, math.nan
        """Time of the first pose [ns], and the height above sea level that it counts from."""
        self.flight_id: str | None = None
        self.start_time_ns = 0
        self.ended = True

    @property
    def fault(self) -> str | None:
        """Why the disk has not taken all, or that it is slow; None when all is well."""
        handed_s = self._works.handed_s
        now_s = 0.0 if handed_s is None else monotonic_s() - handed_s
        before_s = 0.0 if self._error is not None or self.stored else self._works.took_s
        slow_s = max(now_s, before_s)
        if slow_s < SLOW_S:
            return self._error
        error = RecordingError(
            f"the disk of {self._directory} takes {slow_s:.0f} s to write: "
            f"{self._waiting} pulses wait in memory",
            remedy="Check or replace it",
        )
        return str(error)

    @property
    def progress(self) -> tuple[int, int]:
        """How many pulses and contents of bursts were taken, and the durable ones of these."""
        return self._taken, self._durable

    @property
    def pulses(self) -> int:
        """Different pulses of this flight."""
        return len(self._keys)

    def begin(self, tags: Iterable[Tag], flown: Path | None = None) -> str:
        """Begin a flight; gives its name.

        `flown`: the drone's own recording of it in the same directory: ours is a copy of that.
        """
        self.close()
        now_ns = self._clock.now_ns()
        if flown is None:
            path = new_flight_directory(self._directory, now_ns, self._is_taken)
        else:
            path = copy_beside(flown, self._is_taken)
        self._begun.add(path)
        info = FlightInfo(
            directory=str(path),
            start_time_ns=now_ns,
            clock_offset_ns=self._clock.offset_ns,
            center_frequency_hz=math.nan,
            sample_rate_hz=math.nan,
            tags=tuple(tags),
        )
        among = flown is None and is_the_drones(self._directory)
        self._put(lambda writer: writer.begin(info, among_the_drones=among))
        self._path = path
        self._forget(path.name, now_ns)
        self.ended = False
        self.commit()
        return path.name

    def _is_taken(self, path: Path) -> bool:
        return path in self._begun or path.exists()

    def resume(self, flight_id: str) -> bool:
        """Continue with a flight after a restart; False when it is not there any more.

        It reads and writes where it is called: in the disk thread, where there is one.
        """
        path = self._directory / flight_id
        if Path(flight_id).name != flight_id:
            return False
        try:
            self._writer.go_on(path)
            with closing(open_plain(FlightLayout(path).database)) as database:
                (start_ns,) = database.execute("SELECT start_time_ns FROM flight").fetchone()
                self._forget(flight_id, start_ns)
                keys = database.execute("SELECT tag_id, start_time_ns FROM pulses")
                self._keys.update(keys.fetchall())
                self._told = ground_states_in(database)
        except (RecordingError, sqlite3.Error, TypeError) as error:
            log.warning("flight not resumed", flight=flight_id, reason=str(error))
            self._writer.end()
            self.flight_id = None
            return False
        self._path = path
        self.ended = False
        return True

    def load(self, columns: Columns) -> None:
        """Take the pulses and poses of a resumed flight in, for the estimates."""
        self._pulses = array("d", columns.pulses.T.ravel().tolist())
        self._poses = array("d", columns.poses.T.ravel().tolist())
        first_ns = min(columns.poses[0].tolist(), default=math.inf)
        self._takeoff = first_ns, columns.takeoff_amsl_m

    @property
    def stored(self) -> bool:
        """Whether every pulse that was taken is on the disk."""
        return not self._waiting

    @property
    def _waiting(self) -> int:
        return self._taken - self._durable

    def _store(self, item: Stored) -> None:
        """Take a pulse for the open flight; raises `RecordingError` where it cannot wait."""
        if self._path is None:
            raise RecordingError("no flight is open")
        if self._waiting >= MOST_WAITING:
            raise RecordingError(self.fault or "the disk is too slow for the pulses received")
        self._put(lambda writer: writer.store(item), counts=True)

    def _put(self, work: Callable[[FlightWriter], None], *, counts: bool = False) -> None:
        """Have the writer do something with the next commit."""
        self._taken += counts
        self._works.waiting.append((counts, work))

    def _record(self, write: Callable[[FlightRecorder], None]) -> None:
        """Write what no receipt waits for into the open flight."""
        if self._path is None:
            return
        if len(self._works.waiting) < MOST_WAITING + MOST_OTHERS:
            self._put(lambda writer: writer.record(write))
        else:
            self._left_out += 1
            log.seldom(self._left_out, "poses and notes discarded: the disk does not answer")

    def add_pulse(self, item: PulsePose) -> bool:
        """Add a pulse; False when it was here before.

        Raises `RecordingError`: it was not taken: too many wait for the disk.
        """
        key = item.pulse.key
        if key in self._keys:
            return False
        self._store(item)
        self._keys.add(key)
        self._early_s.pop(key, None)
        self._pulses.extend(pulse_cells(item))
        return True

    def put_inside(self, burst: BurstInside) -> bool:
        """Add its content to a burst of this flight; False if the burst is of another flight.

        Raises `RecordingError`: the content was not stored: its burst has not come yet, or the
        disk is too slow.
        """
        if burst.key in self._keys:
            self._store(burst)
            if burst.also_possible_tag_ids:
                self._doubt(burst)
            return True
        path, keys = self._before
        if path is not None and burst.key in keys:
            before = path
            self._put(lambda writer: writer.store_before(before, burst), counts=True)
            return False
        if len(self._early_s) >= MOST_EARLY:
            self._early_s.clear()
        now_s = monotonic_s()
        if now_s < self._early_s.setdefault(burst.key, now_s) + BURST_COMES_WITHIN_S:
            raise RecordingError("the burst that it belongs to has not come")
        del self._early_s[burst.key]
        self.without_burst += 1
        log.seldom(self.without_burst, "content of a burst discarded: its burst did not arrive")
        return False

    def _doubt(self, burst: BurstInside) -> None:
        """Let the estimates know whose else a burst may be."""
        cells = np.frombuffer(self._pulses, np.float64).reshape(-1, PULSE_WIDTH)
        named = {name: cells[:, place] for place, name in enumerate(PULSE_COLUMNS)}
        same = named["start_time_ns"] == float(burst.start_time_ns)
        same &= named["tag_id"] == burst.tag_id
        named["also_possible_tag_id"][same] = burst.also_possible_tag_ids[0]

    def add_pose(self, pose: Pose) -> None:
        """Add a pose of the vehicle."""
        if self._path is None or self.ended:
            return
        if 0 <= pose.time_ns - self._last_pose_ns < POSE_STEP_NS:
            return
        self._last_pose_ns = pose.time_ns
        if pose.time_ns < self._takeoff[0]:
            self._takeoff = pose.time_ns, pose.altitude_amsl_m - pose.altitude_relative_m
        self._record(lambda flight: flight.write_poses(Poses(poses=(pose,))))
        self._poses.extend(
            (
                pose.time_ns,
                pose.latitude_deg,
                pose.longitude_deg,
                pose.altitude_relative_m,
                *pose.quaternion_wxyz,
            )
        )

    def add_state(self, time_ns: int, armed: bool | None, landed: bool | None) -> None:
        """Add what the autopilot says of arming and landing; only changes are written."""
        if self._path is None or self.ended or not self._told.add(time_ns, armed, landed):
            return
        said = {ARMED: armed, LANDED: landed}
        counters = {name: float(one) for name, one in said.items() if one is not None}
        health = Health(
            process=GROUND_STATION, time_ns=time_ns, status="ready", ok=True, counters=counters
        )
        self._record(lambda flight: flight.write_health(health))

    def add_search_report(self, report: SearchReport) -> None:
        """Add what was searched in vain."""
        if not self.ended:
            self._record(lambda flight: flight.write_search_report(report))

    def correct_tags(self, tags: tuple[Tag, ...]) -> None:
        """Go on with other values of the flight's tags."""
        if not self.ended:
            self._record(lambda flight: flight.write_tags(tags))

    def add_beep(self, beep: Beep) -> None:
        """Add a measurement of a sender of pulses."""
        if not self.ended:
            self._record(lambda flight: flight.write_beep(beep))

    def add_text(self, severity: int, text: str, time_ns: int) -> None:
        """Add a text for the operator."""
        if not self.ended:
            said = StatusText(severity=severity, text=text)
            self._record(lambda flight: flight.write_status_text(said, time_ns))

    def add_note(self, text: str, time_ns: int) -> None:
        """Add a mark of the operator."""
        self._record(lambda flight: flight.write_note(text, time_ns))

    def columns(self) -> Columns:
        """Copy what is known of the flight, for another thread."""
        pulses = np.frombuffer(self._pulses, np.float64) if self._pulses else np.empty(0)
        poses = np.frombuffer(self._poses, np.float64) if self._poses else np.empty(0)
        return Columns(
            pulses=pulses.reshape(-1, PULSE_WIDTH).T.copy(),
            poses=poses.reshape(-1, POSE_WIDTH).T.copy(),
            on_ground_ns=self._told.spans(),
            takeoff_amsl_m=self._takeoff[1],
            goes_on=not self.ended,
        )

    def commit(self) -> None:
        """Bring everything to the disk; what it does not take waits, and `fault` says why."""
        fault = self.fault
        if fault is not None and not self._reported:
            log.warning("flight not written", reason=fault)
        self._reported = fault is not None
        if monotonic_s() >= self._retry_at_s:
            self._works.write()

    def _written(
        self, works: list[tuple[bool, Callable[[FlightWriter], None]]], written: Written
    ) -> None:
        """Count what the disk has now."""
        self._applied += sum(counts for counts, _ in works)
        if written.fault is None:
            self._durable = self._applied
        else:
            self._retry_at_s = monotonic_s() + RETRY_S
        self._error = written.fault
        self._mended = written.mended or self._mended
        self._on_written()

    def mended(self) -> str:
        """Get what was wrong with the flight's database and has been put right, once."""
        text, self._mended = self._mended, ""
        return text

    def close(self) -> None:
        """End the recording; what the disk does not take now is written by a later `commit`."""
        if self._path is not None:
            self._before = self._path, frozenset(self._keys)
            self._put(FlightWriter.end)
        self._path = None
        self.ended = True
        self._retry_at_s = 0.0
        self.commit()

    async def settle(self, within_s: float) -> None:
        """Wait until the disk has taken all, has refused it, or the time is over."""
        if self._works.waiting:
            self.commit()
        end_s = monotonic_s() + within_s
        while self._works.handed_s is not None and monotonic_s() < end_s:  # noqa: ASYNC110
            await asyncio.sleep(TURN_S)

    def _forget(self, flight_id: str, start_time_ns: int) -> None:
        self.flight_id, self.start_time_ns = flight_id, start_time_ns
        self._keys.clear()
        self._pulses, self._poses = array("d"), array("d")
        self._told = GroundStates()
        self._last_pose_ns = 0
        self._takeoff = math.inf, math.nan
