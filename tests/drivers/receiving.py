"""As much of a process as a receiver needs, and a detector that takes every sample."""

from typing import Any

from uavrt.config.settings import RecordingSettings, Settings
from uavrt.core.messages import FlightInfo
from uavrt.drone.ipc.tag_assignment import Assignment
from uavrt.drone.processes.receiver import Receiver


class Sink:
    """A detector that takes everything."""

    samples_dropped = 0

    def send(self, block: object) -> None:
        """Take it."""

    def flush(self) -> None:
        """Nothing waits."""


class Frame:
    """Keeps what a receiver reports of beeps, and its texts for the operator.

    `flight`: whose tags all go to the first worker unless `worker_of_tag` says otherwise.
    """

    def __init__(
        self,
        flight: FlightInfo,
        recording: RecordingSettings,
        worker_of_tag: dict[int, int] | None = None,
    ) -> None:
        self.texts: list[str] = []
        self.beeps: list[Any] = []
        self.flight = flight
        self.assignment = Assignment(
            process="receiver",
            settings=Settings(recording=recording),
            clock_offset_ns=0,
            flight=flight,
            worker_of_tag=worker_of_tag or {tag.tag_id: 0 for tag in flight.tags},
        )

    def notify(self, severity: int, text: str) -> None:
        """Keep a text for the operator."""
        self.texts.append(text)

    def send(self, topic: str, record: object) -> None:
        """Keep what beeps."""
        assert topic == "beep", record
        self.beeps.append(record)


def receiving(
    flight: FlightInfo, recording: RecordingSettings, kind: type[Receiver] = Receiver
) -> tuple[Receiver, Frame]:
    """Make a receiver whose detector takes everything."""
    frame: Any = Frame(flight, recording)
    detector: Any = Sink()
    return kind(frame, flight, [detector]), frame
