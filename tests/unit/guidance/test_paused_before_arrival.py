"""ArduCopter's pause shows in no message, also just before the drone would have arrived."""

import math
from typing import Any

import pytest
from flown import Flown
from some import some

from uavrt.guidance.autopilot_behaviour import BEHAVIOURS
from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.operator_orders import Limits
from uavrt.simulation.vehicle.airframe import Frame

STANDS_M_S = 0.1


def surveying(**made: Any) -> Flown:
    flown = Flown("ardupilot", **made)
    flown.run(1.5)
    corners = ((60.0, 0.0), (60.0, 60.0), (0.0, 60.0))
    flown.order("survey", places=tuple(flown.place(*one) for one in corners), spacing_m=20.0)
    return flown


def left_m(flown: Flown) -> float:
    target = some(flown.vehicle.target)
    north, east = flown.vehicle.body.place_m
    return math.hypot(target.north_m - north, target.east_m - east)


@pytest.mark.parametrize("near_m", [11.0, 10.0, 9.0])
def test_a_pause_metres_before_a_corner_ends_the_order_and_no_command_follows(
    near_m: float,
) -> None:
    """It may stand nearer than the 3 m at which orders go on."""
    flown = surveying()
    flown.run(40.0, until=lambda: bool(flown.commands) and left_m(flown) < near_m)
    assert flown.authority.standing is ControlStage.IN_COMMAND
    flown.pause_by_193()
    sent = len(flown.commands)
    flown.run(5.0, until=lambda: math.hypot(*flown.vehicle.body.velocity_m_s) < STANDS_M_S)
    assert 0.9 < left_m(flown) < 3.0
    flown.run(4.0, until=lambda: flown.authority.standing is ControlStage.OUT)
    assert flown.authority.reason == "the drone has stopped before its target"
    flown.run(20.0)
    assert len(flown.commands) == sent


@pytest.mark.parametrize("wind_m_s", [0.0, 8.0])
def test_a_drone_that_holds_in_wind_is_not_taken_for_paused(wind_m_s: float) -> None:
    flown = Flown("ardupilot", frame=Frame(wind_m_s=(wind_m_s, 0.0), gust_m=0.3))
    flown.run(1.5)
    flown.order("goto", places=(flown.place(50.0, 20.0),), height_m=40.0)
    flown.run(90.0, until=lambda: flown.authority.standing is ControlStage.OUT)
    assert flown.authority.reason == "done"
    flown.order("hold", duration_s=60.0)
    flown.run(90.0, until=lambda: flown.authority.standing is ControlStage.OUT)
    assert flown.authority.reason == "done"


@pytest.mark.parametrize("gain_hz", [0.3, 0.5])
def test_a_slow_last_approach_is_flown_to_its_end(gain_hz: float) -> None:
    flown = surveying(frame=Frame(position_gain_hz=gain_hz))
    flown.run(300.0, until=lambda: flown.authority.standing is ControlStage.OUT)
    assert flown.authority.reason == "done"
    assert flown.refused < 10


def approaching(limits: Limits | None = None) -> Flown:
    """On a slow last approach: within 3 m of the first corner, and not at rest."""
    flown = surveying(frame=Frame(position_gain_hz=0.3), limits=limits)
    flown.run(60.0, until=lambda: bool(flown.commands) and left_m(flown) < 2.5)
    assert left_m(flown) > 1.5
    return flown


def test_a_low_battery_sends_the_drone_home_also_on_a_slow_last_approach() -> None:
    flown = approaching()
    flown.vehicle.body.used_wh = 0.8 * flown.vehicle.body.frame.battery_wh
    flown.run(2.0, until=lambda: flown.authority.standing is ControlStage.OUT)
    assert flown.vehicle.mode in BEHAVIOURS["ardupilot"].return_modes


def test_a_lost_link_sends_the_drone_home_also_on_a_slow_last_approach() -> None:
    flown = approaching(Limits(battery_wh=120.0, link_lost="return"))
    flown.ground_silent_s = 10.0
    flown.run(2.0, until=lambda: flown.authority.standing is ControlStage.OUT)
    assert flown.vehicle.mode in BEHAVIOURS["ardupilot"].return_modes


def test_a_pause_while_it_climbs_over_its_place_shows_within_four_seconds() -> None:
    """The bearing of a place beneath the drone turns with each gust, which is no progress."""
    flown = Flown("ardupilot", frame=Frame(gust_m=0.05))
    flown.run(1.5)
    flown.order("goto", places=(flown.place(0.0, 0.0),), height_m=70.0)
    flown.run(20.0, until=lambda: flown.vehicle.body.velocity_m_s[2] > 1.0)
    flown.run(2.0)
    flown.pause_by_193()
    flown.run(1.0, until=lambda: math.hypot(*flown.vehicle.body.velocity_m_s) < STANDS_M_S)
    flown.run(4.0, until=lambda: flown.authority.standing is ControlStage.OUT)
    assert flown.authority.reason == "the drone has stopped before its target"
