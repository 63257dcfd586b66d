"""Take-off by order: only from the ground, only armed by a pilot, only once confirmed."""

import math
from typing import Any

import pytest
from flown import HOME, Flown

from uavrt.core.errors import CommandRefused, PlanError
from uavrt.core.messages import FlyThere, GoHome, TakeMode, TakeOff
from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.control.vehicle_commands import VehicleCommand
from uavrt.guidance.operator_orders import Limits
from uavrt.guidance.safety import SAFETY
from uavrt.link.mavlink.autopilot.vehicle_messages import command_message
from uavrt.link.mavlink.dialect import MavResult
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt.simulation.vehicle.simulated_flying import MODES

BOTH = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])


def standing(flavour: Flavour, **values: Any) -> Flown:
    """A drone on the ground, armed by its pilot."""
    return Flown(flavour, on_ground=True, **values)


def taken_off(flown: Flown, height_m: float = 30.0) -> str | None:
    execution = flown.order("takeoff", height_m=height_m)
    flown.run(60.0, until=lambda: execution.ended is not None)
    return execution.ended


@BOTH
def test_it_climbs_straight_up_to_the_height_above_home_and_hovers(flavour: Flavour) -> None:
    flown = standing(flavour)
    assert taken_off(flown) == "done"
    flown.run(10.0)
    vehicle = flown.vehicle
    assert vehicle.body.height_m == pytest.approx(30.0, abs=1.0)
    assert math.hypot(vehicle.body.north_m, vehicle.body.east_m) < 1.0
    assert vehicle.mode == MODES[flavour]["hold"]
    last = flown.commands[-1][1]
    assert last.command == 22
    wanted = HOME.altitude_amsl_m + 30.0 if flavour == "px4" else 30.0
    assert last.param7 == pytest.approx(wanted, abs=0.01)
    assert [one.command for _, one in flown.commands] == [176, 22][flavour == "px4" :]
    assert flown.authority.reason == "done"


@BOTH
def test_nobody_ever_arms_but_the_pilot(flavour: Flavour) -> None:
    flown = standing(flavour)
    flown.vehicle.armed = False
    flown.run(1.2)
    with pytest.raises(CommandRefused, match="not armed") as refused:
        flown.order("takeoff", height_m=30.0)
    assert "uavrt never arms" in str(refused.value)
    assert not flown.commands


@BOTH
def test_a_drone_that_may_not_take_off_does_not(flavour: Flavour) -> None:
    flown = standing(flavour, may_take_off=False)
    with pytest.raises(CommandRefused, match="may not take off by itself") as refused:
        flown.order("takeoff", height_m=30.0)
    assert "may_take_off" in str(refused.value)


@BOTH
def test_a_confirmed_take_off_that_does_not_begin_in_ten_seconds_never_does(
    flavour: Flavour,
) -> None:
    flown = standing(flavour)
    execution = flown.order("takeoff", height_m=30.0)
    flown.vehicle.ground.idle_s = -60.0
    flown.execution = None
    flown.run(10.5)
    assert flown.authority.reason == "the order did not begin within 10 s"
    flown.execution = execution
    flown.run(5.0)
    assert not flown.commands
    assert flown.vehicle.ground.landed


@BOTH
def test_disarmed_before_the_command_leaves_nothing_waits_for_the_next_arming(
    flavour: Flavour,
) -> None:
    flown = standing(flavour)
    execution = flown.order("takeoff", height_m=30.0)
    flown.execution, flown.vehicle.armed = None, False
    flown.run(1.2)
    assert flown.authority.reason == "the vehicle is disarmed"
    flown.execution, flown.vehicle.armed = execution, True
    flown.run(5.0)
    assert not flown.commands
    assert flown.vehicle.ground.landed


@BOTH
def test_in_the_air_there_is_no_take_off_and_on_the_ground_nothing_else(
    flavour: Flavour,
) -> None:
    with pytest.raises(CommandRefused, match="already in the air"):
        Flown(flavour).order("takeoff", height_m=60.0)
    with pytest.raises(CommandRefused, match="on the ground"):
        standing(flavour).order("hold", height_m=30.0)


@BOTH
def test_an_order_to_take_off_commands_nothing_else(flavour: Flavour) -> None:
    flown = standing(flavour)
    execution = flown.order("takeoff", height_m=30.0)
    flown.execution = None
    amsl = HOME.altitude_amsl_m + 30.0
    there = FlyThere(latitude_deg=47.1, longitude_deg=8.5, altitude_amsl_m=amsl)
    too_low = TakeOff(height_m=3.0, altitude_amsl_m=HOME.altitude_amsl_m + 3.0)
    two = TakeOff(height_m=30.0, altitude_amsl_m=amsl + 40.0)
    for manoeuvre in (there, GoHome(), too_low, two):
        with pytest.raises(CommandRefused):
            flown.authority.command(execution.order.order_id, manoeuvre, flown.time_s)
    wrong = TakeMode() if flavour == "px4" else TakeOff(height_m=30.0, altitude_amsl_m=amsl)
    with pytest.raises(CommandRefused):
        flown.authority.command(execution.order.order_id, wrong, flown.time_s)
    assert flown.authority.standing is ControlStage.CONFIRMED


