"""Base of every child process: link to the supervisor, clock, health reports, shutdown.

A process's main is then a short loop::

    with ProcessFrame.start() as frame:
        while frame.running:
            for topic, record in frame.receive(timeout_s=0.1):
                ...
            frame.report("ready", counters={...})
"""

import gc
import signal
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.log import configure_logging, get_logger
from uavrt.core.messages import FlightInfo, Health, StatusText
from uavrt.core.runtime.heap import HeapKeeper
from uavrt.drone.ipc.parent import die_with_parent
from uavrt.drone.ipc.record_link import RecordSocket, SupervisorGone
from uavrt.drone.ipc.tag_assignment import Assignment
from uavrt.drone.ipc.topics import TOPICS

HEALTH_PERIOD_S = TOPICS["health"].every_s or 1.0


class ProcessFrame:
    """Link to the supervisor, clock, health reports and shutdown of a child process."""

    def __init__(self, link: RecordSocket, assignment: Assignment) -> None:
        self.link = link
        self.assignment = assignment
        self.clock = Clock(assignment.clock_offset_ns)
        """The flight's clock, replaced at each start: it may step, so do not schedule by it."""
        self.running = True
        self.counters: dict[str, float] = {}
        self._next_health_s = 0.0
        self._heap = HeapKeeper(monotonic_s())
        self._last: tuple[str, bool, str] = ("", True, "")

    @classmethod
    def start(cls, *, finishes: bool = False) -> "ProcessFrame":
        """Open the link and wait for the assignment.

        SIGTERM then ends the main loop; SIGINT is ignored.

        With `finishes`, the end of the supervisor acts as SIGTERM too, for processes that must
        still write. On Ctrl-C, the supervisor alone decides in which order processes end.
        """
        die_with_parent(signal.SIGTERM if finishes else signal.SIGKILL)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        link = RecordSocket.from_environment()
        assignment = link.wait_for_assignment()
        gc.freeze()  # what was imported stays: see `HeapKeeper`
        configure_logging(assignment.process)
        frame = cls(link, assignment)
        signal.signal(signal.SIGTERM, lambda *_: frame.stop())
        return frame

    def stop(self) -> None:
        """Set `running` to False, which ends the process's main loop."""
        self.running = False

    def send(self, topic: str, record: object) -> None:
        """Queue a record for the supervisor; the next `report` sends it.

        Sending all records of a loop pass together wakes the supervisor only once.
        """
        self.link.put(topic, record)

    def receive(self, timeout_s: float = 0.0) -> list[tuple[str, Any]]:
        """Return received (topic, record) pairs; a flight's record also sets `clock`."""
        records = self.link.receive(timeout_s)
        for _, record in records:
            if isinstance(record, FlightInfo):
                self.clock = Clock(record.clock_offset_ns)
        return records

    def notify(self, severity: int, text: str) -> None:
        """Send a text to the operator, with a MAVLink severity (0: emergency, 7: debug)."""
        self.send("status_text", StatusText(severity=severity, text=text))

    def report(
        self,
        status: str,
        *,
        ok: bool = True,
        counters: Callable[[], Mapping[str, float]] = dict,
        last: bool = False,
        reason: str = "",
    ) -> None:
        """Send queued records, and a health report if one is due.

        Call it in each pass of the main loop. A changed status and the end of the process are
        reported at once.
        """
        now_s = monotonic_s()
        if not last and now_s < self._next_health_s and (status, ok, reason) == self._last:
            self.link.flush()
            return
        self._next_health_s = now_s + HEALTH_PERIOD_S
        self._heap.keep(now_s)
        self._last = (status, ok, reason)
        self.link.send(
            "health",
            Health(
                process=self.assignment.process,
                time_ns=self.clock.now_ns(),
                status=status,
                ok=ok,
                counters=dict(counters()),
                reason=reason,
            ),
        )

    def idle(self, reason: str) -> None:
        """Report a fault that a restart cannot cure, until the process is stopped."""
        while self.running:
            self.receive(timeout_s=0.5)
            self.report(reason, ok=False)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Send the queued records; end without an error if the supervisor has ended."""
        if isinstance(error, SupervisorGone):
            get_logger().warning("process stopped because the supervisor has ended")
            sys.exit(1)
        with suppress(SupervisorGone):
            self.link.flush(timeout_s=2.0 if kind is None else 0.1)
