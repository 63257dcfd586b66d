"""PX4's heading setpoint turns with inertia: a new target in a turn is no takeover."""

import math
from typing import Any

import pytest
from flown import Flown
from some import some

from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.control.yaw import FOREIGN_TURN
from uavrt.guidance.plans import Go
from uavrt.link.mavlink import dialect
from uavrt.simulation.vehicle.airframe import Frame
from uavrt.simulation.vehicle.vehicle_telemetry import target_message


def redirected(after_s: float, north_m: float, east_m: float) -> Flown:
    """A leg of a search that is replaced while the drone still turns towards it."""
    flown = Flown("px4", frame=Frame(speed_m_s=5.0, gust_m=0.02))
    flown.vehicle.heading.yaw_deg = flown.vehicle.heading.setpoint_deg = 340.0
    flown.run(1.2)
    execution = flown.order("goto", places=(flown.place(50.0, 20.0),), height_m=40.0)
    flown.run(3.0, until=lambda: flown.authority.obeyed)
    flown.run(after_s)
    now: Any = flown.now()
    execution.redirect([Go(place=flown.place(north_m, east_m), height_m=40.0)], now)
    flown.run(0.2)
    return flown


@pytest.mark.parametrize("after_s", [0.2, 0.4, 0.6, 0.8, 1.0])
@pytest.mark.parametrize("place", [(15.0, -21.0), (-20.0, -30.0), (30.0, 40.0)])
def test_a_leg_that_is_replaced_during_its_turn_is_flown(
    after_s: float, place: tuple[float, float]
) -> None:
    flown = redirected(after_s, *place)
    flown.run(60.0, until=lambda: flown.authority.standing is ControlStage.OUT)
    assert flown.authority.reason == "done"


@pytest.mark.parametrize("by_deg", [-15.0, -12.0, 12.0, 15.0])
def test_a_turn_at_our_target_by_another_is_seen_though_a_turn_was_going_on(
    by_deg: float,
) -> None:
    """The setpoint had already ended its own turn."""
    flown = redirected(0.6, 15.0, -21.0)
    flown.run(7.0)
    assert flown.authority.order_id is not None
    turn_at_our_target(flown, by_deg)
    sent = len(flown.commands)
    flown.run(2.0)
    assert flown.authority.standing is ControlStage.OUT
    assert len(flown.commands) == sent


def turn_at_our_target(flown: Flown, by_deg: float) -> None:
    """Another program asks for our target with another heading."""
    (_, last), setpoint = flown.commands[-1], some(target_message(flown.vehicle, 0))
    assert isinstance(last, dialect.CommandInt)
    flown._reposition(x=last.x, y=last.y, z=last.z, param4=setpoint.yaw + math.radians(by_deg))


@pytest.mark.parametrize("by_deg", [-12.0, 12.0])
@pytest.mark.parametrize("away_m", [0.3, 1.0, 1.5, 1.8, 2.3, 3.0, 4.0, 5.5])
def test_a_turn_by_another_before_our_corner_is_seen(away_m: float, by_deg: float) -> None:
    """The drone looks to the corner, and brakes; the survey's next leg is not commanded."""
    flown = Flown("px4", frame=Frame(speed_m_s=5.0, gust_m=0.02))
    flown.run(1.2)
    corners = ((60.0, 0.0), (60.0, 60.0), (0.0, 60.0))
    places = tuple(flown.place(*one) for one in corners)
    flown.order("survey", places=places, spacing_m=20.0, height_m=40.0)
    vehicle = flown.vehicle

    def arrives() -> bool:
        target, (north_m, east_m) = vehicle.target, vehicle.body.place_m
        if target is None:
            return False
        left_m = math.hypot(target.north_m - north_m, target.east_m - east_m)
        return left_m < away_m and math.hypot(*vehicle.body.velocity_m_s) > 0.1

    flown.run(5.0)
    flown.run(60.0, until=arrives)
    turn_at_our_target(flown, by_deg)
    sent = len(flown.commands)
    flown.run(20.0)
    assert flown.authority.reason == FOREIGN_TURN
    assert len(flown.commands) == sent


"""Heading setpoint [°], bearing [°] and distance of the target [m], every 0.1 s: the end of a
simulated leg on which the bearing comes to meet the setpoint."""
