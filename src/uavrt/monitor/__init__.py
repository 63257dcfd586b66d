"""Watch, start and stop a running system from a terminal on the same computer."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.monitor.operate import start_detection, stop_detection
    from uavrt.monitor.reader import StatusReader, status_socket_path
    from uavrt.monitor.view import MonitorView

__all__ = [
    "MonitorView",
    "StatusReader",
    "start_detection",
    "status_socket_path",
    "stop_detection",
]
__getattr__ = lazily(
    __name__,
    {
        "MonitorView": "view",
        "StatusReader": "reader",
        "start_detection": "operate",
        "status_socket_path": "reader",
        "stop_detection": "operate",
    },
)
