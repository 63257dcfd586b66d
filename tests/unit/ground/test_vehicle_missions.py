"""Surveys into the autopilot, and its fence out of it, over a link that loses a fifth."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any

import made
import pytest
from some import some

from uavrt.core.clock import Clock
from uavrt.core.errors import CommandRefused, FormatError, LinkError
from uavrt.core.messages import KeepOut, Pose, VehicleFence
from uavrt.ground.link.drone_link import GroundLink
from uavrt.guidance.files.mission import MissionItem, difference, survey_items
from uavrt.guidance.operator_orders import Order
from uavrt.link.mavlink import dialect
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt.simulation.vehicle.fake_autopilot import AutopilotSettings, FakeAutopilot

BOTH = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
FIELD = ((46.5, 8.0), (46.5, 8.002), (46.501, 8.002), (46.501, 8.0))
SURVEY = Order(order_id=0, action="survey", places=FIELD, height_m=60.0, spacing_m=30.0)
ITEMS = survey_items(SURVEY)
FENCE = VehicleFence(
    within=(KeepOut(places=((46.4, 7.9), (46.4, 8.1), (46.6, 8.0)), name="vehicle's fence"),),
    keep_out=(KeepOut(places=((46.5, 8.0),), radius_m=25.0, name="vehicle's fence"),),
)
AUTO = {"px4": 4 << 16 | 4 << 24, "ardupilot": 3}


def pose(time_ns: int) -> Pose:
    return made.pose(time_ns, 46.5, 8.0, altitude_amsl_m=840.0)


@asynccontextmanager
async def vehicle_on(
    flavour: Flavour, *, loss: float = 0.0, seed: int = 1
) -> AsyncIterator[tuple[GroundLink, FakeAutopilot]]:
    """A ground station's link to a vehicle that flies, once its autopilot is known."""
    port, clock = free_udp_port(), Clock.start()
    settings = AutopilotSettings(
        companion=("127.0.0.1", free_udp_port()),
        ground=("127.0.0.1", port),
        flavour=flavour,
        flies=True,
        ground_loss=loss,
        seed=seed,
    )
    autopilot = FakeAutopilot(pose, settings, clock)
    link = GroundLink(clock.now_ns, on_event=lambda event: None)
    tasks = [
        asyncio.create_task(autopilot.run()),
        asyncio.create_task(link.run(f"udpin://127.0.0.1:{port}")),
    ]
    try:
        await link.missions.wait(20.0)
        yield link, autopilot
    finally:
        for task in tasks:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task


def held(autopilot: FakeAutopilot, kind: int = 0) -> list[MissionItem]:
    return [
        MissionItem(
            command=one.command,
            frame=one.frame,
            params=(one.param1, one.param2, one.param3, one.param4),
            x=one.x,
            y=one.y,
            z=one.z,
        )
        for one in autopilot.missions.held[kind]
    ]


def holds(autopilot: FakeAutopilot, items: tuple[MissionItem, ...], kind: int = 0) -> None:
    """Let it hold some, as another ground station has uploaded them."""
    autopilot.missions.held[kind] = made.mission_items(items, kind)


@BOTH
@pytest.mark.parametrize("loss", [0.0, 0.2])
async def test_a_survey_becomes_the_vehicles_mission_and_moves_nothing(
    flavour: Flavour, loss: float
) -> None:
    for seed in range(1 if loss == 0.0 else 6):
        async with vehicle_on(flavour, loss=loss, seed=seed) as (link, autopilot):
            vehicle = some(autopilot.flown).vehicle
            before = (vehicle.mode, vehicle.target, vehicle.armed)
            done = await link.missions.upload(ITEMS)
            assert (vehicle.mode, vehicle.target, vehicle.armed) == before
            home_first = int(flavour == "ardupilot")
            assert difference(ITEMS, held(autopilot)[home_first:]) is None
        assert done.items == len(ITEMS)
        assert (done.sent_again == 0) == (loss == 0.0)
        assert done.strange == 0 or loss > 0.0


@BOTH
async def test_the_vehicles_fence_is_read(flavour: Flavour) -> None:
    async with vehicle_on(flavour, loss=0.2) as (link, autopilot):
        holds(autopilot, made.fence_items(FENCE), 1)
        assert await link.missions.fence() == FENCE


@BOTH
async def test_a_vehicle_that_flies_a_mission_is_given_none(flavour: Flavour) -> None:
    async with vehicle_on(flavour) as (link, autopilot):
        holds(autopilot, ITEMS[:3])
        some(autopilot.flown).vehicle.mode = AUTO[flavour]
        await asyncio.sleep(2.0)
        with pytest.raises(CommandRefused, match="would change its path"):
            await link.missions.upload(ITEMS)
        assert len(held(autopilot)) == 3


@BOTH
async def test_an_upload_ends_when_a_mission_is_started_meanwhile(flavour: Flavour) -> None:
    async with vehicle_on(flavour) as (link, autopilot):
        holds(autopilot, ITEMS[:3])
        upload = asyncio.create_task(link.missions.upload(ITEMS * 20))
        await asyncio.sleep(0.02)
        some(autopilot.flown).vehicle.mode = AUTO[flavour]
        autopilot.ground.inward._loss = 0.6  # it lasts longer than to the next heartbeat
        with pytest.raises(CommandRefused, match="would change its path"):
            await upload
        assert len(held(autopilot)) == 3


async def test_a_vehicle_that_falls_silent_is_reported() -> None:
    async with vehicle_on("px4") as (link, autopilot):
        autopilot.ground.inward._loss = 1.0
        with pytest.raises(LinkError, match="did not answer in 12 s"):
            await link.missions.fence()


async def test_what_is_no_fence_is_refused() -> None:
    async with vehicle_on("px4") as (link, autopilot):
        holds(autopilot, made.fence_items(FENCE)[:2], 1)
        with pytest.raises(FormatError, match="corner of the vehicle's fence is missing"):
            await link.missions.fence()


async def test_a_mission_not_held_as_sent_is_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    async with vehicle_on("px4") as (link, autopilot):
        taken = autopilot.missions._give

        def lower(message: Any, sender: Any, send: Any) -> None:
            def changed(item: Any) -> None:
                if isinstance(item, dialect.MissionItemInt) and item.seq == 2:
                    item.z = 6.0
                send(item)

            taken(message, sender, changed)

        monkeypatch.setattr(autopilot.missions, "_give", lower)
        with pytest.raises(CommandRefused, match="item 3 differs"):
            await link.missions.upload(ITEMS)


async def test_a_missing_autopilot_is_reported() -> None:
    link = GroundLink(Clock.start().now_ns, on_event=lambda event: None)
    with pytest.raises(LinkError, match="no message from an autopilot arrived"):
        await link.missions.wait(3.0)
    with pytest.raises(LinkError, match="no contact with the autopilot"):
        await link.missions.upload(ITEMS)
