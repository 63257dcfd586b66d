"""State of one process of the process table; it is kept when the process is restarted."""

import os
from collections.abc import Iterable
from dataclasses import dataclass, field

from uavrt.core.clock import monotonic_s
from uavrt.core.commands import SystemState
from uavrt.core.messages import Health, ProcessStatus
from uavrt.drone.supervisor.pace import PaceWatch
from uavrt.drone.supervisor.start.restarts import Restarts
from uavrt.drone.supervisor.start.usage import Usage
from uavrt.drone.supervisor.tree.child import Child
from uavrt.drone.supervisor.tree.process_budgets import BudgetWatch
from uavrt.drone.supervisor.tree.table import ProcessRow
from uavrt.drone.supervisor.tree.waiting_records import Outbox


@dataclass(slots=True)
class Instance:
    """State of one process of the process table: queue, budget, restarts and last report."""

    name: str
    row: ProcessRow
    worker: int
    outbox: Outbox = field(init=False)
    budget: BudgetWatch = field(init=False)
    pace: PaceWatch = field(init=False)
    restarts: Restarts = field(init=False)
    child: Child | None = None
    health: Health | None = None
    stop_asked_s: float | None = None
    cpu_s_before: float = 0.0
    """CPU time of all earlier runs of the process, with its children [s]."""
    own_cpu_s_before: float = 0.0
    """CPU time of all earlier runs of the process, without its children [s]."""
    memory_mb: float = 0.0
    silence_reported: bool = False
    """True if the operator has been warned of the process's silence."""
    tag_ids: tuple[int, ...] = ()
    """Numbers of the tags assigned to the process at its last start."""
    last_error: str = ""
    """Last warning or error that the process printed, shown when it ends."""

    def __post_init__(self) -> None:
        self.outbox = Outbox(self.row.backlog, keeps=self.row.acknowledges_records)
        self.restarts = Restarts(self.row.restart)
        self.pace = PaceWatch(self.name, self.row.produces)
        self.budget = BudgetWatch(
            self.name,
            cpu_percent=self.row.cpu_budget_percent,
            memory_mb=self.row.memory_limit_mb,
        )

    def status(self) -> ProcessStatus:
        """Measure CPU time and memory, and return the state of the process."""
        child, health = self.child, self.health
        if child is not None:
            self.memory_mb = child.measure()
        degraded = self.restarts.degraded(monotonic_s())
        word = health.status if health else ("starting" if child else "stopped")
        known = child is not None or self.stop_asked_s is not None
        ok = not degraded and (health.ok if health else known)
        if child is not None and self.pace.slow:
            word = f"{word}, too slow"
        return ProcessStatus(
            process=self.name,
            running=child is not None,
            pid=child.pid if child is not None else None,
            status=f"degraded: {self.restarts.last_reason}" if degraded else word,
            ok=ok,
            restarts=self.restarts.total,
            cpu_s=self.cpu_s_before + (child.cpu_s if child is not None else 0.0),
            memory_mb=self.memory_mb,
            counters=health.counters if health else {},
            reason="" if ok else (health.reason if health else "") or self.last_error,
            tag_ids=self.tag_ids,
        )

    def over_budget(self, now_s: float) -> str | None:
        """Return a warning if the process exceeds its budget; else None."""
        child = self.child
        if child is None:
            return None
        return self.budget.check(
            now_s, self.own_cpu_s_before + child.own_cpu_s, child.own_memory_mb
        )


def self_status(
    state: SystemState, instances: Iterable[Instance], usage: Usage, counters: dict[str, float]
) -> ProcessStatus:
    """Return the state of the supervisor itself, with counts of records dropped from queues."""
    return ProcessStatus(
        process="supervisor",
        running=True,
        pid=os.getpid(),
        status=state.value,
        ok=True,
        restarts=0,
        cpu_s=usage.cpu_s,
        memory_mb=usage.memory_mb,
        counters=counters
        | {
            f"dropped_{instance.name}_{topic}": float(count)
            for instance in instances
            for topic, count in instance.outbox.dropped.items()
        },
    )
