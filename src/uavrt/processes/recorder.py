"""The recorder process: pulses, poses and health into the flight directory.

A pulse with its pose is passed on to the connection only when it is safe on disk, so nothing
that was sent can be missing from the recording (DESIGN.md §2.7).
"""

from collections.abc import Mapping
from pathlib import Path

from uavrt.errors import RecordingError
from uavrt.ipc import ProcessFrame
from uavrt.log import get_logger
from uavrt.messages import (
    Command,
    CommandReply,
    FlightInfo,
    Health,
    Poses,
    Pulse,
    PulsePose,
    SearchReport,
    StatusText,
)
from uavrt.recording import FlightRecorder

log = get_logger()


class Recorder:
    """Writes each record where it belongs; between flights it writes nothing."""

    def __init__(self, frame: ProcessFrame) -> None:
        self._frame = frame
        self._flight: FlightRecorder | None = None
        self._counters: dict[str, float] = {}

    def open(self, info: FlightInfo) -> None:
        """Open a flight, new or begun before a restart."""
        if self._flight is not None and self._flight.directory == Path(info.directory):
            return
        self.close()
        try:
            self._flight = FlightRecorder.open(Path(info.directory), info)
        except RecordingError as error:
            log.error("flight not recorded", reason=str(error))

    def close(self) -> None:
        """Close the flight."""
        if self._flight is not None:
            self._counters = dict(self._flight.counters)
            self._flight.close()
            self._flight = None

    def take(self, records: list[tuple[str, object]]) -> None:
        """Write records, commit once, then pass the recorded pulses on."""
        recorded: list[PulsePose] = []
        for topic, record in records:
            match record:
                case FlightInfo():
                    self.commit()
                    self.open(record) if topic == "flight" else self.close()
                case PulsePose():
                    recorded.append(record)
                    self._write(record)
                case _:
                    self._write(record)
        self.commit()
        for pulse_pose in recorded:
            self._frame.send("recorded_pulse_pose", pulse_pose)

    def _write(self, record: object) -> None:
        flight = self._flight
        if flight is None:
            return
        match record:
            case Pulse():
                flight.write_pulses([record])
            case PulsePose():
                flight.write_pulse_poses([record])
            case Poses():
                flight.write_poses(record.poses)
            case Health():
                flight.write_health(record)
            case StatusText():
                flight.write_status_text(record, self._frame.clock.now_ns())
            case SearchReport() | Command() | CommandReply():
                flight.write_event(record, self._frame.clock.now_ns())

    def commit(self) -> None:
        """Make what was written safe; a full disk is reported, never fatal."""
        if self._flight is not None:
            self._flight.commit()

    def status(self) -> tuple[str, bool]:
        """Get a word for the operator, and whether all is well."""
        if self._flight is None:
            return "idle", True
        return ("recording", True) if self._flight.healthy else ("disk full or gone", False)

    def counters(self) -> Mapping[str, float]:
        """Count what was written and what could not be."""
        return self._flight.counters if self._flight is not None else self._counters


def main() -> None:
    """Record until told to end."""
    with ProcessFrame.start() as frame:
        recorder = Recorder(frame)
        if frame.assignment.flight is not None:
            recorder.open(frame.assignment.flight)
        while frame.running:
            recorder.take(frame.receive(timeout_s=0.25))
            status, ok = recorder.status()
            frame.report(status, ok=ok, counters=recorder.counters)
        recorder.take(frame.receive())
        recorder.close()


if __name__ == "__main__":
    main()
