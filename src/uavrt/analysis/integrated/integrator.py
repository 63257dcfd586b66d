"""Process that finds tags too weak for the detectors while the drone is still flying.

It reads the recorded radio channels and searches all samples so far for one tag after another.
It writes the results into the flight's directory as ``uavrt integrate`` does, and reports tags
that it finds to the ground. It runs at the lowest priority and uses a tenth of a core.
"""

import os
import queue
import threading
from collections.abc import Sequence
from pathlib import Path

from uavrt.analysis.integrated.flight_so_far import FlightSoFar, found_in_flight
from uavrt.analysis.integrated.hindsight import save_integrated
from uavrt.analysis.whole_flights.judged_flights import IntegratedTag, WholeFlightOptions
from uavrt.config.settings import Settings
from uavrt.core.clock import cpu_s, monotonic_s
from uavrt.core.errors import UavrtError, UsageError
from uavrt.core.log import get_logger
from uavrt.core.messages import FlightInfo, Tag
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.localization.antenna import pattern_named
from uavrt.localization.terrain.elevation import Elevation
from uavrt.localization.terrain.elevation_files import open_elevation
from uavrt.localization.whole_flight.tuning import ENERGY

log = get_logger()

NICENESS = 15
"""Unix nice level of the integrator's process, a lower priority than that of detectors and
estimator."""
TICK_S = 0.5
SHARE = 9.0
"""Ratio of the integrator's idle time to its working time; with 9 it uses a tenth of a core."""
RETRY_S = 5.0
"""Pause before a tag without new samples is searched for again [s]."""
FEW_PULSES = 3
"""Number of pulses confirmed in flight from which a tag need not be reported by this search."""
CLOSER = 0.5
"""Share of the reported radius below which a position is reported again."""


class SearchSchedule:
    """Schedule that decides which tag to search for next, and when."""

    def __init__(self, tags: Sequence[Tag]) -> None:
        self._due_s = dict.fromkeys((tag.tag_id for tag in tags), 0.0)
        self._tags = {tag.tag_id: tag for tag in tags}
        self._rest_until_s = 0.0

    def due(self, now_s: float) -> Tag | None:
        """Tag that has been due for the longest time; None if none is, or during a pause."""
        if not self._due_s or now_s < self._rest_until_s:
            return None
        tag_id, due_s = min(self._due_s.items(), key=lambda item: item[1])
        return self._tags[tag_id] if due_s <= now_s else None

    def searched(self, tag: Tag, now_s: float, worked_s: float, *, new: bool) -> None:
        """Record the end of a search, its CPU time [s], and whether there were new samples."""
        self._rest_until_s = now_s + SHARE * worked_s
        self._due_s[tag.tag_id] = now_s + (ENERGY.block_s if new else RETRY_S)


class FindReporter:
    """Selects what is reported to the ground: newly found tags and much better positions."""

    def __init__(self) -> None:
        self._radius_m: dict[int, float] = {}

    def text(self, one: IntegratedTag) -> str | None:
        """Status text for a search result; None if there is nothing new to report."""
        place = one.place
        if place is None or one.heard_alone >= FEW_PULSES:
            return None
        reported_m = self._radius_m.get(one.tag.tag_id)
        if reported_m is not None and place.radius95_m > CLOSER * reported_m:
            return None
        self._radius_m[one.tag.tag_id] = place.radius95_m
        return found_in_flight(one)


