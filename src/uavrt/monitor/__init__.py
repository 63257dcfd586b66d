"""A running system seen from a terminal on the same computer, and told to start and stop."""

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
