"""A flight whose tag is found off its label, and the buttons that correct it."""

import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import made
from asked_page import Answer, AskedPage

from uavrt.config.tags.tag_files import read_tags
from uavrt.core.messages import Beep, Tag
from world import THESIS_TAG, World

HERE_HZ, AWAY_HZ = 148_710_000.0, 148_710_640.0
ROW = {"id": 2, "frequency_mhz": 148.71, "interval_ms": 1254, "pulse_width_ms": 20}
CORRECT = {"tag_id": 2, "frequency_hz": AWAY_HZ}
SLOW = {"attitude_rate_hz": 10.0}
"""Poses play no part here, and cost time."""
UNDO = {"tag_id": 2, "undo": True}


async def press(page: AskedPage, request: dict[str, Any]) -> Answer:
    return await page.ask("POST", "/api/commands/correct_tag", request)


def listed(page: AskedPage) -> Tag:
    (tag,) = read_tags(page.directory / "tags.toml")
    return tag


def listed_hz(page: AskedPage) -> float:
    return listed(page).frequency_hz


def off_label(world: World, **changed: Any) -> Beep:
    named: dict[str, Any] = {
        "frequency_hz": AWAY_HZ,
        "tag_ids": (2,),
        "offsets_hz": (AWAY_HZ - HERE_HZ,),
    }
    return made.beep(time_ns=world.clock.now_ns(), **(named | changed))


async def flown(world: World, page: AskedPage, *, sent_by_page: bool = True) -> None:
    """Begin a flight, and find its tag off its label."""
    await page.until(lambda state: state["drone"]["state"] == "idle")
    assert (await page.ask("PUT", "/api/tags", [ROW])).status == 200
    if sent_by_page:
        for name in ("send_tags", "start"):
            assert (await page.ask("POST", f"/api/commands/{name}", {})).status == 200
    else:
        world.detect(THESIS_TAG)
    await page.until(lambda state: state["drone"]["state"] == "detecting")
    world.beeps.append(off_label(world))
    state = await page.until(lambda state: len(state["beeps"]) == 1)
    assert state["beeps"][0]["corrects"] == [{"tag_id": 2, "what": "frequency"}]


@contextlib.asynccontextmanager
async def flight_off_label(
    directory: Path, *, sent_by_page: bool = True
) -> AsyncIterator[tuple[World, AskedPage]]:
    """Run a drone and its page, in a flight that has found the tag off its label."""
    world = World(directory, mavlink=SLOW)
    page = AskedPage(directory / "ground", world.ground_address)
    async with world.flying(), page.served():
        await flown(world, page, sent_by_page=sent_by_page)
        yield world, page
