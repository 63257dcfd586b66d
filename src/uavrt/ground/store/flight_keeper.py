"""The ground's own flight recording: start, resume after a restart, end."""

import math
import sqlite3
from array import array
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

import numpy as np

from uavrt.clock import Clock, monotonic_s
from uavrt.errors import RecordingError
from uavrt.ground.store.beside_drone import is_the_drones
from uavrt.ground.store.flights import PULSE_COLUMNS, Columns, pulse_cells
from uavrt.log import get_logger
from uavrt.messages import (
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
from uavrt.on_ground import ARMED, GROUND_STATION, LANDED, ToldStates
from uavrt.recording import (
    GROUND_NOTE,
    FlightLayout,
    FlightRecorder,
    copy_beside,
    new_flight_directory,
    note_flight,
    open_plain,
    told_in,
)

log = get_logger()

POSE_STEP_NS = 190_000_000
"""Poses are kept five times a second at most: 36 000 in two hours."""
MOST_WAITING = 10_000
"""Pulses that wait in memory for a disk that fails. More stay with the drone, which sends again
what is not acknowledged."""
RETRY_S = 1.0
"""Between two tries of a disk that fails."""
BURST_COMES_WITHIN_S = 60.0
"""Longest wait for a burst whose content came first [s]; each is sent until acknowledged. A
burst that does not come belongs to a flight that this ground station does not have."""
MOST_EARLY = 1000
"""Most bursts whose content is kept waiting."""
PULSE_WIDTH = len(PULSE_COLUMNS)
POSE_WIDTH = 8


class FlightKeeper:
    """Writes everything that is received into a flight directory of the ground's own.

    Parameters
    ----------
    directory : Path
        Where flights are made.
    clock : Clock
        The ground's clock.
    """

    def __init__(self, directory: Path, clock: Clock) -> None:
        self._directory = directory
        self._clock = clock
        self._recorder: FlightRecorder | None = None
        self._ending: list[FlightRecorder] = []
        """Of flights that are over, and that the disk has not taken whole."""
        self._retry_at_s = 0.0
        self._before: tuple[Path | None, frozenset[tuple[int, int]]] = (None, frozenset())
        self._keys: set[tuple[int, int]] = set()
        self._early_s: dict[tuple[int, int], float] = {}
        """Bursts that have not come, and the time at which their content first came [s]."""
        self.without_burst = 0
        """Contents discarded because their burst did not come."""
        self._pulses = array("d")
        self._poses = array("d")
        self._told = ToldStates()
        self._last_pose_ns = 0
        self.flight_id: str | None = None
        self.start_time_ns = 0
        self.ended = True
        self.fault: str | None = None
        """Why the last commit failed, None when all is on the disk."""

    @property
    def pulses(self) -> int:
        """Different pulses of this flight."""
        return len(self._keys)

    def begin(self, tags: Iterable[Tag], flown: Path | None = None) -> str:
        """Begin a flight; gives its name.

        Parameters
        ----------
        tags : iterable of Tag
            That are searched for.
        flown : Path, optional
            The drone's own recording of it in the same directory: ours is a copy of that.
        """
        self.close()
        now_ns = self._clock.now_ns()
        if flown is None:
            path = new_flight_directory(self._directory, now_ns)
        else:
            path = copy_beside(flown)
        info = FlightInfo(
            directory=str(path),
            start_time_ns=now_ns,
            clock_offset_ns=self._clock.offset_ns,
            center_frequency_hz=math.nan,
            sample_rate_hz=math.nan,
            tags=tuple(tags),
        )
        self._recorder = FlightRecorder.open(info, durable=True)
        if flown is None and is_the_drones(self._directory):
            self._note(path)
        self._forget(path.name, now_ns)
        self.ended = False
        self._recorder.write_note(GROUND_NOTE, now_ns)
        self.commit()
        return path.name

    @staticmethod
    def _note(flight: Path) -> None:
        """Note among the drone's flights that another's begins: it is none of the oldest."""
        try:
            note_flight(flight)
        except OSError as error:
            log.warning("order of flights not noted", reason=str(error))

    def resume(self, flight_id: str) -> bool:
        """Continue with a flight after a restart; False when it is not there any more."""
        path = self._directory / flight_id
        if Path(flight_id).name != flight_id:
            return False
        try:
            self._recorder = FlightRecorder.reopen(path, durable=True)
            with closing(open_plain(FlightLayout(path).database)) as database:
                (start_ns,) = database.execute("SELECT start_time_ns FROM flight").fetchone()
                self._forget(flight_id, start_ns)
                keys = database.execute("SELECT tag_id, start_time_ns FROM pulses")
                self._keys.update(keys.fetchall())
                self._told = told_in(database)
        except (RecordingError, sqlite3.Error, TypeError) as error:
            log.warning("flight not resumed", flight=flight_id, reason=str(error))
            self._recorder = self.flight_id = None
            return False
        self.ended = False
        return True

    def load(self, columns: Columns) -> None:
        """Take the pulses and poses of a resumed flight in, for the estimates."""
        self._pulses = array("d", columns.pulses.T.ravel().tolist())
        self._poses = array("d", columns.poses.T.ravel().tolist())

    @property
    def stored(self) -> bool:
        """Whether every pulse that was taken is on the disk."""
        return not self._waiting()

    def _waiting(self) -> int:
        current = () if self._recorder is None else (self._recorder,)
        return sum(recorder.waiting_pulses for recorder in (*self._ending, *current))

    def _room(self) -> FlightRecorder:
        """Get the recorder for one more pulse; raises `RecordingError` where it cannot wait."""
        if self._recorder is None:
            raise RecordingError("no flight is open")
        if self._waiting() >= MOST_WAITING:
            raise RecordingError(self.fault or "the disk is too slow for the pulses received")
        return self._recorder

    def add_pulse(self, item: PulsePose) -> bool:
        """Add a pulse; False when it was here before.

        Raises
        ------
        RecordingError
            It was not taken: too many wait for the disk.
        """
        key = item.pulse.key
        if key in self._keys:
            return False
        self._room().write_pulse_poses([item])
        self._keys.add(key)
        self._early_s.pop(key, None)
        self._pulses.extend(pulse_cells(item))
        return True

    def put_inside(self, burst: BurstInside) -> bool:
        """Add its content to a burst of this flight; False if the burst is of another flight.

        Raises
        ------
        RecordingError
            The content was not stored: its burst has not come yet, or the disk is too slow.
        """
        if burst.key in self._keys:
            self._room().write_inside(burst)
            if burst.also_possible_tag_ids:
                self._doubt(burst)
            return True
        path, keys = self._before
        if path is not None and burst.key in keys:
            recorder = FlightRecorder.reopen(path, durable=True)
            recorder.write_inside(burst)
            self._ending.append(recorder)
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
        if self._recorder is None or self.ended:
            return
        if 0 <= pose.time_ns - self._last_pose_ns < POSE_STEP_NS:
            return
        self._last_pose_ns = pose.time_ns
        self._recorder.write_poses(Poses(poses=(pose,)))
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
        if self._recorder is None or self.ended or not self._told.add(time_ns, armed, landed):
            return
        said = {ARMED: armed, LANDED: landed}
        counters = {name: float(one) for name, one in said.items() if one is not None}
        self._recorder.write_health(
            Health(
                process=GROUND_STATION,
                time_ns=time_ns,
                status="ready",
                ok=True,
                counters=counters,
            )
        )

    def add_search_report(self, report: SearchReport) -> None:
        """Add what was searched in vain."""
        if self._recorder is not None and not self.ended:
            self._recorder.write_search_report(report)

    def add_text(self, severity: int, text: str, time_ns: int) -> None:
        """Add a text for the operator."""
        if self._recorder is not None and not self.ended:
            self._recorder.write_status_text(StatusText(severity=severity, text=text), time_ns)

    def add_note(self, text: str, time_ns: int) -> None:
        """Add a mark of the operator."""
        if self._recorder is not None:
            self._recorder.write_note(text, time_ns)

    def columns(self) -> Columns:
        """Copy what is known of the flight, for another thread."""
        pulses = np.frombuffer(self._pulses, np.float64) if self._pulses else np.empty(0)
        poses = np.frombuffer(self._poses, np.float64) if self._poses else np.empty(0)
        return Columns(
            pulses=pulses.reshape(-1, PULSE_WIDTH).T.copy(),
            poses=poses.reshape(-1, POSE_WIDTH).T.copy(),
            on_ground_ns=self._told.spans(),
        )

    def commit(self) -> None:
        """Bring everything to the disk; what it does not take waits, and `fault` says why."""
        now_s = monotonic_s()
        if now_s < self._retry_at_s:
            return
        try:
            if self._recorder is not None:
                self._recorder.commit()
            while self._ending:
                self._ending[0].close()
                del self._ending[0]
            self.fault = None
        except RecordingError as error:
            self._retry_at_s = now_s + RETRY_S
            if self.fault is None:
                log.warning("flight not written", reason=str(error))
            self.fault = str(error)

    def mended(self) -> str:
        """Get what was wrong with the flight's database and has been put right, once."""
        text = "" if self._recorder is None else self._recorder.mended
        if self._recorder is not None:
            self._recorder.mended = ""
        return text

    def close(self) -> None:
        """End the recording; what the disk does not take now is written by a later `commit`."""
        if self._recorder is not None:
            self._before = self._recorder.layout.root, frozenset(self._keys)
            self._ending.append(self._recorder)
        self._recorder = None
        self.ended = True
        self._retry_at_s = 0.0
        self.commit()

    def _forget(self, flight_id: str, start_time_ns: int) -> None:
        self.flight_id, self.start_time_ns = flight_id, start_time_ns
        self._keys.clear()
        self._pulses, self._poses = array("d"), array("d")
        self._told = ToldStates()
        self._last_pose_ns = 0
