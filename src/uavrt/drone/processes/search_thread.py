"""Run the search planner in a thread, so that its decisions do not block the guide.

The guide must send heartbeats and watch the battery while the planner rates paths. Only the
thread uses the search's state; all its input passes through one queue.
"""

import queue
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from uavrt.core.log import get_logger
from uavrt.core.messages import Neighbour, PulsePose, SearchNote, SearchReport
from uavrt.guidance.operator_orders import VehicleNow
from uavrt.guidance.search.search_run import Choice, SearchRun
from uavrt.guidance.search_rules import SEARCH_RULES

log = get_logger()

IDLE_S = 0.5
"""Shortest time between two search decisions while the drone has nothing to fly [s]."""
RETRY_S = 2.0
"""Time until the next search decision after the ground refused a path [s]."""

_Job = Callable[[], Choice | SearchNote | None]


@dataclass(frozen=True, slots=True)
class SearchFailed:
    """Result that says that the search has ended with an internal error."""

    reason: str


class SearchThread:
    """Runs a `SearchRun` in a thread. The methods queue work for it and return at once."""

    def __init__(self, search_run: SearchRun) -> None:
        self._search_run = search_run
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._results: queue.SimpleQueue[Choice | SearchNote | SearchFailed] = (
            queue.SimpleQueue()
        )
        self._deciding = False
        self._asked_s = self._again_s = 0.0
        self._over = False
        self._start()

    def _start(self) -> None:
        threading.Thread(target=self._run, name="search", daemon=True).start()

    def _put(self, job: _Job | None) -> None:
        self._jobs.put(job)

    def pulse(self, pulse_pose: PulsePose) -> None:
        """Pass a pulse with its pose to the search."""
        self._put(lambda: self._search_run.pulse(pulse_pose))

    def searched(self, report: SearchReport) -> None:
        """Pass a report of a search without detection to the search."""
        self._put(lambda: self._search_run.searched(report))

    def place(self, time_ns: int, now: VehicleNow) -> None:
        """Pass the drone's position to the search."""
        self._put(lambda: self._search_run.place(time_ns, now))

    def begin(self, time_ns: int, now: VehicleNow) -> None:
        """Start the search."""
        self._deciding = True
        self._put(lambda: self._search_run.begin(time_ns, now))

    def request_decision(
        self, time_ns: int, now: VehicleNow, *, idle: bool, others: Sequence[Neighbour] = ()
    ) -> None:
        """Request the next decision if one is due; `results` will return it."""
        if self.is_time(now, idle=idle):
            self._deciding, self._asked_s = True, now.time_s
            self._put(lambda: self._search_run.decide(time_ns, now, idle=idle, others=others))

    def is_time(self, now: VehicleNow, *, idle: bool) -> bool:
        """True if no decision is pending and the last one is old enough for another."""
        due_s = max(self._again_s, self._asked_s + (IDLE_S if idle else SEARCH_RULES.cycle_s))
        return not self._deciding and now.time_s >= due_s

    def withdraw(self, now: VehicleNow) -> None:
        """Discard the last decision, which is not flown; the next is due after `RETRY_S`."""
        self._put(self._search_run.withdraw)
        self._asked_s, self._again_s = now.time_s - SEARCH_RULES.cycle_s, now.time_s + RETRY_S

    def end(self, time_ns: int, now: VehicleNow, reason: str) -> None:
        """End the search; its summary is the last of the `results`."""
        self._put(lambda: self._search_run.end(time_ns, now, reason))
        self._put(None)

    @property
    def over(self) -> bool:
        """True once the search has ended and all `results` were read."""
        return self._over and self._results.empty()

    def results(self) -> list[Choice | SearchNote | SearchFailed]:
        """Return the decisions, notes and failure that were produced since the last call."""
        found = []
        while not self._results.empty():
            result = self._results.get()
            self._deciding &= not isinstance(result, Choice)
            found.append(result)
        return found

    def _run(self) -> None:
        while not self._over:
            self._do(self._jobs.get())

    def _do(self, job: _Job | None) -> None:
        result: Choice | SearchNote | SearchFailed | None = None
        try:
            if job is not None:
                result = job()
        except Exception as error:
            log.exception("search planning failed; the search ends")
            result, job = SearchFailed(f"the search has failed: {error}"), None
        if result is not None:
            self._results.put(result)
        self._over = job is None
