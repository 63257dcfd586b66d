"""PX4's heading setpoint turns with inertia: a new target in a turn is no takeover."""

import math
from typing import Any

import pytest
from flown import Flown

from uavrt.guidance.authority import Standing
from uavrt.guidance.plans import Go
from uavrt.guidance.yaw import YawWatch
from uavrt.mavlink import dialect
from uavrt.simulation.flying import Frame

FLOWN_DEG = (
    *(14.8, 16.3, 17.8, 18.9, 19.9, 20.6, 21.2, 21.5, 21.7, 21.7, 21.4, 21.0, 20.3, 19.5),
    *(18.4, 17.3, 15.8, 14.2, 12.3, 10.3, 8.0, 5.6, 2.9, 0.2, -3.0, -6.1, -9.7, -13.2),
)
"""Setpoint of PX4 1.17 (SIH) every 0.1 s from 0.03 s after a command to look along −59°."""
BEFORE_DEG_S, BEARING_DEG, AWAY_M = 18.0, -58.5, 25.5


def redirected(after_s: float, north_m: float, east_m: float) -> Flown:
    """A leg of a search that is replaced while the drone still turns towards it."""
    flown = Flown("px4", frame=Frame(speed_m_s=5.0, gust_m=0.02))
    flown.vehicle.yaw_deg = flown.vehicle.yaw_setpoint_deg = 340.0
    flown.run(1.2)
    pilot = flown.order("goto", places=(flown.place(50.0, 20.0),), height_m=40.0)
    flown.run(3.0, until=lambda: flown.authority.obeyed)
    flown.run(after_s)
    now: Any = flown.now()
    pilot.redirect([Go(place=flown.place(north_m, east_m), height_m=40.0)], now)
    flown.run(0.2)
    return flown


@pytest.mark.parametrize("after_s", [0.2, 0.4, 0.6, 0.8, 1.0])
@pytest.mark.parametrize("place", [(15.0, -21.0), (-20.0, -30.0), (30.0, 40.0)])
def test_a_leg_that_is_replaced_during_its_turn_is_flown(
    after_s: float, place: tuple[float, float]
) -> None:
    flown = redirected(after_s, *place)
    flown.run(60.0, until=lambda: flown.authority.standing is Standing.OUT)
    assert flown.authority.reason == "done"


def test_the_setpoint_that_was_recorded_is_ours() -> None:
    watch = YawWatch(
        start_s=0.0,
        yaw_deg=FLOWN_DEG[0],
        tolerance_deg=2.0,
        exact=True,
        turning_deg_s=BEFORE_DEG_S,
    )
    for number, yaw_deg in enumerate(FLOWN_DEG):
        assert watch.fault(0.1 * number, yaw_deg, BEARING_DEG, AWAY_M) is None


@pytest.mark.parametrize("by_deg", [-15.0, -12.0, 12.0, 15.0])
def test_a_turn_at_our_target_by_another_is_seen_though_a_turn_was_going_on(
    by_deg: float,
) -> None:
    """Where the setpoint had come to its end in the meantime."""
    flown = redirected(0.6, 15.0, -21.0)
    flown.run(7.0)
    assert flown.authority.order_id is not None
    (_, last), told = flown.commands[-1], flown.vehicle.position_target(0)
    assert told is not None
    assert isinstance(last, dialect.CommandInt)
    flown._reposition(x=last.x, y=last.y, z=last.z, param4=told.yaw + math.radians(by_deg))
    sent = len(flown.commands)
    flown.run(2.0)
    assert flown.authority.standing is Standing.OUT
    assert len(flown.commands) == sent
