"""A serial line at its rate between the simulated autopilot and the drone's computer.

The port is a real file descriptor, so that the product's serial link reads and writes bytes as
it does on a drone; each byte takes its time. What the autopilot sends goes first; an attacker
fills all the rest, so that the line is never idle.
"""

import asyncio
import contextlib
import socket
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any

import pytest

from uavrt.link.mavlink.frame import FrameParser
from uavrt.simulation.demo.demo_programs import free_udp_port

BAUD = 57_600
BYTE_S = 10 / BAUD
ADDRESS = f"serial:///dev/ttyAMA0:{BAUD}"
HOLDS_BYTES = 4096
"""Size of the autopilot's send buffer [bytes]; what exceeds it is dropped and counted."""


class SerialLine:
    """A serial line at its rate; the simulated autopilot sends datagrams to `port`."""

    def __init__(self) -> None:
        self.port = free_udp_port()
        self.hostile: Callable[[], bytes] | None = None
        """Function that returns the attacker's next frame; None: no attacker."""
        self.passed_bytes = self.hostile_frames = self.dropped = 0
        self._waiting: deque[bytes] = deque()
        self._out_waiting = 0
        self._own, self._their = socket.socketpair()
        self._own.setblocking(False)
        self._autopilot: Any = None

    def open(self, *_: object, **__: object) -> "SerialLine":
        """Open the line in place of ``serial.Serial``."""
        return self

    def fileno(self) -> int:
        return self._their.fileno()

    def close(self) -> None:
        """Do nothing: the line stays open when its link closes."""

    @property
    def out_waiting(self) -> int:
        return self._out_waiting

    @contextlib.contextmanager
    def installed(self) -> Iterator[None]:
        """Let serial links open this line."""
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("serial.Serial", self.open)
            yield
        self._own.close()
        self._their.close()

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        self._loop = asyncio.get_running_loop()
        self._datagrams = socket.socket(type=socket.SOCK_DGRAM)
        self._datagrams.setblocking(False)
        self._datagrams.bind(("127.0.0.1", self.port))
        self._loop.add_reader(self._datagrams, self._take_datagram)
        self._loop.add_reader(self._own, self._take_bytes)
        self._parser, self._free_s = FrameParser(), 0.0
        task = asyncio.create_task(self._carry())
        try:
            yield
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            self._loop.remove_reader(self._datagrams)
            self._loop.remove_reader(self._own)
            self._datagrams.close()

    def _take_datagram(self) -> None:
        frame, self._autopilot = self._datagrams.recvfrom(2048)
        if sum(map(len, self._waiting)) + len(frame) > HOLDS_BYTES:
            self.dropped += 1
        else:
            self._waiting.append(frame)

    async def _carry(self) -> None:
        """Carry frames to the computer, one after the other."""
        while True:
            frame = b""
            if self._waiting:
                frame = self._waiting.popleft()
            elif self.hostile is not None:
                frame = self.hostile()
                self.hostile_frames += 1
            await asyncio.sleep(max(1, len(frame)) * BYTE_S)
            self.passed_bytes += len(frame)
            self._own.send(frame) if frame else None

    def _take_bytes(self) -> None:
        """Carry frames to the autopilot; each arrives with its last byte."""
        for frame in self._parser.feed(self._own.recv(65_536)):
            size, now_s = len(frame.raw), self._loop.time()
            self._free_s = max(self._free_s, now_s) + size * BYTE_S
            self._out_waiting += size
            self._loop.call_at(self._free_s, self._arrive, frame.raw)

    def _arrive(self, frame: bytes) -> None:
        self._out_waiting -= len(frame)
        if self._autopilot is not None and self._datagrams.fileno() >= 0:
            self._datagrams.sendto(frame, self._autopilot)
