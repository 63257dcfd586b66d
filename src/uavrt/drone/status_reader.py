"""Client for the status socket of a running supervisor: reads records, sends commands."""

import socket
import sys
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from uavrt.config.settings import Settings
from uavrt.core.clock import monotonic_s
from uavrt.core.errors import UavrtError
from uavrt.core.messages import SystemStatus
from uavrt.drone.ipc.record_link import RecordSocket, SupervisorGone

SOCKET_NAME = "status.sock"
STATUS_S = 3.0
"""Longest wait for a status report [s]; the supervisor sends one each second."""


def status_socket_path(settings: Settings) -> Path:
    """Return the supervisor's socket path: as configured, or in the flights' directory."""
    if settings.status_socket is not None:
        return Path(settings.status_socket)
    return Path(settings.recording.directory) / SOCKET_NAME


def running_status(path: Path) -> SystemStatus | None:
    """Return the status of the supervisor that serves the socket `path`; None without one."""
    try:
        reader = StatusReader(path)
    except (UavrtError, OSError):
        return None
    with closing(reader):
        end_s = monotonic_s() + STATUS_S
        while monotonic_s() < end_s:
            for _, record in reader.read(0.1):
                if isinstance(record, SystemStatus):
                    return record
    return None


def _never() -> None:
    """Do nothing; default for the function called while `StatusReader` waits."""


class StatusReader:
    """Client of the supervisor's status socket.

    It waits up to `timeout_s` for the socket to open, and calls `check` meanwhile. Then it
    raises `UavrtError`.
    """

    def __init__(
        self, path: Path, timeout_s: float = 0.0, check: Callable[[], None] = _never
    ) -> None:
        self._sock = socket.socket(socket.AF_UNIX)
        try:
            self._connect(str(path), monotonic_s() + timeout_s, check)
        except BaseException:
            self._sock.close()
            raise
        self._records = RecordSocket(self._sock)
        self.is_open = True
        """True while the supervisor is connected."""

    def _connect(self, path: str, deadline_s: float, check: Callable[[], None]) -> None:
        while True:
            try:
                self._sock.connect(path)
            except (FileNotFoundError, ConnectionRefusedError):
                check()
                if monotonic_s() > deadline_s:
                    raise UavrtError(
                        "the supervisor did not start in time", remedy="Try again"
                    ) from None
                time.sleep(0.05)
            else:
                return

    @property
    def process_id(self) -> int:
        """Process id of the supervisor (unix(7), SO_PEERCRED)."""
        credentials = self._sock.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12)
        return int.from_bytes(credentials[:4], sys.byteorder)

    def read(self, wait_s: float) -> list[tuple[str, Any]]:
        """Return the (topic, record) pairs received within `wait_s`; empty after the end."""
        deadline_s = monotonic_s() + wait_s
        records: list[tuple[str, Any]] = []
        while (rest_s := deadline_s - monotonic_s()) > 0:
            try:
                records += self._records.receive(rest_s)
            except SupervisorGone:
                self.is_open = False
                time.sleep(rest_s)
        return records

    def send(self, topic: str, record: object) -> None:
        """Send a record, such as a command, to the supervisor."""
        self._records.send(topic, record)
        self._records.flush(STATUS_S)

    def close(self) -> None:
        """Close the connection to the supervisor."""
        self._sock.close()
