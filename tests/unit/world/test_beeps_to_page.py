"""What beeps beside the list travels from the drone to the page, and corrects the list."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import made
from asked_page import AskedPage

from uavrt.config.tags.tag_files import read_tags
from uavrt.core.messages import Beep, BeepKind
from uavrt.flight.reading.flight_reader import read_beeps
from world import THESIS_TAG, World, until

OFF_LABEL = made.beep(
    BeepKind.OFF_LABEL, frequency_hz=148_710_640.0, tag_ids=(2,), offsets_hz=(640.0,)
)
UNLISTED = made.beep(BeepKind.UNLISTED, frequency_hz=148_935_200.0, interval_s=1.102)
ROW = {"id": 2, "frequency_mhz": 148.71, "interval_ms": 1254, "pulse_width_ms": 20}


def found(count: int) -> Any:
    return lambda state: len(state["beeps"]) == count


def present(beep: Beep, world: World) -> Beep:
    return replace(beep, time_ns=world.clock.now_ns())


async def test_all_that_beeps_reaches_page_and_flights_over_a_bad_link(tmp_path: Path) -> None:
    world = World(tmp_path)
    page = AskedPage(tmp_path / "ground", world.ground_address)
    async with world.flying(), page.served():
        await page.until(lambda state: state["drone"]["state"] == "idle")
        world.detect()
        await page.until(lambda state: state["drone"]["state"] == "detecting")
        world.radio.loss = 0.3
        world.beeps.extend(present(one, world) for one in (OFF_LABEL, UNLISTED))
        world.find_pulse(0)
        state = await page.until(found(2))
        meanings = {one["meaning"] for one in state["beeps"]}
        assert meanings == {"tag 2, 640 Hz above its label", "unlisted"}
        newer = replace(UNLISTED, pulses=40, frequency_hz=148_935_210.0)
        world.beeps.append(present(newer, world))
        await page.until(lambda state: 40 in (one["pulses"] for one in state["beeps"]))
        wanted = {(BeepKind.OFF_LABEL, 12), (BeepKind.UNLISTED, 40)}
        for directory in (page.directory, world.directory / "drone"):
            await until(partial(has_recorded, directory, wanted))


def has_recorded(directory: Path, wanted: set[tuple[BeepKind, int]]) -> bool:
    """Compare kinds and pulses with the only flight; the drone repeats what came before it."""
    flights = [path.parent for path in directory.glob("*/flight.sqlite")]
    found = {(one.kind, one.pulses) for flight in flights for one in read_beeps(flight)}
    return found == wanted


async def test_what_was_not_measured_corrects_nothing(tmp_path: Path) -> None:
    world = World(tmp_path)
    page = AskedPage(tmp_path / "ground", world.ground_address)
    async with page.served():
        assert (await page.ask("PUT", "/api/tags", [ROW])).status == 200
        requests: tuple[object, ...] = (
            {"tag_id": 2, "frequency_hz": 148_710_640.0},
            {"tag_id": 4, "frequency_hz": 148_710_640.0},
            {"tag_id": 2, "undo": True},
            {"tag_id": 2},
            [],
        )
        for request in requests:
            answer = await page.ask("POST", "/api/commands/correct_tag", request)
            assert answer.status in (400, 422), answer.json
        (listed,) = read_tags(page.directory / "tags.toml")
        assert listed.frequency_hz == THESIS_TAG.frequency_hz


async def test_of_a_flood_the_page_keeps_tags_and_the_strongest(tmp_path: Path) -> None:
    world = World(tmp_path)
    page = AskedPage(tmp_path / "ground", world.ground_address)
    many = [
        replace(UNLISTED, frequency_hz=148e6 + 1e3 * n, time_ns=n, pulses=8 + n)
        for n in range(100)
    ]
    async with page.served():
        session = page.session
        session.vehicle.begin_flight()
        for one in (OFF_LABEL, *many):
            session.reception.receive_event(one)
        state = await page.state()
        assert [one["pulses"] for one in state["beeps"]] == [12, *range(77, 108)]
        session.vehicle.flight.keeper.queue.commit()
        await session.vehicle.flight.keeper.queue.settle(5.0)
    restarted = AskedPage(tmp_path / "ground", world.ground_address)
    async with restarted.served():
        state = await restarted.state()
        assert len(state["beeps"]) == 32
        assert state["beeps"][0]["tag_ids"] == [2]
