"""Write the flights that a ground station receives; runs in the disk thread."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from uavrt.core.errors import RecordingError
from uavrt.core.log import get_logger
from uavrt.core.messages import BurstInside, FlightInfo, PulsePose
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_order import note_flight
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.reading.noted_places import GROUND_NOTE

log = get_logger()

Stored = PulsePose | BurstInside


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """Result of one batch of writes to the disk."""

    fault: str | None
    """Reason why flight data is not on the disk; None if all of it is."""
    mended: str
    """Fault of the flight's database that was repaired; empty without one."""


class FlightWriter:
    """Writes the flight in progress, and earlier flights that are not completely on disk.

    `also`: called with each written item before the flight is committed; if it raises
    `RecordingError`, the flight waits and the call is repeated later.
    """

    def __init__(self, also: Callable[[Stored], object]) -> None:
        self._also = also
        self._flight: FlightRecorder | None = None
        self._ending: list[FlightRecorder] = []
        self._listed: deque[Stored] = deque()
        """Written pulses and bursts that the callback `also` has not accepted yet."""
        self._discarded = 0

    def begin(self, info: FlightInfo, *, among_the_drones: bool) -> None:
        """Begin a flight; `among_the_drones`: add it to the drone's order of flights."""
        self._flight = FlightRecorder.open(info, durable=True)
        self._flight.write_note(GROUND_NOTE, info.start_time_ns)
        if among_the_drones:
            try:
                note_flight(Path(info.directory))
            except OSError as error:
                log.warning(
                    "cannot write the list of flights in the order of recording",
                    reason=str(error),
                )

    def go_on(self, path: Path) -> None:
        """Continue a flight after a restart; raises `RecordingError` if that is impossible."""
        self._flight = FlightRecorder.reopen(path, durable=True)

    def record(self, write: Callable[[FlightRecorder], None]) -> None:
        """Write a record into the flight in progress."""
        if self._flight is not None:
            write(self._flight)

    def store(self, item: Stored) -> None:
        """Write a pulse, or the pulse times of a burst, into the flight in progress."""
        assert self._flight is not None
        if isinstance(item, PulsePose):
            self._flight.write_pulses([item])
        else:
            self._flight.write_inside(item)
        self._listed.append(item)

    def store_before(self, path: Path, burst: BurstInside) -> None:
        """Write a burst's pulse times into an earlier flight, unless it was removed."""
        if not FlightLayout(path).database.exists():
            self._discarded += 1
            log.seldom(
                self._discarded,
                "pulse times of a burst were discarded, because its flight was removed",
            )
            return
        recorder = FlightRecorder(path, durable=True)
        recorder.write_inside(burst)
        self._ending.append(recorder)
        self._listed.append(burst)

    def end(self) -> None:
        """End the flight in progress; the next `write` closes its files."""
        if self._flight is not None:
            self._ending.append(self._flight)
        self._flight = None

    def write(self, works: list[tuple[bool, Callable[["FlightWriter"], None]]]) -> Written:
        """Run the queued writes and those that failed before, and make them durable."""
        for _, work in works:
            work(self)
        fault = None
        try:
            while self._listed:
                self._also(self._listed[0])
                self._listed.popleft()
            if self._flight is not None:
                self._flight.commit()
            while self._ending:
                self._ending[0].close()
                del self._ending[0]
        except RecordingError as error:
            fault = str(error)
        mended = ""
        if self._flight is not None:
            mended, self._flight.mended = self._flight.mended, ""
        return Written(fault=fault, mended=mended)
