"""A search that thinks in a thread of its own: no decision keeps the guide from its work.

The guide must show that it lives and look at the battery while the planner weighs its ways; the
search's beliefs belong to the thread alone, all its input waits in one queue.
"""

import queue
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from uavrt.guidance.orders import VehicleNow
from uavrt.guidance.seeker import Choice, Seeker
from uavrt.log import get_logger
from uavrt.messages import Neighbour, PulsePose, SearchNote, SearchReport

log = get_logger()

CYCLE_S = 5.0
"""From one decision to the next while the drone is under way."""
LEAST_S = 0.5
"""And when it waits."""
AGAIN_S = 2.0
"""After a way that it did not get."""

_Job = Callable[[], Choice | SearchNote | None]


@dataclass(frozen=True, slots=True)
class Failed:
    """The search has ended by a fault of ours."""

    reason: str


class Thinker:
    """Runs a search; never waits for it."""

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
        """Let the thread do a job after those before it; None is the last."""
        self._jobs.put(job)

    def pulse(self, pulse_pose: PulsePose) -> None:
        """Pass a pulse on."""
        self._put(lambda: self._seeker.pulse(pulse_pose))

    def searched(self, report: SearchReport) -> None:
        """Pass on what a detector has searched."""
        self._put(lambda: self._seeker.searched(report))

    def place(self, time_ns: int, now: VehicleNow) -> None:
        """Pass on where the drone is."""
        self._put(lambda: self._seeker.place(time_ns, now))

    def begin(self, time_ns: int, now: VehicleNow) -> None:
        """Begin."""
        self._thinking = True
        self._put(lambda: self._seeker.begin(time_ns, now))

    def ask(
        self, time_ns: int, now: VehicleNow, *, idle: bool, others: Sequence[Neighbour] = ()
    ) -> None:
        """Ask where to fly, if it is time."""
        if self.is_time(now, idle=idle):
            self._thinking, self._asked_s = True, now.time_s
            self._put(lambda: self._seeker.think(time_ns, now, idle=idle, others=others))

    def is_time(self, now: VehicleNow, *, idle: bool) -> bool:
        """Whether nothing was asked that is not answered, and long enough ago."""
        due_s = max(self._again_s, self._asked_s + (LEAST_S if idle else CYCLE_S))
        return not self._thinking and now.time_s >= due_s

    def withdraw(self, now: VehicleNow) -> None:
        """Pass on that the last choice is not flown; it is thought over soon."""
        self._put(self._seeker.withdraw)
        self._asked_s, self._again_s = now.time_s - CYCLE_S, now.time_s + AGAIN_S

    def end(self, time_ns: int, now: VehicleNow, reason: str) -> None:
        """Ask for the summary; the last thought is it."""
        self._put(lambda: self._seeker.end(time_ns, now, reason))
        self._put(None)

    @property
    def over(self) -> bool:
        """Whether nothing more will come."""
        return self._over and self._thoughts.empty()

    def thoughts(self) -> list[Choice | SearchNote | Failed]:
        """Get what it has thought since the last call."""
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
