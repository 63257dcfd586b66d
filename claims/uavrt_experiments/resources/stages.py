"""The supervisor with decimator, channelizer and detector in separate processes.

This shape never flies. It measures the cost of boundaries between processes (the thesis asks
about the cost of executors in §2.2.1). ``python -m uavrt_experiments.resources.stages
SETTINGS_JSON [TAGS_JSON]``.
"""

import sys
from dataclasses import replace

from uavrt.drone.supervisor import __main__ as supervisor
from uavrt.drone.supervisor.tree.process_shapes import SHAPES
from uavrt.drone.supervisor.tree.table import PROCESSES, ProcessRow, while_detecting

_RECEIVER, _DETECTOR = (
    next(row for row in PROCESSES if row.name == name) for name in ("receiver", "detector")
)
STAGES = (
    *(row for row in PROCESSES if row not in (_RECEIVER, _DETECTOR)),
    replace(_DETECTOR, per_worker=False),
    ProcessRow(
        name="channelizer",
        module="uavrt_experiments.resources.channelizer",
        meaning="the band to channels",
        runs=while_detecting,
        samples_to="detector",
        consumes=(),
        produces=("health", "status_text"),
        cpu_budget_percent=2.0,
        memory_limit_mb=100.0,
    ),
    replace(
        _RECEIVER,
        module="uavrt_experiments.resources.decimator",
        meaning="radio samples to the decimated band; also records it",
        samples_to="channelizer",
    ),
)
"""Rows of the process table in start order, in place of those that fly."""


if __name__ == "__main__":
    SHAPES["workers"] = STAGES
    sys.exit(supervisor.main())
