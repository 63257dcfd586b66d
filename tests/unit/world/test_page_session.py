"""The page's server and a drone: what is shown, stored and judged."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from asked_page import AskedPage
from pulses import pulse_at

from uavrt.core.messages import Command
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.store.tag_table import table_version
from uavrt.ground.web.work.foreign_worker import ForeignWorker
from world import THESIS_TAG, World, until

SECOND_NS = NANOSECONDS_PER_SECOND


@contextlib.asynccontextmanager
async def flown(directory: Path) -> AsyncIterator[tuple[World, AskedPage]]:
    """A drone, and a page that has found it."""
    world = World(directory)
    page = AskedPage(directory / "ground", world.ground_address)
    async with world.flying(), page.served():
        await page.until(lambda state: state["drone"]["state"] == "idle")
        yield world, page


def find(world: World, old_s: float = 1.0, **changes: Any) -> None:
    """Let a detector find a pulse of some time ago."""
    start_ns = world.clock.now_ns() - round(old_s * SECOND_NS)
    frequency_hz = THESIS_TAG.frequency_hz
    world.to_find.append(replace(pulse_at(start_ns, frequency_hz=frequency_hz), **changes))


def pulses(count: int) -> Callable[[dict[str, Any]], bool]:
    return lambda state: bool(state["flight"]["pulses"] == count)


async def test_a_drones_state_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "uavrt.drone.processes.connection_parts.ground_status.cpu_temperature_c", lambda: 51.5
    )

    async with flown(tmp_path) as (_, page):
        state = await page.state()
        assert state["drone"]["cpu_temperature_c"] == 51.5
        assert state["actions"]["start"]["reason"] == "Send the tags first"


async def test_a_page_without_maps_starts_no_process_to_read_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    called: list[Any] = []

    async def note(_: ForeignWorker, *given: Any) -> None:
        called.append(given)

    async with flown(tmp_path) as (_, page):
        monkeypatch.setattr(ForeignWorker, "call", note)
        assert (await page.ask("GET", "/api/choices")).json["maps"] == []
        assert not called
        (page.directory / "maps").mkdir(exist_ok=True)
        (page.directory / "maps" / "sea.pmtiles").write_bytes(b"")
        await page.ask("GET", "/api/choices")
        assert called


async def test_a_start_and_a_stop_right_after_the_tags_are_taken(tmp_path: Path) -> None:
    """The drone's next periodic heartbeat is up to a second away."""
    async with flown(tmp_path) as (_, page):
        row = {"id": 2, "frequency_mhz": 148.7, "interval_ms": 1254, "pulse_width_ms": 20}
        headers = {"If-Match": f'"{table_version(page.session.vehicle.store.tags)}"'}
        saved = await page.ask("PUT", "/api/tags", [row], headers=headers)
        assert saved.status == 200, saved.json
        for name in ("send_tags", "start", "stop"):
            answer = await page.ask("POST", f"/api/commands/{name}", {})
            assert answer.status == 200, answer.json


async def test_a_pulse_is_stored_once_however_often_it_comes(tmp_path: Path) -> None:
    async with flown(tmp_path) as (world, page):
        world.detect()
        world.radio.copied = 1.0
        for place in range(5):
            find(world, 1.0 + place / 10)
        state = await page.until(pulses(5))
        assert state["flight"]["ended"] is False
        await asyncio.sleep(2.0)
        (one,) = (await page.ask("GET", "/api/flights")).json
        assert one["pulses"] == 5
        recorded = read_flight(page.directory / one["flight_id"])
        assert len(recorded.pulse_poses) == 5
        records = (await page.ask("GET", f"/api/flights/{one['flight_id']}/pulses")).json
        assert [record["snr_db"] for record in records] == [20.0] * 5
        assert state["link"]["counters"]["repeated_pulses"] >= 1


