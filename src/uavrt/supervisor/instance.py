"""One process of the table, running or not; it outlives its child."""

import os
import resource
from collections.abc import Iterable
from dataclasses import dataclass, field

from uavrt.messages import Health, ProcessStatus, SystemState
from uavrt.supervisor.child import Child
from uavrt.supervisor.outbox import Outbox
from uavrt.supervisor.table import ProcessRow


@dataclass(slots=True)
class Instance:
    """One process of the table, running or not; outlives its child."""

    name: str
    row: ProcessRow
    worker: int
    outbox: Outbox = field(init=False)
    child: Child | None = None
    health: Health | None = None
    started_s: float = 0.0
    stop_asked_s: float | None = None
    not_before_s: float = 0.0
    failures: int = 0
    restarts: int = 0
    cpu_s_before: float = 0.0
    """CPU time of its earlier children."""
    memory_mb: float = 0.0

    def __post_init__(self) -> None:
        self.outbox = Outbox(self.row.backlog)

    def status(self) -> ProcessStatus:
        """Describe it now; measures the child."""
        child, health = self.child, self.health
        if child is not None:
            self.memory_mb = child.measure()
        return ProcessStatus(
            process=self.name,
            running=child is not None,
            pid=child.pid if child is not None else None,
            status=health.status if health else ("starting" if child else "stopped"),
            ok=health.ok if health else child is not None or self.stop_asked_s is not None,
            restarts=self.restarts,
            cpu_s=self.cpu_s_before + (child.cpu_s if child is not None else 0.0),
            memory_mb=self.memory_mb,
            counters=health.counters if health else {},
        )


def self_status(state: SystemState, instances: Iterable[Instance]) -> ProcessStatus:
    """Describe the supervisor itself, with what its outboxes had to drop."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return ProcessStatus(
        process="supervisor",
        running=True,
        pid=os.getpid(),
        status=state.value,
        ok=True,
        restarts=0,
        cpu_s=usage.ru_utime + usage.ru_stime,
        memory_mb=usage.ru_maxrss / 1e3,
        counters={
            f"dropped_{instance.name}_{topic}": float(count)
            for instance in instances
            for topic, count in instance.outbox.dropped.items()
        },
    )
