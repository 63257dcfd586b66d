"""The recorder process: writes all records of a flight to the flight's directory.

The process commits rarely to spare the disk, and reports a pulse as *recorded* once it is on
disk. After a kill, uncommitted records are sent again to the next recorder, so nothing is lost.
A pulse whose pose never arrives gets one from recorded poses, or none.
"""

from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import RecordingError
from uavrt.core.log import get_logger
from uavrt.core.messages import (
    Beep,
    Command,
    CommandReply,
    Delivered,
    FlightInfo,
    Health,
    Poses,
    Pulse,
    PulseKey,
    PulsePose,
    Recorded,
    RecordsHandled,
    SearchNote,
    SearchReport,
    StatusText,
)
from uavrt.core.newest import Newest
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.drone.ipc.record_link import SupervisorGone
from uavrt.drone.processes.recording.commit_times import CommitTimes
from uavrt.drone.processes.recording.health_filter import HealthFilter
from uavrt.drone.processes.recording.missing_poses import (
    REACH_NS,
    AwaitedPoses,
    pose_from_records,
)
from uavrt.flight.database.spool import note_deliveries
from uavrt.flight.database.writer_lock import WriterLock
from uavrt.flight.flight_recorder import FlightRecorder

log = get_logger()

TURN_S = 0.25
NO_TIME_LIMIT_NS = 2**63 - 1
ENDED_FLIGHTS = 3
"""Number of earlier flights that are still checked for undelivered pulses."""
POSE_TIMEOUT_S = 7.0
"""Time after `AntennaSettings.pose_wait_s` from which a pulse's pose counts as lost [s]. A
connection process that hangs is killed after 5 s, and restarted within 2 s."""
MOST_READ_AT_ONCE = 1_000
"""Most pulses without pose read from the database in one query."""
MOST_TO_REPORT = 100_000
"""Largest number of pulses whose report as recorded waits while the disk fails."""
MOST_COMMANDS = 64
LOCK_WAIT_S = 3.0
DISK_CHECK_S = 2.0
"""Time between two disk checks [s]; they find a fault earlier than the next commit would."""
REPORT_PERIOD_S = 30.0
"""Shortest time between two texts to the operator about lost poses [s]."""


