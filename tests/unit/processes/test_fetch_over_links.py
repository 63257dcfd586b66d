"""Files from the drone through autopilot and radio, or over Wi-Fi, with real sockets."""

import random
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from uavrt.ground.fetch.drone_files import DroneFiles
from uavrt.ground.fetch.ftp_client import PART_SUFFIX, RemoteEntry, fetch_file

Bay = Any  # tests/unit/processes/conftest.py
Until = Callable[..., Awaitable[None]]

CONTENT = random.Random(8).randbytes(9_003)
ENTRY = RemoteEntry(path="/flight_log_1/flight.sqlite", size=len(CONTENT))


def put_flight(tmp_path: Path) -> Path:
    directory = tmp_path / "flight_log_1"
    directory.mkdir()
    (directory / "flight.sqlite").write_bytes(CONTENT)
    return tmp_path / "ground" / "flight.sqlite"


async def test_a_fetch_through_a_lossy_radio_is_interrupted_goes_on_and_is_right(
    bay: Bay, tmp_path: Path
) -> None:
    place = put_flight(tmp_path)
    part = place.with_name(place.name + PART_SUFFIX)
    bay.autopilot_settings = replace(bay.autopilot_settings, ground_loss=0.2, seed=4)
    address = f"udpin://127.0.0.1:{bay.ground_port}"

    class Interrupted(Exception):
        pass

    def interrupt(done: int, size: int) -> None:
        if done > 2_500:
            raise Interrupted

    async with bay.running():
        with pytest.raises(Interrupted):
            async with DroneFiles(bay.clock.now_ns).open(address) as client:
                await fetch_file(client, ENTRY, place, interrupt)
        kept = part.stat().st_size
        assert 2_500 < kept < len(CONTENT)
        assert part.read_bytes() == CONTENT[:kept]
        before = bay.counter("ftp_bytes")
        async with DroneFiles(bay.clock.now_ns).open(address) as client:
            assert await fetch_file(client, ENTRY, place)
        assert place.read_bytes() == CONTENT
        counters = bay.autopilot.counters()
        assert counters["lost_ground_link"] > 0
        assert counters["dropped_to_ground"] == 0  # paced: the ring of PX4 lost nothing
        # What was here was not sent again, but for what the radio lost.
        assert bay.counter("ftp_bytes") - before < 2.0 * (len(CONTENT) - kept)


async def test_a_fetch_takes_the_quicker_link_and_goes_on_by_radio_when_that_is_cut(
    two_link_bay: Bay, tmp_path: Path
) -> None:
    bay, place = two_link_bay, put_flight(tmp_path)
    radio = f"udpin://127.0.0.1:{bay.ground_port}"
    bay.autopilot_settings = replace(bay.autopilot_settings, ground_jitter_s=0.1)
    async with bay.relay.running() as wifi, bay.running():
        files = DroneFiles(bay.clock.now_ns)

        def cut(done: int, size: int) -> None:
            if done > len(CONTENT) // 2:
                wifi.cut = True

        async with files.open(radio, f"udpout://127.0.0.1:{wifi.port}") as client:
            assert files.link == 1
            assert await fetch_file(client, ENTRY, place, cut)
            assert files.link == 0
        assert place.read_bytes() == CONTENT