async def test_what_is_inside_a_burst_is_put_into_its_record(tmp_path: Path) -> None:
    async with flown(tmp_path) as (world, page):
        world.detect()
        await asyncio.sleep(3.0)
        # A time that the wire's seconds hold exactly, as the key of a pulse must be.
        start_ns = (world.clock.now_ns() // SECOND_NS - 1) * SECOND_NS
        starts_ns = tuple(start_ns + ms * 1_000_000 for ms in (0, 25, 80, 111))
        inside: dict[str, Any] = {
            "burst_starts_ns": starts_ns,
            "burst_snrs_db": (20.0, 20.5, 19.5, 20.0),
            "also_possible_tag_ids": (4,),
        }
        find(world, start_time_ns=start_ns, end_time_ns=start_ns + 131_000_000, **inside)
        await page.until(lambda state: state["link"]["counters"].get("BurstInside"))
        (one,) = (await page.ask("GET", "/api/flights")).json
        (record,) = (await page.ask("GET", f"/api/flights/{one['flight_id']}/pulses")).json
        assert record["burst_starts_ns"] == list(starts_ns)
        (stored,) = read_flight(page.directory / one["flight_id"]).pulse_poses
        assert {name: getattr(stored.pulse, name) for name in inside} == inside
        assert stored.pose is not None


async def test_a_drone_clock_that_is_an_hour_off_is_reported(tmp_path: Path) -> None:
    async with flown(tmp_path) as (world, page):
        world.detect()
        for place in range(6):
            find(world, 3600.0 + 7.0 * (place % 2) + place / 100)
        state = await page.until(pulses(6))
        assert state["drone"]["clock_skew_s"] == pytest.approx(3600.0, abs=15.0)
        log = (await page.ask("GET", "/api/log")).json
        assert any("clock differs by -360" in line["text"] for line in log)


async def test_old_pulses_sent_again_are_no_clock_that_is_late(tmp_path: Path) -> None:
    async with flown(tmp_path) as (world, page):
        world.detect()
        for old_s in (60, 50, 40, 30, 20, 1, 10):
            find(world, old_s)
        state = await page.until(pulses(7))
        assert state["drone"]["clock_skew_s"] == 0.0


async def test_another_start_is_another_flight(tmp_path: Path) -> None:
    async with flown(tmp_path) as (world, page):
        for number in (1, 2):
            world.detect()
            await page.until(lambda state: not state["flight"]["ended"])
            find(world, 0.1)
            await page.until(pulses(1))
            assert (await page.ask("POST", "/api/commands/stop", {})).status == 200
            await page.until(lambda state: state["flight"]["ended"])
            assert len((await page.ask("GET", "/api/flights")).json) == number
            await asyncio.sleep(2.0)


async def test_a_flight_that_ended_unheard_does_not_go_on(tmp_path: Path) -> None:
    """The station was away when the drone stopped; the next start is another flight."""
    world = World(tmp_path)
    async with world.flying():
        page = AskedPage(tmp_path / "ground", world.ground_address)
        async with page.served():
            world.detect()
            await page.until(lambda state: not state["flight"]["ended"])
            find(world, 0.1)
            await page.until(pulses(1))
        assert page.session.vehicle.store.current_flight is not None
        stop = Command(name="stop_detection", request_id=999, source="command line")
        assert world.computer.supervisor.command(stop).accepted
        await until(lambda: not world.mission.flights.ending)
        page = AskedPage(tmp_path / "ground", world.ground_address)
        async with page.served():
            await page.until(lambda state: state["drone"]["state"] == "has_tags")
            state = await page.state()
            assert state["flight"]["ended"]
            world.detect()
            await page.until(lambda state: not state["flight"]["ended"])
            find(world, 0.1)
            await page.until(pulses(1))
            assert len((await page.ask("GET", "/api/flights")).json) == 2


async def test_what_the_drone_says_is_kept_as_it_is(tmp_path: Path) -> None:
    async with flown(tmp_path) as (world, page):
        said = '<script>alert(1)</script> "quoted" & more'
        world.computer.supervisor._notify(4, said)
        await asyncio.sleep(1.0)
        log = (await page.ask("GET", "/api/log")).json
        (line,) = [line for line in log if line["text"] == said]
        assert (line["severity"], line["source"]) == (4, "drone")


async def test_a_second_drone_is_named_and_never_taken_unasked(tmp_path: Path) -> None:
    async with flown(tmp_path) as (world, page):
        world.detect()
        await page.until(lambda state: not state["flight"]["ended"])
        other = World(tmp_path / "other", ground_port=world.ground_port, system_id=2)
        async with other.flying():
            world.radio_cut()
            await page.until(lambda state: not state["drone"]["present"])
            other.detect()
            find(other)
            state = await page.until(lambda state: state["drone"]["others"] == [2])
            assert state["drone"]["system_id"] == 1
            assert not state["drone"]["present"]
            assert "No contact" in state["actions"]["stop"]["reason"]
            assert state["flight"]["pulses"] == 0
            world.radio_back()
            find(world)
            await page.until(pulses(1))
            log = (await page.ask("GET", "/api/log")).json
            told = (
                "messages of another vehicle, 2, also arrive; this page still serves vehicle 1"
            )
            assert told in [line["text"] for line in log]
            flight_id = state["flight"]["flight_id"]
            refused = await page.ask("POST", "/api/vehicle", {"system_id": "2"})
            assert refused.status == 422
            taken = await page.ask("POST", "/api/vehicle", {"system_id": 2})
            assert taken.json["system_id"] == 2
            state = await page.until(
                lambda state: (
                    state["flight"]["flight_id"] not in (None, flight_id)
                    and not state["flight"]["ended"]
                )
            )
            assert state["drone"]["system_id"] == 2


async def test_a_killed_connection_ends_no_flight_on_the_ground(tmp_path: Path) -> None:
    world = World(tmp_path)
    page = AskedPage(tmp_path / "ground", world.ground_address)
    async with world.flying(), page.served():
        await page.until(lambda state: state["drone"]["state"] == "idle")
        world.detect()
        await page.until(lambda state: state["drone"]["state"] == "detecting")
        for _ in range(3):
            world.kill("connection")
            await asyncio.sleep(4.3)
            state = await page.until(lambda one: one["drone"]["state"] == "detecting")
            assert state["flight"]["ended"] is False
        states = [one["text"] for one in (await page.ask("GET", "/api/log")).json]
        assert [one for one in states if one.startswith("the drone is")] == [
            "the drone is idle",
            "the drone is detecting",
        ]
        assert len((await page.ask("GET", "/api/flights")).json) == 1
