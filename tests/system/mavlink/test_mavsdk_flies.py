"""A client that nobody here wrote flies the simulated autopilot: MAVSDK, as a pilot does."""

import asyncio
from typing import Any

import made
import pytest
from mavsdk.asyncio.mavsdk import Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.plugins.action import ActionError
from mission_wire import OWN, VEHICLE, MissionWire
from until import until_async as until

from uavrt.core.clock import Clock
from uavrt.core.messages import KeepOut, VehicleFence
from uavrt.guidance.files.mission import MissionItem, difference, survey_items
from uavrt.guidance.files.plan_file import survey_file
from uavrt.guidance.operator_orders import Order
from uavrt.guidance.plans import survey_places
from uavrt.link.mavlink.autopilot.mission_transfer import MissionUpload
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.fake_autopilot import AutopilotSettings, FakeAutopilot
from uavrt.simulation.vehicle.simulated_flying import MODES

FENCE = VehicleFence(
    within=(KeepOut(places=((46.4, 7.9), (46.4, 8.1), (46.6, 8.0))),),
    keep_out=(KeepOut(places=((46.5, 8.0),), radius_m=25.0),),
)
QUICK = Frame(speed_m_s=20.0, climb_m_s=12.0, acceleration_m_s2=10.0)


async def reads_our_survey(system: Any, autopilot: FakeAutopilot, flavour: Flavour) -> None:
    """A survey that we have saved, as MAVSDK uploads it, and a fence that we have drawn."""
    field = ((46.5, 8.0), (46.5, 8.002), (46.501, 8.002), (46.501, 8.0))
    order = Order(order_id=0, action="survey", places=field, height_m=60.0, spacing_m=50.0)
    raw = MissionRawAsync(system)
    told = await raw.import_qgroundcontrol_mission_from_string(survey_file(order, 5.0))
    wanted = survey_places(order, field[0])
    home_first = int(flavour == "ardupilot")  # its item 0
    *ways, home = told.mission_items[home_first:]
    assert [one.command for one in ways] == [16] * len(wanted)
    assert home.command == 20
    for one, place in zip(ways, wanted, strict=True):
        assert (one.x / 1e7, one.y / 1e7) == pytest.approx(place, abs=2e-7)
        assert (one.z, one.frame) == (60.0, 3)
    await raw.upload_mission(told.mission_items)
    held = [held_item(one) for one in autopilot.missions.held[0]]
    assert difference(survey_items(order), held[home_first:]) is None
    assert [one.command for one in await raw.download_mission()] == [
        one.command for one in told.mission_items
    ]
    wire = MissionWire(flavour)
    wire.store = autopilot.missions
    wire.run(MissionUpload(made.fence_items(FENCE), "fence", VEHICLE, OWN))
    corners = await raw.download_geofence()
    assert [(one.command, one.x, one.y) for one in corners] == [
        (one.command, one.x, one.y) for one in made.fence_items(FENCE)
    ]
    raw.destroy()


def held_item(item: Any) -> MissionItem:
    params = (item.param1, item.param2, item.param3, item.param4)
    return MissionItem(
        command=item.command, frame=item.frame, params=params, x=item.x, y=item.y, z=item.z
    )


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_mavsdk_arms_takes_off_goes_there_holds_and_returns(
    world: Any, flavour: Flavour
) -> None:
    port = free_udp_port()
    clock = Clock.start()
    autopilot = FakeAutopilot(
        world.vehicle,
        AutopilotSettings(
            companion=("127.0.0.1", free_udp_port()),
            ground=("127.0.0.1", port),
            flavour=flavour,
            flies=True,
            on_ground=True,
        ),
        clock,
    )
    assert autopilot.flown is not None
    vehicle = autopilot.flown.vehicle
    vehicle.body.frame = QUICK
    modes = MODES[flavour]
    flying = asyncio.create_task(autopilot.run())
    configuration = Configuration.create_manual(255, 190, True)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        system = await mavsdk.first_autopilot(timeout_s=60.0)
        await reads_our_survey(system, autopilot, flavour)
        action = ActionAsync(system)
        await action.set_takeoff_altitude(4.0)
        if flavour == "ardupilot":
            with pytest.raises(ActionError):  # not armed
                await action.takeoff()
            assert vehicle.ground.landed
        await action.arm()
        assert vehicle.armed
        await action.takeoff()
        await until(lambda: vehicle.body.height_m > 3.0)
        await until(lambda: vehicle.mode == modes["hold"])
        north, east = vehicle.plane.to_geodetic(15.0, 10.0)
        await action.goto_location(north, east, vehicle.plane.altitude_amsl_m + 20.0, 0.0)
        await until(
            lambda: abs(vehicle.body.north_m - 15.0) + abs(vehicle.body.east_m - 10.0) < 3.0
        )
        await until(lambda: abs(vehicle.body.height_m - 20.0) < 3.0)
        await action.hold()
        assert vehicle.mode == modes["hold" if flavour == "px4" else "brake"]
        await action.return_to_launch()
        assert vehicle.mode == modes["return"]
        assert vehicle.target is not None
        assert (vehicle.target.north_m, vehicle.target.east_m) == (0.0, 0.0)
        action.destroy()
    configuration.destroy()
    flying.cancel()
