"""The recorder process: pulses, poses and health into the flight directory.

A pulse with its pose is passed on to the connection only when it is safe on disk, so nothing
that was sent can be missing from the recording (DESIGN.md §2.7).
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from uavrt.errors import RecordingError
from uavrt.ipc import ProcessFrame
from uavrt.log import get_logger
from uavrt.messages import (
    Command,
    CommandReply,
    Delivered,
    FlightInfo,
    Health,
    Poses,
    Pulse,
    PulsePose,
    SearchReport,
    StatusText,
)
from uavrt.recording import FlightRecorder
from uavrt.recording.spool import note_deliveries

log = get_logger()

AFTER_ALL_NS = 2**63 - 1
ENDED_FLIGHTS = 3
"""Flights before the present one whose last pulses may still be on their way."""


class Recorder:
    """Writes each record where it belongs; between flights it writes nothing."""

    def __init__(self, frame: ProcessFrame) -> None:
        self._frame = frame
        self._flight: FlightRecorder | None = None
        self._commands: dict[int, Command] = {}
        self._fault = ""
        self._start_ns = AFTER_ALL_NS
        last = map(Path, frame.assignment.last_flights)
        self._ended: deque[Path] = deque(last, maxlen=ENDED_FLIGHTS)
        self._newest_ns = 0

    def open(self, info: FlightInfo) -> None:
        """Open a flight, new or begun before a restart."""
        if self._flight is not None and self._flight.layout.root == Path(info.directory):
            return
        self.close()
        # A wall clock set back between flights: then any key may be of an earlier one.
        back = info.start_time_ns < self._newest_ns
        self._start_ns = AFTER_ALL_NS if back else info.start_time_ns
        try:
            self._flight = FlightRecorder.open(info, self._frame.assignment.settings)
        except RecordingError as error:
            self._complain(error)

    def close(self) -> None:
        """Close the flight."""
        if self._flight is None:
            return
        try:
            self._flight.close()
        except RecordingError as error:
            self._complain(error)
        self._ended.append(self._flight.layout.root)
        self._newest_ns = max(self._newest_ns, self._frame.clock.now_ns())
        self._flight = None
        self._start_ns = AFTER_ALL_NS

    def take(self, records: list[tuple[str, object]]) -> None:
        """Write records, commit once, then pass the recorded pulses on."""
        recorded: list[PulsePose] = []
        for topic, record in records:
            match record:
                case Delivered():
                    self._delivered(record)
                case FlightInfo() if topic == "flight":
                    self.open(record)
                case FlightInfo():
                    self.close()
                case PulsePose():
                    recorded.append(record)
                    self._write(record)
                case _:
                    self._write(record)
        self._commit()
        # Also what could not be written: the flight goes on, and it waits in memory.
        for pulse_pose in recorded:
            self._frame.send("recorded_pulse_pose", pulse_pose)

    def _delivered(self, record: Delivered) -> None:
        """Note what reached the ground, also of flights that have ended."""
        if self._flight is not None:
            self._flight.write_delivered(record)
        earlier = tuple(key for key in record.pulses if key[1] < self._start_ns)
        for directory in self._ended if earlier else ():
            try:
                note_deliveries(directory, replace(record, pulses=earlier))
            except RecordingError as error:
                log.warning("delivery not noted", reason=str(error))

    def _write(self, record: object) -> None:
        if isinstance(record, Command):
            self._commands[record.request_id] = record
        flight = self._flight
        if flight is None:
            return
        now_ns = self._frame.clock.now_ns()
        match record:
            case Pulse():
                flight.write_pulses([record])
            case PulsePose():
                flight.write_pulse_poses([record])
            case Poses():
                flight.write_poses(record)
            case Health():
                flight.write_health(record)
            case StatusText():
                flight.write_status_text(record, now_ns)
            case SearchReport():
                flight.write_search_report(record)
            case CommandReply():
                command = self._commands.pop(record.request_id, None)
                if command is not None:
                    flight.write_command(command, record, now_ns)

    def _commit(self) -> None:
        """Make what was written safe; a full disk is reported, never fatal."""
        if self._flight is None:
            return
        try:
            self._flight.commit()
        except RecordingError as error:
            self._complain(error)
        else:
            self._fault = ""

    def _complain(self, error: RecordingError) -> None:
        """Say it once until it is mended."""
        if not self._fault:
            log.error("not recorded", reason=str(error))
        self._fault = str(error)

    def report(self) -> None:
        """Send the health."""
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
            "pulses_recorded": flight.committed_pulses,
            "pulses_repeated": flight.repeated_pulses,
            "records_waiting": flight.waiting_records,
            "records_dropped": flight.dropped_records,
            "records_refused": flight.refused_records,
            "commits_failed": flight.failed_commits,
        }


def main() -> None:
    """Record until told to end."""
    with ProcessFrame.start() as frame:
        recorder = Recorder(frame)
        if frame.assignment.flight is not None:
            recorder.open(frame.assignment.flight)
        while frame.running:
            recorder.take(frame.receive(timeout_s=0.25))
            recorder.report()
        recorder.take(frame.receive())
        recorder.close()


if __name__ == "__main__":
    main()