@BOTH
def test_no_other_order_takes_off(flavour: Flavour) -> None:
    flown = Flown(flavour)
    execution = flown.order("hold")
    flown.execution = None
    amsl = HOME.altitude_amsl_m + 30.0
    for manoeuvre in (TakeMode(), TakeOff(height_m=30.0, altitude_amsl_m=amsl)):
        with pytest.raises(CommandRefused, match="another order was confirmed"):
            flown.authority.command(execution.order.order_id, manoeuvre, flown.time_s)


@pytest.mark.parametrize(
    ("height_m", "limits", "reason"),
    [
        (None, Limits(battery_wh=120.0), "needs a height|the least permitted is"),
        (5.0, Limits(battery_wh=120.0), "the least permitted is 20 m"),
        (150.0, Limits(battery_wh=120.0), "the most permitted is 120 m"),
        (30.0, Limits(), "battery capacity"),
    ],
)
def test_a_height_or_a_battery_that_does_not_do_is_refused(
    height_m: float | None, limits: Limits, reason: str
) -> None:
    flown = standing("px4", limits=limits)
    with pytest.raises(PlanError, match=reason):
        flown.order("takeoff", height_m=height_m)
    assert not flown.commands


@BOTH
def test_a_drone_that_is_held_down_is_given_up(flavour: Flavour) -> None:
    flown = standing(flavour)
    flown.order("takeoff", height_m=30.0)
    flown.run(3.2)
    flown.vehicle.body.frame = type(flown.vehicle.body.frame)(climb_m_s=0.0)
    flown.run(13.0)
    assert flown.authority.standing is ControlStage.OUT
    assert flown.authority.reason in (
        "the drone has stopped before its target",
        "the autopilot has not reported that it follows the command",
    )


@BOTH
def test_its_own_word_counts_more_than_its_height_above_home(flavour: Flavour) -> None:
    """Home may lie on a hill: 12 m above it the drone can stand on the ground."""
    flown = Flown(flavour)
    flown.vehicle.body.height_m, flown.vehicle.ground.landed = 12.0, True
    flown.run(1.2)
    with pytest.raises(CommandRefused, match="on the ground"):
        flown.order("hold", height_m=30.0)
    low = Flown(flavour)
    low.vehicle.body.height_m = 1.0
    low.run(1.2)
    low.order("hold", height_m=30.0)


@BOTH
@pytest.mark.parametrize(("height_m", "on_ground"), [(0.5, True), (12.0, False)])
def test_where_it_tells_nothing_its_height_counts(
    flavour: Flavour, height_m: float, on_ground: bool
) -> None:
    flown = Flown(flavour)
    flown.landed_told = False
    flown.vehicle.body.height_m = height_m
    flown.run(4.0)
    assert flown.authority.vehicle.on_ground(flown.time_s) is on_ground


@BOTH
def test_a_landing_ends_an_order(flavour: Flavour) -> None:
    flown = Flown(flavour)
    flown.order("goto", places=(flown.place(200.0, 0.0),), height_m=40.0)
    flown.run(3.0)
    flown.vehicle.ground.landed = True
    flown.run(0.6)
    assert flown.authority.reason == "the vehicle has landed"


@BOTH
def test_told_while_disarmed_px4_flies_at_the_next_arming_and_ardupilot_refuses(
    flavour: Flavour,
) -> None:
    """Why nothing is ever sent to a drone that is not armed."""
    vehicle = standing(flavour).vehicle
    vehicle.armed = False
    if flavour == "ardupilot":
        vehicle.set_mode(MODES[flavour]["hold"])
    command = VehicleCommand(name="NAV_TAKEOFF", z_m=HOME.altitude_amsl_m + 30.0)
    px4 = flavour == "px4"
    told: Any = command_message(command, 1)
    assert vehicle.command(told) == (MavResult.ACCEPTED if px4 else MavResult.FAILED)
    vehicle.armed = True
    for _ in range(60):
        vehicle.advance(0.1)
    assert (vehicle.body.height_m > 5.0) is px4


def begun_late(shows_flight_s: tuple[float, float], *, begins_s: float = 0.0) -> Flown:
    """A confirmed take-off whose guide begins late, after the autopilot showed a flight."""
    flown = standing("px4")
    ground = flown.vehicle.ground
    execution = flown.order("takeoff", height_m=30.0)
    flown.execution = None
    start_s = ground.idle_s
    ground.false_flight_s = (start_s + shows_flight_s[0], start_s + shows_flight_s[1])
    flown.run(begins_s)
    flown.execution = execution
    return flown


def test_a_take_off_waits_while_the_autopilot_reports_flight_after_arming() -> None:
    """PX4 1.17 does so for a second, once in ten take-offs, although the drone stands."""
    flown = begun_late((0.2, 1.4), begins_s=0.8)
    assert flown.authority.standing is not ControlStage.OUT
    flown.run(0.4)
    assert not flown.commands
    flown.run(60.0, until=lambda: flown.authority.standing is ControlStage.OUT)
    assert flown.authority.reason == "done"


def test_a_take_off_is_over_when_flight_is_reported_for_longer() -> None:
    flown = begun_late((0.2, 60.0), begins_s=4.0)
    assert flown.authority.reason == "the vehicle is already in the air"
    assert not flown.commands


def test_a_take_off_is_over_when_the_drone_rises_before_its_command() -> None:
    flown = begun_late((0.0, 60.0), begins_s=0.3)
    flown.execution = None
    flown.vehicle.body.height_m = SAFETY.takeoff_rise_m + 0.5
    flown.run(1.0)
    assert flown.authority.reason == "the vehicle is already in the air"
    assert not flown.commands
