"""A drone whose processes are killed in flight: on the ground it stays one flight."""

import asyncio
from pathlib import Path

from asked_page import AskedPage

from world import World


async def test_a_killed_connection_does_not_end_the_flight_on_the_ground(
    tmp_path: Path,
) -> None:
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
