import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from uavrt.clock import Clock
from uavrt.config.settings import Ros2Settings, Settings
from uavrt.ipc import Assignment, decode_record, encode_record
from uavrt.ipc.link import LINK_VARIABLE, LineBuffer
from uavrt.messages import FlightInfo


class GatewayProcess:
    """The real gateway process, with us in the supervisor's place."""

    def __init__(
        self, settings: Settings, flight: FlightInfo | None = None, **environment: str
    ) -> None:
        self._sock, theirs = socket.socketpair()
        self._lines = LineBuffer()
        self.clock = Clock.start()
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "uavrt.processes.ros2_gateway"],
                pass_fds=(theirs.fileno(),),
                env=os.environ | {LINK_VARIABLE: str(theirs.fileno())} | environment,
            )
        self.send(
            "assignment",
            Assignment(
                process="ros2",
                settings=settings,
                clock_offset_ns=self.clock.offset_ns,
                flight=flight,
            ),
        )

    def send(self, topic: str, record: object) -> None:
        self._sock.sendall(encode_record(topic, record))

    def receive(self, topic: str, count: int = 1, timeout_s: float = 30.0) -> list[Any]:
        """The next records of a topic; others are passed over."""
        found: list[Any] = []
        deadline_s = time.monotonic() + timeout_s
        while len(found) < count:
            self._sock.settimeout(max(0.01, deadline_s - time.monotonic()))
            data = self._sock.recv(1 << 16)
            assert data, "the gateway has ended"
            for line in self._lines.feed(data):
                name, record = decode_record(line)
                found += [record] * (name == topic)
        return found

    def close(self) -> int:
        """Ask it to end; get its exit code."""
        self.process.terminate()
        try:
            return self.process.wait(10.0)
        finally:
            self.process.kill()
            self.process.wait()
            self._sock.close()


Launch = Callable[..., GatewayProcess]


@pytest.fixture
def launch(ros_domain: int) -> Iterator[Launch]:
    """Start gateways in the test's domain; ends them all."""
    started: list[GatewayProcess] = []

    def start(
        ros2: Ros2Settings | None = None, flight: FlightInfo | None = None, **environment: str
    ) -> GatewayProcess:
        settings = Settings(ros2=ros2 or Ros2Settings(enabled=True, domain_id=ros_domain))
        started.append(GatewayProcess(settings, flight, **environment))
        return started[-1]

    yield start
    for gateway in started:
        if gateway.process.poll() is None:
            gateway.close()
