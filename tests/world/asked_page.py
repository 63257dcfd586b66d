"""The ground station's page in the running loop, asked by real HTTP requests."""

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from uavrt.ground.session import GroundSession
from uavrt.ground.web.page_program import PageSettings, PageStation
from uavrt.ground.web.server import ServerSettings
from uavrt.ground.web.work.foreign_worker import ForeignWorker
from world import until


@dataclass
class Answer:
    status: int
    body: bytes

    @property
    def json(self) -> Any:
        return json.loads(self.body)


class AskedPage:
    """A page whose station listens at an address of MAVLink.

    `directory`: the ground station's.
    `address`: of the drones.
    `**settings`: of `PageSettings`.
    """

    def __init__(self, directory: Path, address: str, **settings: Any) -> None:
        self.directory = directory
        self._port = 0
        values: dict[str, Any] = {
            "server": ServerSettings(port=0),
            "address": address,
        } | settings
        self.station = PageStation(PageSettings(directory=directory, **values), self._show)

    def _show(self, event: dict[str, Any]) -> None:
        if event["event"] == "page":
            self._port = int(event["address"].rpartition(":")[2].strip("/"))

    @property
    def session(self) -> GroundSession:
        """Of the first vehicle."""
        return self.station.session

    @contextlib.asynccontextmanager
    async def served(self) -> AsyncIterator["AskedPage"]:
        """Serve while the block runs; foreign files are read in this program.

        They are read without a thread, since each step of a virtual clock waits for a thread.
        """

        async def read_here(_: ForeignWorker, function: Callable[..., Any], *given: Any) -> Any:
            return function(*given)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(ForeignWorker, "call", read_here)
            serving = asyncio.create_task(self.station.run())
            try:
                await until(lambda: self._port or serving.done())
                yield self
            finally:
                self.station.stop()
                await serving

    async def ask(
        self, method: str, path: str, body: object = None, headers: dict[str, str] | None = None
    ) -> Answer:
        """Send one request on a connection of its own."""
        content = b"" if body is None else json.dumps(body).encode()
        lines = {
            "Host": f"127.0.0.1:{self._port}",
            "Connection": "close",
            "Content-Length": str(len(content)),
            **({} if body is None else {"Content-Type": "application/json"}),
            **(headers or {}),
        }
        head = "".join(f"{name}: {value}\r\n" for name, value in lines.items())
        reader, writer = await asyncio.open_connection("127.0.0.1", self._port)
        writer.write(f"{method} {path} HTTP/1.1\r\n{head}\r\n".encode() + content)
        raw = await reader.read()
        writer.close()
        await writer.wait_closed()
        top, _, rest = raw.partition(b"\r\n\r\n")
        return Answer(int(top.split(b" ")[1]), rest)

    async def state(self, path: str = "/api/state") -> dict[str, Any]:
        """What the page shows."""
        found: dict[str, Any] = (await self.ask("GET", path)).json
        return found

    async def until(
        self, what: Callable[[dict[str, Any]], object], path: str = "/api/state"
    ) -> dict[str, Any]:
        """Wait for a state; the time limit only ends a broken test."""
        async with asyncio.timeout(30.0):
            while not what(state := await self.state(path)):  # noqa: ASYNC110 - over HTTP
                await asyncio.sleep(0.25)
        return state
