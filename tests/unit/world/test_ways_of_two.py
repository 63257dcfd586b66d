"""Two drones that search at once get their paths in turn from their common ground station."""

import asyncio
from functools import partial
from pathlib import Path

import made
import pytest
from asked_page import AskedPage
from searched import Animal

from uavrt.core.messages import Neighbour
from uavrt.simulation.demo.demo_programs import free_udp_port
from world import HOME, World, until

GUIDANCE = {"battery_wh": 120.0, "speed_m_s": 8.0, "keep_away_m": 30.0}


def hovering(directory: Path, number: int, port: int) -> World:
    """Make the world of one of the drones, 110 m north of the one before."""
    return World(
        directory / str(number),
        animals=[Animal(90.0, 60.0, level_db=42.0)],
        ground_port=port,
        system_id=number,
        guidance=GUIDANCE,
        flies=True,
        vehicle=partial(
            made.pose, latitude_deg=HOME[0] + 0.001 * number, longitude_deg=HOME[1]
        ),
    )


async def search(page: AskedPage, base: str, world: World, height_m: float) -> None:
    """Begin a search from a page."""
    world.detect(*world.tags)
    await until(lambda: "detector-1" in world.health)
    area = {"radius_m": 150, "accuracy_m": 12, "height_m": height_m, "duration_s": 240}
    wish = {"action": "search", **area}
    offer = (await page.ask("POST", f"{base}/api/motion/ask", wish)).json
    yes = {"order_id": offer["order_id"], "sticks_unseen": True}
    assert (await page.ask("POST", f"{base}/api/motion/confirm", yes)).status == 200


@pytest.mark.slow
async def test_drones_that_search_get_their_ways_in_turn(tmp_path: Path) -> None:
    port = free_udp_port()
    one, two = (hovering(tmp_path, number, port) for number in (1, 2))

    def granted() -> bool:
        return all(any(word.granted for word in world.of(Neighbour)) for world in (one, two))

    page = AskedPage(tmp_path / "ground", f"udpin://127.0.0.1:{port}")
    async with page.served(), one.flying():
        await page.until(lambda state: state["drone"]["system_id"] == 1)
        async with two.flying():
            await page.until(lambda state: state["drone"]["others"] == [2])
            await asyncio.sleep(5.0)  # by then the drones know their autopilots
            assert not one.of(Neighbour), "a vehicle that is not served is no neighbour"
            await page.ask("POST", "/api/vehicles", {"system_id": 2})
            second = "/vehicle/2"
            await page.until(lambda state: state["motion"], f"{second}/api/state")
            await search(page, "", one, 40.0)
            await search(page, second, two, 60.0)
            await until(granted, 240.0)
    for world, other in ((one, 2), (two, 1)):
        words = world.of(Neighbour)
        assert {word.vehicle for word in words} <= {0, other}
        assert any(word.course is not None and word.course.searching for word in words)
