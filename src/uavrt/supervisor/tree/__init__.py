"""The process tree: which processes run, and how they are started, watched and stopped.

`table` lists the processes of the drone side and `shapes` its variants. `fleet` holds an
`instance` per row; each starts a `child` through `launcher` and its `nursery`. `restarts`,
`budget` and `usage` watch them; `waiting_records` and `child_records` carry their records.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.supervisor.tree.child_output import OutputLog, warning_text
    from uavrt.supervisor.tree.fleet import Fleet
    from uavrt.supervisor.tree.instance import Instance, self_status
    from uavrt.supervisor.tree.launcher import PING_S, SILENCE_S, Launcher
    from uavrt.supervisor.tree.restarts import SOON
    from uavrt.supervisor.tree.shapes import SHAPES, rows_for
    from uavrt.supervisor.tree.systemd import SystemdNotifier
    from uavrt.supervisor.tree.table import (
        PROCESSES,
        SUPERVISOR_TOPICS,
        ProcessRow,
        consumers_of,
        on_every_drone,
        while_receiving,
    )
    from uavrt.supervisor.tree.usage import (
        children_of,
        descendants_of,
        is_alive,
        own_usage,
        usage_of,
    )

__all__ = [
    "PING_S",
    "PROCESSES",
    "SHAPES",
    "SILENCE_S",
    "SOON",
    "SUPERVISOR_TOPICS",
    "Fleet",
    "Instance",
    "Launcher",
    "OutputLog",
    "ProcessRow",
    "SystemdNotifier",
    "children_of",
    "consumers_of",
    "descendants_of",
    "is_alive",
    "on_every_drone",
    "own_usage",
    "rows_for",
    "self_status",
    "usage_of",
    "warning_text",
    "while_receiving",
]
__getattr__ = lazily(
    __name__,
    {
        "Fleet": "fleet",
        "Instance": "instance",
        "Launcher": "launcher",
        "OutputLog": "child_output",
        "PING_S": "launcher",
        "PROCESSES": "table",
        "ProcessRow": "table",
        "SHAPES": "shapes",
        "SILENCE_S": "launcher",
        "SOON": "restarts",
        "SUPERVISOR_TOPICS": "table",
        "SystemdNotifier": "systemd",
        "children_of": "usage",
        "consumers_of": "table",
        "descendants_of": "usage",
        "is_alive": "usage",
        "on_every_drone": "table",
        "own_usage": "usage",
        "rows_for": "shapes",
        "self_status": "instance",
        "usage_of": "usage",
        "warning_text": "child_output",
        "while_receiving": "table",
    },
)
