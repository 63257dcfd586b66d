"""Other shapes of the table of processes: which stage runs in which process.

The stages and the rest of the code are the same in each. `PROCESSES` is the one that flies; the
others answer what the borders between processes cost (thesis §2.2.1 asks it of executors), and
``one`` is also for a computer with a single core. See ``uavrt experiment resources --shapes``.
"""

from dataclasses import replace

from uavrt.config.settings import Settings, Shape
from uavrt.supervisor.tree.table import PROCESSES, ProcessRow, while_detecting


def _row(name: str) -> ProcessRow:
    return next(row for row in PROCESSES if row.name == name)


_REST = tuple(row for row in PROCESSES if row.name not in ("detector", "receiver"))

SHAPES: dict[Shape, tuple[ProcessRow, ...]] = {
    "workers": PROCESSES,
    "stages": (
        *_REST,
        replace(_row("detector"), per_worker=False),
        ProcessRow(
            name="channelizer",
            module="uavrt.processes.channelizer",
            meaning="the band to channels",
            runs=while_detecting,
            samples_to="detector",
            consumes=(),
            produces=("health", "status_text"),
            cpu_budget_percent=2.0,
            memory_limit_mb=100.0,
        ),
        replace(
            _row("receiver"),
            module="uavrt.processes.decimator",
            meaning="radio samples to the decimated band; also records it",
            samples_to="channelizer",
        ),
    ),
    "one": (
        *_REST,
        replace(
            _row("receiver"),
            module="uavrt.processes.chain",
            meaning="radio samples to pulses; also records the band",
            samples_to=None,
            produces=("pulse", "search_report", "beep", "health", "status_text"),
            cpu_budget_percent=10.2,
            memory_limit_mb=180.0,
        ),
    ),
}
"""Rows in start order, by the name of the setting ``detection.shape``."""


def rows_for(settings: Settings) -> tuple[ProcessRow, ...]:
    """Get the rows that these settings ask for."""
    return tuple(row for row in SHAPES[settings.detection.shape] if row.configured(settings))
