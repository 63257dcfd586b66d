"""A stretch of radio or Wi-Fi between two UDP ends: cut, lossy, late, with copies."""

import asyncio
import contextlib
import random
import socket
from collections.abc import AsyncIterator, Callable
from typing import Any

from uavrt.simulation.demo.demo_programs import free_udp_port


class Relay:
    """Passes datagrams on, both ways; its faults are changed at any time.

    `towards`: port of the end that listens.
    `port`: where the other end sends to.
    `seed`: of losses, delays and copies.
    """

    def __init__(self, towards: int, port: int | None = None, *, seed: int = 1) -> None:
        self.port = free_udp_port() if port is None else port
        self._towards = towards
        self._random = random.Random(seed)
        self.cut = False
        self.loss = 0.0
        """Share of datagrams that are lost."""
        self.late_s = 0.0
        """Mean delay; each datagram has its own, so that some overtake others."""
        self.copied = 0.0
        """Share of datagrams that arrive twice."""
        self.passed = self.lost = 0
        self._client: Any = None

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator["Relay"]:
        loop = asyncio.get_running_loop()
        inside, outside = (socket.socket(type=socket.SOCK_DGRAM) for _ in range(2))
        for end in (inside, outside):
            end.setblocking(False)
        inside.bind(("127.0.0.1", self.port))
        outside.bind(("127.0.0.1", 0))

        def up() -> None:
            data, self._client = inside.recvfrom(2048)
            self._pass(lambda: outside.sendto(data, ("127.0.0.1", self._towards)))

        def down() -> None:
            data, _ = outside.recvfrom(2048)
            client = self._client
            if client is not None:
                self._pass(lambda: inside.sendto(data, client))

        loop.add_reader(inside, up)
        loop.add_reader(outside, down)
        try:
            yield self
        finally:
            for end in (inside, outside):
                loop.remove_reader(end)
                end.close()

    def _pass(self, send: Callable[[], object]) -> None:
        def arrive() -> None:
            with contextlib.suppress(OSError):  # closed meanwhile
                send()

        draw = self._random.random
        copies = 1 + (draw() < self.copied)
        for _ in range(copies):
            if self.cut or draw() < self.loss:
                self.lost += 1
                continue
            self.passed += 1
            if self.late_s:
                delay_s = self._random.expovariate(1.0 / self.late_s)
                asyncio.get_running_loop().call_later(delay_s, arrive)
            else:
                arrive()
