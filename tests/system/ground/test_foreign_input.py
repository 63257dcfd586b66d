"""No file, request or connection of others stops the ground station and its link."""

import asyncio
import contextlib
import http.client
import json
import math
import os
import resource
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import greedy
import made
import pytest
from command_line import launched
from foreign_files import ENDLESS, MBTILES, SHAPE_ATTACKS, Content, corners, sqlite
from greedy import fill, refuse, spin
from tests.system.ground.conftest import Served

from uavrt.core.errors import CommandRefused, FormatError, UsageError
from uavrt.core.foreign import CPU_S
from uavrt.ground.web.work.foreign_worker import MOST_WAITING, ForeignWorker
from uavrt.link.mavlink.frame import FrameWriter
from uavrt.simulation.demo.demo_programs import free_udp_port

LONGEST_STOP_S = 0.2


class Station(Served):
    """A ground station in this process, and the longest stop of its event loop."""

    longest_stop_s = 0.0

    async def _serve(self) -> None:
        watching = asyncio.create_task(self._watch())
        await super()._serve()
        watching.cancel()

    async def _watch(self) -> None:
        """What this thread computes between two turns is a stop; what others compute is not."""
        while True:
            before_s = time.thread_time()
            await asyncio.sleep(0.005)
            self.longest_stop_s = max(self.longest_stop_s, time.thread_time() - before_s)


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    directory = tmp_path_factory.mktemp("page") / "ground"
    (directory / "maps").mkdir(parents=True)
    station = Station(directory)
    # Imports and the first answer are the program's own, and come once.
    assert station.ask("GET", "/api/choices").status == 200
    assert station.ask("POST", "/api/tags/check", []).status == 200
    assert station.ask("POST", "/api/motion/area", {}).status == 422
    yield station
    station.stop()


@pytest.fixture
def station(running: Station) -> Station:
    running.longest_stop_s = 0.0
    return running


def text_of(name: str) -> str:
    content: Content = SHAPE_ATTACKS[name]
    assert isinstance(content, bytes)
    return content.decode()


def mission_around(*, outlines: int, corner_count: int) -> dict[str, Any]:
    """A survey of long lines that keeps out of outlines beside it."""
    ring = [math.tau * number / corner_count for number in range(corner_count)]
    return {
        "action": "survey",
        "places": [[46.99, 7.99], [46.99, 8.01], [47.01, 8.01], [47.01, 7.99]],
        "spacing_m": 12,
        "height_m": 60,
        "keep_out": [
            {
                "places": [
                    [47.02 + number / 1000 + math.sin(turn) / 1e4, 8 + math.cos(turn) / 1e4]
                    for turn in ring
                ]
            }
            for number in range(outlines)
        ],
    }


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("/api/motion/area", {"name": "a.kml", "text": text_of("nested placemarks")}),
        ("/api/motion/area", {"name": "a.json", "text": text_of("empty lists")}),
        ("/api/motion/area", {"name": "a.json", "text": text_of("30000 corners")}),
        ("/api/motion/area", b'{"name": ' + b"[" * 3_000_000),
        ("/api/motion/plan", {"action": "survey", "places": corners(3000)}),
        (
            "/api/motion/plan",
            {"action": "goto", "places": [[47, 8]], "keep_out": [{"places": corners(9000)}]},
        ),
        ("/api/motion/plan", b"[" + b"{}," * 160_000 + b"{}]"),
        ("/api/motion/upload", mission_around(outlines=9, corner_count=1000)),
        ("/api/tags/import", {"tags.toml": ".".join("a" * 20_000) + " = 1\n"}),
        ("/api/tags/import", {"codes.yaml": "- {id: 1, gaps_ms: [1, 2, 3]}\n" * 25_000}),
        ("/api/tags/import", {"TagInfo.db": "1" + "," * 900_000}),
        ("/api/tags/check", [{"id": n, "frequency_mhz": "x"} for n in range(9_000)]),
        ("/api/tags/check", b"[" * 400_000),
    ],
    ids=[
        *("nested placemarks", "empty lists", "corners", "brackets in a name"),
        *("plan of 3000 corners", "keep out of 9000 corners", "objects"),
        "mission around 9000 corners",
        *("dotted key", "long YAML", "wide line", "long table", "brackets"),
    ],
)
def test_a_request_is_refused_with_a_sentence_and_the_link_goes_on(
    station: Station, path: str, body: object
) -> None:
    answer = station.ask("POST", path, body)
    assert answer.status in (413, 422), answer.json
    assert len(answer.json["error"]) < 5000
    assert station.longest_stop_s <= LONGEST_STOP_S
    assert station.ask("GET", "/api/state").status == 200


