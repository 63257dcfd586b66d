"""Motion by the page's server, from a request to the vehicle that flies."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from asked_page import AskedPage
from searched import Animal

from uavrt.core.messages import MotionRequest
from world import HOME, World, until

GUIDANCE = {"battery_wh": 120.0, "fence_m": 300.0}
SQUARE = [
    [HOME[0] + north, HOME[1] + east]
    for north, east in ((0.0, 0.0), (0.0, 0.002), (0.001, 0.002), (0.001, 0.0))
]
MISSION = {"action": "survey", "places": SQUARE, "spacing_m": 40, "height_m": 60}


@contextlib.asynccontextmanager
async def flown(directory: Path) -> AsyncIterator[tuple[World, AskedPage]]:
    """A drone that hovers, and a page that has found it."""
    world = World(directory, animals=[Animal(60.0, 0.0)], guidance=GUIDANCE, flies=True)
    page = AskedPage(directory / "ground", world.ground_address)
    async with world.flying(), page.served():
        await page.until(lambda s: s["drone"]["present"] and s["motion"] is not None)
        await asyncio.sleep(5.0)  # by then the drone knows its autopilot
        yield world, page


async def motion(page: AskedPage, what: str, body: Any, **headers: str) -> Any:
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return await page.ask("POST", f"/api/motion/{what}", body, named)


async def test_a_motion_is_offered_confirmed_once_and_stopped(tmp_path: Path) -> None:
    async with flown(tmp_path) as (world, page):
        wish = {"action": "rotate", "duration_s": 40, "clockwise": False, "height_m": 45}
        offer = (await motion(page, "ask", wish)).json
        assert offer["text"].startswith("turn once to the left here at 45 m")
        (asked,) = world.of(MotionRequest)
        assert (asked.duration_s, asked.clockwise, asked.height_m) == (40.0, False, 45.0)
        state = await page.until(lambda state: state["motion"]["offer"] is not None)
        number = state["motion"]["offer"]["order_id"]
        assert number == offer["order_id"]
        assert (await motion(page, "confirm", {"order_id": number + 1})).status == 409
        yaw_deg = world.flown.heading.yaw_deg
        await asyncio.sleep(3.0)
        assert (world.vehicle_report.standing, world.flown.heading.yaw_deg) == ("out", yaw_deg)
        yes = {"order_id": number, "sticks_unseen": True}
        assert (await motion(page, "confirm", yes)).json["standing"] == "confirmed"
        assert (await motion(page, "confirm", yes)).status == 409
        await page.until(lambda state: state["motion"]["standing"] == "in command")
        await until(lambda: abs((world.flown.heading.yaw_deg - yaw_deg) % 360.0) > 20.0)
        assert (await motion(page, "stop", {})).status == 200
        await page.until(lambda state: state["motion"]["standing"] == "out")
        await asyncio.sleep(3.0)
        stands_at = world.flown.heading.yaw_deg
        await asyncio.sleep(10.0)
        assert world.flown.heading.yaw_deg == pytest.approx(stands_at, abs=0.01)


async def test_a_refusal_is_shown_in_the_drones_words(tmp_path: Path) -> None:
    async with flown(tmp_path) as (_, page):
        far = {"action": "goto", "places": [[HOME[0] + 0.01, HOME[1]]], "height_m": 45}
        answer = await motion(page, "ask", far)
        assert answer.status == 409
        assert "fence" in answer.json["error"]


async def test_only_the_page_that_commands_asks_and_each_takes_back(tmp_path: Path) -> None:
    async with flown(tmp_path) as (world, page):
        for name in ("first", "second"):
            page.session.commander.page_connected(name)
        refused = await motion(page, "ask", {"action": "hold"}, X_Page="second")
        assert refused.status == 409
        assert "another page is in command" in refused.json["error"]
        offer = await motion(page, "ask", {"action": "hold"}, X_Page="first")
        assert offer.status == 200
        page.session.commander.claim("second")
        # Whoever has taken command meanwhile confirms nothing that another has asked for.
        yes = {"order_id": offer.json["order_id"], "sticks_unseen": True}
        for name in ("second", "first"):
            assert (await motion(page, "confirm", yes, X_Page=name)).status == 409
        assert world.vehicle_report.standing == "out"
        assert (await motion(page, "stop", {}, X_Page="first")).status == 200


async def test_taking_back_waits_for_no_other_command(tmp_path: Path) -> None:
    """The tags are lost, and sent again after two seconds."""

    async with flown(tmp_path) as (world, page):
        row = {"frequency_mhz": 148.71, "interval_ms": 1254, "pulse_width_ms": 20, "id": 2}
        assert (await page.ask("PUT", "/api/tags", [row])).status == 200
        world.radio_cut()
        sending = asyncio.create_task(page.ask("POST", "/api/commands/send_tags", {}))
        await page.until(lambda state: state["busy"] is not None)
        world.radio_back()
        assert (await motion(page, "stop", {})).status == 200
        assert (await page.state())["busy"] is not None
        assert (await sending).status == 200


async def test_the_way_is_shown_before_anything_is_asked(tmp_path: Path) -> None:
    async with flown(tmp_path) as (world, page):
        wish = MISSION | {"height_m": None}
        lines = (await motion(page, "plan", wish)).json
        assert lines["way"][0] == pytest.approx(HOME, abs=1e-4)  # where the drone is
        assert len(lines["way"]) == 7
        assert lines["length_m"] == pytest.approx(3 * 182.0 + 2 * 37.0 + 20.0, rel=0.05)
        around = (await motion(page, "plan", wish | {"pattern": "around"})).json
        assert around["way"][1:] == [*SQUARE, SQUARE[0]]
        crossing = [SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3]]
        assert (await motion(page, "plan", wish | {"places": crossing})).status == 422
        circle = {"center": list(HOME), "radius_m": 50}
        assert len((await motion(page, "area", circle)).json["places"]) == 20
        assert not world.of(MotionRequest)


async def test_a_survey_becomes_the_vehicles_mission_and_nothing_is_asked_of_the_drone(
    tmp_path: Path,
) -> None:
    async with flown(tmp_path) as (world, page):
        answer = await motion(page, "upload", MISSION)
        assert answer.json == {"items": 7, "sent_again": 0}
        held = world.autopilot.missions.held[0]
        assert [item.command for item in held] == [16] * 6 + [20]
        assert not world.of(MotionRequest)


async def test_a_mission_that_is_none_or_is_flown_is_not_replaced(tmp_path: Path) -> None:
    async with flown(tmp_path) as (world, page):
        turns = await motion(page, "upload", MISSION | {"pattern": "points"})
        assert turns.status == 422
        assert "cannot contain turns" in turns.json["error"]
        assert (await motion(page, "upload", MISSION | {"height_m": None})).status == 422
        world.flown.set_mode(4 << 16 | 4 << 24)  # AUTO.MISSION
        await asyncio.sleep(2.5)
        replaced = await motion(page, "upload", MISSION)
        assert replaced.status == 409
        assert "would change its path" in replaced.json["error"]
        assert not world.autopilot.missions.held[0]


async def test_a_search_is_asked_for_with_its_area_and_its_wish(tmp_path: Path) -> None:
    async with flown(tmp_path) as (world, page):
        world.detect(*world.tags)
        await until(lambda: "detector-1" in world.health)
        wish = {"action": "search", "radius_m": 150, "accuracy_m": 30, "tags": [2]}
        offer = await motion(page, "ask", wish | {"duration_s": 300, "height_m": 50})
        assert offer.json["text"].startswith("search tag 2 in 6.9 ha at 50 m")
        (asked,) = world.of(MotionRequest)
        assert (asked.radius_m, asked.accuracy_m, asked.tags) == (150.0, 30.0, (2,))
        assert (asked.duration_s, asked.places) == (300.0, ())
