"""The file server against clients that share no code with it."""

import asyncio
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from command_line import python
from mavproxy import mavproxy
from tests.unit.mavlink.test_ftp import CONTENT, flights_fixture  # noqa: F401  # fixture
from until import until, until_async

from uavrt.link.mavlink.services.ftp_wire import checksum
from world import World


@pytest.fixture
def world(make_world: Callable[..., World], flights: Path) -> World:
    return make_world(flights=flights)


async def test_mavsdk_lists_downloads_and_compares(world: World, tmp_path: Path) -> None:
    import mavsdk
    from mavsdk.plugins.ftp import Ftp

    def client() -> None:
        kind = mavsdk.ComponentType.GROUND_STATION
        sdk = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(kind))
        try:
            sdk.add_any_connection(f"udpin://127.0.0.1:{world.ground_port}")
            until(lambda: sdk.get_systems() and 191 in sdk.get_systems()[0].component_ids())
            ftp = Ftp(sdk.get_systems()[0])
            ftp.set_target_compid(191)
            listing = ftp.list_directory("/flight_log_1")
            assert {"flight.sqlite", "empty.txt"} <= names_in(listing)
            for burst in (False, True):
                place = tmp_path / f"mavsdk{burst}"
                place.mkdir()
                download(ftp, "/flight_log_1/flight.sqlite", place, burst)
                assert (place / "flight.sqlite").read_bytes() == CONTENT
            local = str(tmp_path / "mavsdkTrue" / "flight.sqlite")
            assert ftp.are_files_identical(local, "/flight_log_1/flight.sqlite")
        finally:
            sdk.destroy()

    async with world.flying():
        await asyncio.to_thread(client)
        # Opcode 16, and an end of a session that listing did not open.
        await until_async(lambda: world.counter("ftp_refused") == 2)
        assert world.autopilot.counters()["dropped_to_ground"] == 0


def names_in(listing: Any) -> set[str]:
    return set(re.findall(r"[\w.]+", str([vars(entry) for entry in listing.entries])))


async def test_pymavlinks_client_lists_and_reads(world: World, tmp_path: Path) -> None:
    local = tmp_path / "got.bin"

    def client() -> str:
        finished = python("-c", PYMAVLINK_CLIENT, str(world.ground_port), local, timeout=110)
        return finished.stdout + finished.stderr

    async with world.flying():
        said = await asyncio.to_thread(client)
        assert local.exists(), said
        assert "flight.sqlite" in said
        assert world.autopilot.counters()["dropped_to_ground"] == 0
    assert local.read_bytes() == CONTENT


PYMAVLINK_CLIENT = """
import os, sys, time
os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil, mavftp
link = mavutil.mavlink_connection(
    f"udpin:127.0.0.1:{sys.argv[1]}", source_system=255, source_component=190
)
deadline = time.monotonic() + 60
while time.monotonic() < deadline:
    link.mav.heartbeat_send(6, 8, 0, 0, 4)
    message = link.recv_match(type="HEARTBEAT", blocking=True, timeout=1)
    if message is not None and message.get_srcComponent() == 191:
        break
ftp = mavftp.MAVFTP(link, 1, 191)
ftp.cmd_list(["/flight_log_1"])
reply = ftp.process_ftp_reply("ListDirectory", timeout=30)
print([entry.name for entry in ftp.list_result])
ftp.cmd_get(["/flight_log_1/flight.sqlite", sys.argv[2]])
result = ftp.process_ftp_reply("OpenFileRO", timeout=60)
print(vars(result))
"""


MAVPROXY_COMMANDS = """\
module load ftp
vehicle 1:191
ftp list /flight_log_1
ftp crc /flight_log_1/flight.sqlite
ftp get /flight_log_1/flight.sqlite {local}
"""


async def test_mavproxy_lists_compares_and_reads(world: World, tmp_path: Path) -> None:
    pytest.importorskip("MAVProxy", reason="the extra peer MAVProxy is not installed")
    local = tmp_path / "got.bin"

    def client() -> str:
        return mavproxy(
            world.ground_port,
            MAVPROXY_COMMANDS.format(local=local),
            tmp_path,
            done=lambda: local.exists() and local.stat().st_size == len(CONTENT),
            patience_s=80.0,
        )

    async with world.flying():
        said = await asyncio.to_thread(client)
        assert "flight.sqlite" in said, said
        assert f"0x{checksum(CONTENT):08x}" in said.lower(), said
        assert local.exists(), said
    assert local.read_bytes() == CONTENT


def download(ftp: Any, remote: str, place: Path, burst: bool) -> None:
    from mavsdk.plugins.ftp.ftp import FtpResult

    done = threading.Event()
    failed: list[str] = []

    def progress(result: Any, data: Any, *_: Any) -> None:
        result = FtpResult(result)
        if result is not FtpResult.NEXT:
            if result is not FtpResult.SUCCESS:
                failed.append(result.name)
            done.set()

    ftp.download_async(remote, str(place), burst, progress)
    assert done.wait(60.0)
    assert not failed