def test_a_map_without_end_concerns_only_itself(station: Station) -> None:
    maps = station.directory / "maps"
    metadata = f"CREATE VIEW metadata AS {ENDLESS} SELECT 'n' || i AS name, i AS value FROM n"
    for name, content in {
        "endless.mbtiles": sqlite(MBTILES[1], MBTILES[3], metadata),
        "honest.mbtiles": sqlite(*MBTILES),
    }.items():
        assert callable(content)
        content(maps / name)
    os.mkfifo(maps / "pipe.mbtiles")
    answer = station.ask("GET", "/api/choices")
    assert answer.status == 200
    faults = {one["name"]: one["fault"] for one in answer.json["maps"]}
    assert faults["honest.mbtiles"] is None
    assert len(faults) >= 2
    assert station.longest_stop_s <= LONGEST_STOP_S


@pytest.fixture
def worker(monkeypatch: pytest.MonkeyPatch) -> Iterator[ForeignWorker]:
    monkeypatch.setenv("PYTHONPATH", str(Path(greedy.__file__).parent))
    worker = ForeignWorker()
    yield worker
    worker.close()


def test_what_takes_too_much_is_ended_and_the_next_one_is_read(worker: ForeignWorker) -> None:
    assert worker.result(spin, 0.01) == "done"
    with pytest.raises(FormatError, match=f"longer than {CPU_S} s") as caught:
        worker.result(spin, 600.0)
    assert caught.value.remedy
    with pytest.raises(FormatError, match="MB of memory"):
        worker.result(fill, 900_000_000)
    assert worker.result(fill, 9_000_000) == 9_000_000
    with pytest.raises(UsageError, match="wrong") as refused:
        worker.result(refuse, "usage")
    assert refused.value.remedy == "Do it right"
    with pytest.raises(UsageError, match=r"line 2: wrong"):
        worker.result(refuse, "tags")
    with pytest.raises(FormatError, match="cannot be read: ZeroDivisionError"):
        worker.result(refuse, "fault of ours")


def test_only_some_requests_wait_for_the_process(worker: ForeignWorker) -> None:
    async def main() -> tuple[int, int]:
        calls = [worker.call(spin, 0.001) for _ in range(MOST_WAITING + 10)]
        found = await asyncio.gather(*calls, return_exceptions=True)
        return found.count("done"), sum(isinstance(one, CommandRefused) for one in found)

    assert asyncio.run(main()) == (MOST_WAITING, 10)


def test_what_is_cancelled_ends_at_once_and_the_next_one_is_read(worker: ForeignWorker) -> None:
    async def main() -> str:
        calls = [asyncio.create_task(worker.call(time.sleep, 50.0)) for _ in range(2)]
        await asyncio.sleep(0.5)
        for call in calls:
            call.cancel()
        await asyncio.wait(calls)
        return await worker.call(spin, 0.001)

    begun_s = time.monotonic()
    assert asyncio.run(main()) == "done"
    assert time.monotonic() - begun_s < 30.0


@contextlib.contextmanager
def ground_program(directory: Path, files: int) -> Iterator[tuple[int, int, int]]:
    """The ground station as a program with few descriptors: process, page and link."""
    link = free_udp_port()
    program = launched(
        *("-m", "uavrt.cli", "ground", "--page", "--no-browser", "--port", "0"),
        *("--mavlink", f"udpin://127.0.0.1:{link}", "--output", directory, "--json"),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (files, files)),
    )
    assert program.stdout is not None
    try:
        for line in program.stdout:
            event = json.loads(line)
            if event["event"] == "page":
                port = int(event["address"].rpartition(":")[2].strip("/"))
                break
        yield program.pid, port, link
        assert program.poll() is None
    finally:
        program.terminate()
        program.wait(60)
        program.stdout.close()


def test_a_thousand_half_open_connections_leave_page_and_link_their_descriptors(
    tmp_path: Path,
) -> None:
    resource.setrlimit(
        resource.RLIMIT_NOFILE, (4096, resource.getrlimit(resource.RLIMIT_NOFILE)[1])
    )
    with ground_program(tmp_path / "ground", 256) as (pid, port, link):
        silent = []
        for number in range(1000):
            sock = socket.create_connection(("127.0.0.1", port), timeout=20)
            if number % 2:
                sock.sendall(b"GET /api/state HTTP/1.1\r\nHost: lo")
            silent.append(sock)
        # The drone is received for the first time now.
        heartbeat = made.heartbeat(type=2, autopilot=12)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
            writer = FrameWriter(1, 1)
            for _ in range(20):
                vehicle.sendto(writer.encode(heartbeat), ("127.0.0.1", link))
                time.sleep(0.05)
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
        connection.request("GET", "/api/state")
        state = json.loads(connection.getresponse().read())
        connection.close()
        assert len(os.listdir(f"/proc/{pid}/fd")) < 200
        assert state["connection"]["error"] is None
        for sock in silent:
            sock.close()