class Recorder:
    """Writes the records of the present flight to its directory; ignores others."""

    def __init__(self, frame: ProcessFrame) -> None:
        self._frame = frame
        self._antenna = frame.assignment.settings.antenna
        self._flight: FlightRecorder | None = None
        self._lock = WriterLock()
        self._times = CommitTimes()
        self._health = HealthFilter()
        self._awaited = AwaitedPoses(self._antenna.pose_wait_s + POSE_TIMEOUT_S)
        self._more_missing = False
        self._to_report: deque[PulseKey] = deque(maxlen=MOST_TO_REPORT)
        """Pulses written to disk but not yet reported as recorded."""
        # Some replies never come.
        self._commands: Newest[int, Command] = Newest(MOST_COMMANDS)
        self._fault = ""
        self._reported_lines = 0
        self._start_ns = NO_TIME_LIMIT_NS
        last = map(Path, frame.assignment.last_flights)
        self._ended: deque[Path] = deque(last, maxlen=ENDED_FLIGHTS)
        self._unchecked: deque[Path] = deque(self._ended)
        self._newest_ns = 0
        self._poses_made_up = self._without_pose = self._unreported = 0
        self._report_at_s = self._disk_check_s = 0.0

    def open(self, info: FlightInfo) -> None:
        """Open a new flight, or continue one after a restart of this process."""
        root = Path(info.directory)
        if self._flight is not None and self._flight.layout.root == root:
            return
        self.close()
        # If the clock was set back between flights, keys can equal those of an earlier one.
        back = info.start_time_ns < self._newest_ns
        self._start_ns = NO_TIME_LIMIT_NS if back else info.start_time_ns
        if not self._lock.take(root, LOCK_WAIT_S):
            log.warning("flight directory is locked; recording goes on", flight=str(root))
        try:
            self._flight = FlightRecorder.open(
                info, self._frame.assignment.settings, durable=True
            )
        except RecordingError as error:
            self._report_fault(error)
        self._disk_check_s = 0.0
        self._find_missing_poses()

    def close(self) -> None:
        """Close the flight, after reconstructing the poses that are still missing."""
        flight = self._flight
        if flight is None:
            return
        self._reconstruct(self._awaited.all())
        flight.write(*self._health.last())
        try:
            flight.close()
        except RecordingError as error:
            self._report_fault(error)
        else:
            self._report_recorded()
        self._to_report.clear()
        self._times.committed(monotonic_s())
        self._ended.append(flight.layout.root)
        self._newest_ns = max(self._newest_ns, self._frame.clock.now_ns())
        self._flight = None
        self._lock.release()
        self._start_ns = NO_TIME_LIMIT_NS

    def _check_an_ended_flight(self) -> None:
        """Reconstruct missing poses in the next earlier flight that is not yet checked."""
        if not self._unchecked:
            return
        root = self._unchecked.popleft()
        if self._flight is not None and self._flight.layout.root == root:
            return
        lock = WriterLock()
        if not root.is_dir() or not lock.take(root, 0.0):
            return
        try:
            flight = FlightRecorder.reopen(root)
            while pulses := flight.database.without_pose(MOST_READ_AT_ONCE):
                flight.write_pulses(found := self._posed(flight, pulses))
                flight.commit()
                self._pass_on(found)
            flight.close()
        except RecordingError as error:
            log.warning("cannot write the last pulses of an ended flight", reason=str(error))
        finally:
            lock.release()

    def turn(self, records: list[tuple[str, object]]) -> None:
        """Write the received records; commit if it is time, else use the pause for checks."""
        for topic, record in records:
            match record:
                case Delivered():
                    self._delivered(record)
                case FlightInfo() if topic == "flight":
                    self.open(record)
                case FlightInfo() if topic == "corrected_tags":
                    self._correct_tags(record)
                case FlightInfo():
                    self.close()
                case _:
                    self._write(record)
        now_s = monotonic_s()
        self._reconstruct(self._awaited.overdue(now_s))
        if self._flight is None:
            self._report_taken()
            if not records:
                self._check_an_ended_flight()
        elif self._times.all_due(now_s):
            if self._commit():
                self._report_taken()
        elif self._times.pulses_due(now_s):
            self._commit(pulses_only=True)
        elif now_s >= self._disk_check_s:
            self._disk_check_s = now_s + DISK_CHECK_S
            if self._flight.is_suspect():
                self._commit()
        elif not records:
            if self._more_missing and not self._awaited:
                self._find_missing_poses()
            self._check_an_ended_flight()
        self._report_lost_poses(now_s)

    def _delivered(self, record: Delivered) -> None:
        if self._flight is not None:
            self._flight.write_delivered(record)
            # Committed with the next pulses or other records, never alone.
            self._times.others_wait(monotonic_s())
        earlier = tuple(key for key in record.pulses if key[1] < self._start_ns)
        for directory in self._ended if earlier else ():
            try:
                note_deliveries(directory, replace(record, pulses=earlier))
            except RecordingError as error:
                log.warning("cannot store which pulses were delivered", reason=str(error))

    def _write(self, record: object) -> None:
        if isinstance(record, Command):
            self._commands[record.request_id] = record
        flight = self._flight
        if flight is None:
            return
        now_s, now_ns = monotonic_s(), self._frame.clock.now_ns()
        match record:
            case Pulse():
                flight.write_pulses([record])
                self._awaited.add(record, now_s)
                self._times.pulses_wait(now_s)
                return
            case PulsePose():
                self._reconstruct(self._awaited.pose_arrived(record.pulse))
                self._take_pulse_poses([record])
                return
            case Poses():
                flight.write(*record.poses)
            case Health():
                flight.write(*self._health.to_record(record))
            case StatusText():
                flight.write_status_text(record, now_ns)
            case SearchReport() | Beep() | SearchNote():
                flight.write(record)
            case CommandReply():
                command = self._commands.pop(record.request_id, None)
                if command is not None:
                    flight.write_command(command, record, now_ns)
        self._times.others_wait(now_s)

    def _correct_tags(self, flight: FlightInfo) -> None:
        if self._flight is not None and self._flight.layout.root == Path(flight.directory):
            self._flight.write(*flight.tags)
            self._times.others_wait(monotonic_s())

    def _take_pulse_poses(self, pulse_poses: list[PulsePose]) -> None:
        if self._flight is not None:
            self._flight.write_pulses(pulse_poses)
            self._to_report.extend(one.pulse.key for one in pulse_poses)
            self._times.pulses_wait(monotonic_s())

    def _find_missing_poses(self) -> None:
        if self._flight is None:
            return
        found = self._flight.database.without_pose(MOST_READ_AT_ONCE)
        self._more_missing = len(found) == MOST_READ_AT_ONCE
        for pulse in found:
            self._awaited.add(pulse, monotonic_s())

    def _reconstruct(self, pulses: list[Pulse]) -> None:
        flight = self._flight
        if flight is None or not pulses:
            return
        self._commit()  # also the poses that will be looked for
        found = self._posed(flight, pulses)
        self._take_pulse_poses(found)
        self._pass_on(found)

    def _posed(self, flight: FlightRecorder, pulses: list[Pulse]) -> list[PulsePose]:
        found = [
            pose_from_records(
                pulse,
                flight.database.poses_around(
                    (pulse.start_time_ns + pulse.end_time_ns) // 2, REACH_NS
                ),
                self._antenna,
            )
            for pulse in pulses
        ]
        without = sum(one.pose is None for one in found)
        self._without_pose += without
        self._poses_made_up += len(found) - without
        self._unreported += len(found)
        return found

    def _pass_on(self, pulse_poses: list[PulsePose]) -> None:
        for pulse_pose in pulse_poses:
            self._frame.send("pulse_pose", pulse_pose)

    def _report_lost_poses(self, now_s: float) -> None:
        if not self._unreported or now_s < self._report_at_s:
            return
        self._report_at_s = now_s + REPORT_PERIOD_S
        self._unreported = 0
        self._frame.notify(
            5,
            f"Poses lost between processes: {self._poses_made_up} reconstructed, "
            f"{self._without_pose} pulses have none",
        )

    def _commit(self, *, pulses_only: bool = False) -> bool:
        if self._flight is None:
            return True
        now_s = monotonic_s()
        try:
            self._flight.commit(pulses_only=pulses_only)
        except RecordingError as error:
            self._times.failed(now_s)
            self._report_fault(error)
            return False
        self._fault = ""
        if self._flight.mended:
            self._frame.notify(3, f"Recorder: {self._flight.mended}")
            self._flight.mended = ""
        self._times.committed(now_s, pulses_only=pulses_only)
        self._report_recorded()
        return True

    def _report_recorded(self) -> None:
        if self._to_report:
            self._frame.send("recorded", Recorded(pulses=tuple(self._to_report)))
            self._to_report.clear()

    def _report_taken(self) -> None:
        """Report to the supervisor how many records were handled, once they are committed."""
        lines = self._frame.link.lines
        if lines != self._reported_lines:
            self._reported_lines = lines
            self._frame.link.send("records_handled", RecordsHandled(records=lines))

    def _report_fault(self, error: RecordingError) -> None:
        if not self._fault:
            log.error(
                "cannot write the flight; records wait in memory",
                reason=str(error),
            )
        self._fault = str(error)

    def end(self) -> None:
        """Write the records received so far, and close the flight."""
        with suppress(SupervisorGone):
            while records := self._frame.receive():
                self.turn(records)
        self._commit()
        with suppress(SupervisorGone):
            self.close()
            self._report_taken()

    def report(self) -> None:
        """Send a health report if due, with the status recording, idle or unable to write."""
        status = "idle" if self._flight is None else "recording"
        self._frame.report(
            "cannot write the flight" if self._fault else status,
            ok=not self._fault,
            counters=self._counters,
        )

    def _counters(self) -> Mapping[str, float]:
        flight = self._flight
        if flight is None:
            return {}
        return {
            "pulses_recorded": flight.database.committed_pulses,
            "pulses_repeated": flight.database.repeated_pulses,
            "pulses_without_pose": self._without_pose,
            "poses_made_up": self._poses_made_up,
            "poses_awaited": len(self._awaited),
            "health_left_out": self._health.left_out,
            "records_waiting": flight.waiting_records,
            "records_dropped": flight.dropped_records,
            "records_refused": flight.database.refused_records,
            "commits_failed": flight.failed_commits,
            "disk_syncs": flight.database.syncs,
        }


def main() -> None:
    """Record flights until stopped."""
    with ProcessFrame.start(finishes=True) as frame:
        recorder = Recorder(frame)
        try:
            if frame.assignment.flight is not None:
                recorder.open(frame.assignment.flight)
            while frame.running:
                recorder.turn(frame.receive(timeout_s=TURN_S))
                recorder.report()
        finally:
            recorder.end()


if __name__ == "__main__":
    main()
