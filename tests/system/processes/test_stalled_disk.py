"""A disk that does not answer silences nothing."""

import asyncio
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from until import until_async as until

from uavrt.core.commands import SystemState
from uavrt.core.messages import PulsePose
from uavrt.core.runtime.disk_thread import MOST_JOBS, DiskThread
from uavrt.drone.processes.connection_parts.ground_status import GroundStatus
from uavrt.drone.processes.connection_parts.pulse_outlet import PulseOutlet
from uavrt.flight.database.spool import undelivered
from uavrt.ground.fetch.ftp_client import FileClient
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.component import Handlers
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.mavlink_connection import Connection
from uavrt.link.mavlink.services.ftp_files import FileTree
from uavrt.link.mavlink.services.ftp_server import FileServer
from uavrt.link.mavlink.services.ftp_wire import FtpPacket, Opcode
from uavrt.link.tunnel.drone_exchange import Exchange

Bay = Any  # tests/unit/processes/conftest.py


class Stall:
    """A function of the disk that answers when it is let go."""

    def __init__(self, real: Callable[..., Any]) -> None:
        self._real = real
        self.reached, self.go = threading.Event(), threading.Event()

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        self.reached.set()
        self.go.wait(60.0)
        return self._real(*arguments, **options)


@pytest.mark.parametrize("place", ["spool", "listing"])
async def test_pulses_and_answers_go_on_while_the_disk_stalls(
    bay: Bay, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    if place == "spool":
        stall = Stall(undelivered)
        monkeypatch.setattr(
            "uavrt.drone.processes.connection_parts.pulse_outlet.undelivered", stall
        )
    else:
        stall = Stall(lambda tree, name: [])
        monkeypatch.setattr(FileTree, "entries", lambda tree, name: stall(tree, name))
    try:
        async with bay.running(), bay.ground_station() as (link, events):
            bay.begin_flight(tmp_path)
            if place == "spool":
                bay.process._pulses.outlet.sender.stores.mark_all_on_disk()  # like a restart
            else:
                client = FileClient(lambda payload: link.send(request(payload)), lambda: 0)
                asking = asyncio.create_task(client.list_directory("/"))
            await until(stall.reached.is_set)
            await link.stop_detection()
            for number in range(10):
                bay.send_pulse(number)
            await until(lambda: sum(isinstance(e, PulsePose) for e in events) == 10)
            await until(lambda: bay.health.status == "waiting for disk")
            stall.go.set()
            await until(lambda: bay.health.status == "ready")
            if place == "listing":
                asking.cancel()
    finally:
        stall.go.set()


def request(payload: bytes) -> dialect.FileTransferProtocol:
    return dialect.FileTransferProtocol(
        target_network=0, target_system=1, target_component=191, payload=payload
    )


async def test_jobs_are_done_one_after_the_other_and_are_bounded() -> None:
    disk, go = DiskThread(), threading.Event()
    done: list[int] = []

    def job(number: int) -> Callable[[], int]:
        return lambda: number

    disk.start()
    assert disk(lambda: go.wait(60.0), lambda result: None)
    await until(lambda: not disk.waiting)
    taken = [disk(job(number), done.append) for number in range(40)]
    assert taken == [True] * MOST_JOBS + [False] * (40 - MOST_JOBS)
    go.set()
    await until(lambda: len(done) >= MOST_JOBS)
    assert done == list(range(MOST_JOBS))


async def test_a_fault_in_a_job_is_kept_to_be_raised() -> None:
    disk = DiskThread()
    disk.start()
    disk(lambda: 1 // 0, lambda result: None)
    await until(lambda: isinstance(disk.failure, ZeroDivisionError))


def test_a_disk_that_stalls_is_asked_for_its_space_once(tmp_path: Path) -> None:
    asked: list[Callable[[], Any]] = []

    def never(job: Callable[[], Any], then: Callable[[Any], None]) -> bool:
        asked.append(job)
        return True

    connection = Connection(
        Handlers(attitude=print, position=print, tunnel=lambda payload, peer: None), lambda: 0
    )
    status = GroundStatus(Exchange(), connection.tunnel, tmp_path, never)
    for second in range(100):
        status.tick(SystemState.DETECTING, second * 1_000_000_000)
    assert len(asked) == 1


def test_a_flight_that_was_removed_is_not_looked_for_any_more(tmp_path: Path) -> None:
    reads: list[Callable[[], Any]] = []

    def disk(job: Callable[[], Any], then: Callable[[Any], None]) -> bool:
        reads.append(job)
        then(job())
        return True

    outlet = PulseOutlet(lambda pulse_pose: b"", lambda delivered: None, disk)
    outlet.flight(str(tmp_path), resumed=True)
    for second in range(3):  # its database is still being made
        outlet.tick(second * 1_000_000_000)
    assert len(reads) == 3
    tmp_path.rmdir()
    for second in range(3, 10):
        outlet.tick(second * 1_000_000_000)
    assert len(reads) == 4


def test_a_checksum_in_the_making_is_dropped_when_the_server_closes(tmp_path: Path) -> None:
    (tmp_path / "flight").write_bytes(b"pulses")
    waiting: list[Callable[[], None]] = []

    def later(job: Callable[[], Any], then: Callable[[Any], None]) -> bool:
        waiting.append(lambda: then(job()))
        return True

    server = FileServer(FileTree(tmp_path), disk=later)
    asked = FtpPacket(sequence=1, session=0, opcode=Opcode.CALC_FILE_CRC32, data=b"/flight")
    server.receive(asked.encode(), Peer(255, 190), 0)
    waiting.pop()()  # it is open
    server.work()
    waiting.pop()()  # all of it is read
    server.work()  # whether that was the end is being asked
    end = waiting.pop()
    server.close()
    end()
    (close,) = waiting  # once
    close()
