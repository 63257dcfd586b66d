"""The chain process runs the receiver and all detectors, for a computer with one core.

Receiver and detectors are the same as in separate processes, without sockets between them.
"""

from collections.abc import Mapping

from uavrt.core.messages import FlightInfo
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.drone.processes.detector import DetectorBank, Searcher
from uavrt.drone.processes.receiver import Receiver, run


class Chain(Receiver):
    """A receiver that passes its channels to detectors in the same process."""

    def __init__(self, frame: ProcessFrame, flight: FlightInfo) -> None:
        bank = DetectorBank(frame.assignment.tags, frame.assignment.settings.detection, flight)
        self._searcher = Searcher(frame, bank)
        super().__init__(frame, flight, [self._searcher])

    def close(self) -> None:
        """Search the samples not yet searched, and close the recording."""
        self._searcher.finish()
        super().close()

    def counters(self) -> Mapping[str, float]:
        """Counters of the receiver and the detectors, for the health report."""
        return {**self._searcher.counters(), **super().counters()}


def main() -> None:
    """Receive and detect until stopped."""
    run(Chain)


if __name__ == "__main__":
    main()
