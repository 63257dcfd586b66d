"""A ground station with its page, served on this machine, asked by real requests."""

import asyncio
import contextlib
import http.client
import json
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from uavrt.ground.web.page_program import PageSettings, PageStation
from uavrt.ground.web.server import ServerSettings
from uavrt.simulation.demo.demo_programs import free_udp_port


@dataclass
class Answer:
    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def json(self) -> Any:
        return json.loads(self.body)


class Served:
    """A running station; `ask` sends one request exactly as told."""

    def __init__(
        self, directory: Path, page: dict[str, Any] | None = None, **server: Any
    ) -> None:
        self.directory = directory
        self.events: list[dict[str, Any]] = []
        self.station: PageStation
        self.port = 0
        self.mavlink_port = free_udp_port()
        self._there = threading.Event()
        self._settings = PageSettings(
            directory=directory,
            address=f"udpin://127.0.0.1:{self.mavlink_port}",
            server=ServerSettings(port=0, **server),
            **(page or {}),
        )
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()))
        self._thread.start()
        assert self._there.wait(60.0)

    async def _serve(self) -> None:
        self.loop = asyncio.get_running_loop()
        self.station = PageStation(self._settings, self._show)
        await self.station.run()

    def _show(self, event: dict[str, Any]) -> None:
        self.events.append(event)
        if event["event"] == "page":
            self.port = int(event["address"].rpartition(":")[2].strip("/"))
            self._there.set()

    def stop(self) -> None:
        with contextlib.suppress(RuntimeError):  # stopped before
            self.loop.call_soon_threadsafe(self.station.stop)
        self._thread.join(60.0)
        assert not self._thread.is_alive()

    def ask(
        self, method: str, path: str, body: object = None, headers: dict[str, str] | None = None
    ) -> Answer:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=120)
        told = {"Content-Type": "application/json"} if body is not None else {}
        told |= headers or {}
        content = body if isinstance(body, bytes | None) else json.dumps(body).encode()
        connection.request(method, path, content, told)
        response = connection.getresponse()
        answer = Answer(response.status, dict(response.getheaders()), response.read())
        connection.close()
        return answer


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    station = Served(tmp_path / "ground")
    yield station
    station.stop()


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """One station for a whole test file, for requests that do not change it."""
    station = Served(tmp_path_factory.mktemp("standing") / "ground")
    yield station
    station.stop()


@pytest.fixture
def serve() -> Iterator[Callable[..., Served]]:
    """Starts a station, and stops it at the end unless the test has."""
    with contextlib.ExitStack() as stations:

        def serve(*args: Any, **kwargs: Any) -> Served:
            station = Served(*args, **kwargs)
            stations.callback(station.stop)
            return station

        yield serve
