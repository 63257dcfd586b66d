"""Variants of the table of processes, which differ in how many stages share a process.

The stages are the same in each variant. `PROCESSES` is the normal table; ``one`` is for a
computer with a single core. ``uavrt experiment resources --shapes`` compares their cost.
"""

from dataclasses import replace

from uavrt.config.settings import Settings, Shape
from uavrt.drone.supervisor.tree.table import PROCESSES, ProcessRow


def _row(name: str) -> ProcessRow:
    return next(row for row in PROCESSES if row.name == name)


_REST = tuple(row for row in PROCESSES if row.name not in ("detector", "receiver"))

SHAPES: dict[Shape, tuple[ProcessRow, ...]] = {
    "workers": PROCESSES,
    "one": (
        *_REST,
        replace(
            _row("receiver"),
            module="uavrt.drone.processes.chain",
            meaning="converts radio samples to pulses; also records the band",
            samples_to=None,
            produces=("pulse", "search_report", "beep", "health", "status_text"),
            cpu_budget_percent=10.2,
            memory_limit_mb=180.0,
        ),
    ),
}
"""Table of processes for each value of the setting ``detection.shape``."""


def rows_for(settings: Settings) -> tuple[ProcessRow, ...]:
    """Return the rows of the process table that these settings need."""
    return tuple(row for row in SHAPES[settings.detection.shape] if row.configured(settings))