class Integration:
    """State of the integrator process. Raises `UsageError` if the antenna is unknown."""

    def __init__(self, frame: ProcessFrame) -> None:
        self._frame = frame
        settings = frame.assignment.settings
        self._options = WholeFlightOptions(
            pattern=pattern_named(settings.bearings.antenna),
            frequency_window_hz=settings.detection.frequency_window_hz,
            elevation=self._ground(settings),
        )
        self._flight: FlightSoFar | None = None
        self._directory = Path()
        self._schedule, self._reporter = SearchSchedule(()), FindReporter()
        self._jobs: queue.SimpleQueue[tuple[FlightSoFar, Path, Tag] | None]
        self._jobs = queue.SimpleQueue()
        self._done: queue.SimpleQueue[tuple[FlightSoFar, Tag, IntegratedTag | None, float]]
        self._done = queue.SimpleQueue()
        self._working = False
        self.judged = self.found = 0
        self.fault: str | None = None
        self.longest_s = 0.0
        if frame.assignment.flight is not None:
            self._begin(frame.assignment.flight)
        threading.Thread(target=self._work, name="integration", daemon=True).start()

    def receive(self, topic: str, record: object) -> None:
        """Handle a message from the supervisor about the beginning or the end of a flight."""
        if isinstance(record, FlightInfo) and topic == "flight":
            self._begin(record)
        elif topic == "flight_end":
            self._flight = None  # the whole of it is judged on the ground

    def _ground(self, settings: Settings) -> Elevation | None:
        """Terrain model given in the settings; None for level ground."""
        terrain = settings.guidance.terrain
        if terrain is None:
            return None
        try:
            return open_elevation(Path(terrain))
        except UavrtError as error:
            self._frame.notify(4, f"whole-flight search assumes level ground: {error}")
            return None

    def _begin(self, flight: FlightInfo) -> None:
        self._directory = Path(flight.directory)
        self._flight = FlightSoFar(self._directory, self._options)
        self._schedule, self._reporter = SearchSchedule(flight.tags), FindReporter()

    def tick(self) -> None:
        """Report finished results, and start the search for the next due tag."""
        while not self._done.empty():
            flight, tag, result, worked_s = self._done.get()
            self._working = False
            self.longest_s = max(self.longest_s, worked_s)
            if flight is not self._flight:
                continue
            self._schedule.searched(tag, monotonic_s(), worked_s, new=result is not None)
            if result is not None:
                self._report(result)
        tag_due = self._schedule.due(monotonic_s())
        if self._flight is not None and tag_due is not None and not self._working:
            self._working = True
            self._jobs.put((self._flight, self._directory, tag_due))

    def _report(self, result: IntegratedTag) -> None:
        self.judged += 1
        self.found += result.found
        text = self._reporter.text(result)
        if text is not None:
            self._frame.notify(5, text)

    def _work(self) -> None:
        """Search for tags in a thread, so that the process goes on sending heartbeats."""
        while (job := self._jobs.get()) is not None:
            flight, directory, tag = job
            began_s = cpu_s()
            result = None
            try:
                result = flight.search(tag)
                if result is not None:
                    save_integrated(read_flight(directory), [result])
                self.fault = None
            except (UavrtError, OSError, MemoryError) as error:
                if str(error) != self.fault:
                    log.warning(
                        "tag excluded from the whole-flight search",
                        tag=tag.tag_id,
                        reason=str(error),
                    )
                self.fault = str(error)
            except Exception as error:  # ours: other tags are judged all the same
                log.exception("whole-flight search of a tag failed; other tags continue")
                self.fault = f"tag {tag.tag_id} cannot be searched: {error}"
            self._done.put((flight, tag, result, cpu_s() - began_s))

    def counters(self) -> dict[str, float]:
        """Return the process's counters by name, for its health record."""
        return {
            "looks": self.judged,
            "looks_that_found": self.found,
            "longest_look_s": round(self.longest_s, 2),
        }


def main() -> None:
    """Run the integrator process until stopped."""
    os.nice(NICENESS)
    with ProcessFrame.start() as frame:
        try:
            integration = Integration(frame)
        except UsageError as error:
            log.error("whole-flight search disabled in this flight", reason=str(error))
            frame.notify(4, f"no whole-flight search on the drone: {error.message}")
            frame.idle(error.message)
            return
        while frame.running:
            for topic, record in frame.receive(timeout_s=TICK_S):
                integration.receive(topic, record)
            integration.tick()
            fault = integration.fault
            frame.report(
                "ready" if fault is None else fault,
                ok=fault is None,
                counters=integration.counters,
            )


if __name__ == "__main__":
    main()
