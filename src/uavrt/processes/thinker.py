"""Run the search planner in a thread, so that decisions do not block the guide.

The guide must send heartbeats and watch the battery while the planner rates paths. The search's
beliefs belong to the thread alone; all its input passes through one queue.
"""

import queue
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from uavrt.guidance.orders import VehicleNow
from uavrt.guidance.search_rules import SEARCH_RULES
from uavrt.guidance.seeker import Choice, Seeker
from uavrt.log import get_logger
from uavrt.messages import Neighbour, PulsePose, SearchNote, SearchReport

log = get_logger()

LEAST_S = 0.5
"""Time between two decisions while it waits [s]."""
AGAIN_S = 2.0
"""Time until the next decision after a leg was refused [s]."""

_Job = Callable[[], Choice | SearchNote | None]


@dataclass(frozen=True, slots=True)
class Failed:
    """The search has ended with an internal error."""

    reason: str


class Thinker:
    """Runs a search in its thread; its methods do not block."""

    def __init__(self, seeker: Seeker) -> None:
        self._seeker = seeker
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._thoughts: queue.SimpleQueue[Choice | SearchNote | Failed] = queue.SimpleQueue()
        self._thinking = False
        self._asked_s = self._again_s = 0.0
        self._over = False
        self._start()

    def _start(self) -> None:
        threading.Thread(target=self._run, name="search", daemon=True).start()

    def _put(self, job: _Job | None) -> None:
        """Queue a job for the thread; None ends it."""
        self._jobs.put(job)

    def pulse(self, pulse_pose: PulsePose) -> None:
        """Pass on a pulse."""
        self._put(lambda: self._seeker.pulse(pulse_pose))

    def searched(self, report: SearchReport) -> None:
        """Pass on a detector's search report."""
        self._put(lambda: self._seeker.searched(report))

    def place(self, time_ns: int, now: VehicleNow) -> None:
        """Pass on the drone's place."""
        self._put(lambda: self._seeker.place(time_ns, now))

    def begin(self, time_ns: int, now: VehicleNow) -> None:
        """Start the search."""
        self._thinking = True
        self._put(lambda: self._seeker.begin(time_ns, now))

    def ask(
        self, time_ns: int, now: VehicleNow, *, idle: bool, others: Sequence[Neighbour] = ()
    ) -> None:
        """Request the next leg, if it is time."""
        if self.is_time(now, idle=idle):
            self._thinking, self._asked_s = True, now.time_s
            self._put(lambda: self._seeker.think(time_ns, now, idle=idle, others=others))

    def is_time(self, now: VehicleNow, *, idle: bool) -> bool:
        """True if no request is open and the last is long enough ago."""
        due_s = max(self._again_s, self._asked_s + (LEAST_S if idle else SEARCH_RULES.cycle_s))
        return not self._thinking and now.time_s >= due_s

    def withdraw(self, now: VehicleNow) -> None:
        """Report that the last choice is not flown; a new one follows soon."""
        self._put(self._seeker.withdraw)
        self._asked_s, self._again_s = now.time_s - SEARCH_RULES.cycle_s, now.time_s + AGAIN_S

    def end(self, time_ns: int, now: VehicleNow, reason: str) -> None:
        """Request the summary, which comes as the last result."""
        self._put(lambda: self._seeker.end(time_ns, now, reason))
        self._put(None)

    @property
    def over(self) -> bool:
        """Whether no more results will come."""
        return self._over and self._thoughts.empty()

    def thoughts(self) -> list[Choice | SearchNote | Failed]:
        """Get the results since the last call."""
        found = []
        while not self._thoughts.empty():
            thought = self._thoughts.get()
            self._thinking &= not isinstance(thought, Choice)
            found.append(thought)
        return found

    def _run(self) -> None:
        while not self._over:
            self._do(self._jobs.get())

    def _do(self, job: _Job | None) -> None:
        thought: Choice | SearchNote | Failed | None = None
        try:
            if job is not None:
                thought = job()
        except Exception as error:
            log.exception("search failed")
            thought, job = Failed(f"the search has failed: {error}"), None
        if thought is not None:
            self._thoughts.put(thought)
        self._over = job is None
