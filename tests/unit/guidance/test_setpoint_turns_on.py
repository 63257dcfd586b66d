"""PX4's heading setpoint turns with inertia: a new target in a turn is no takeover."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import pytest
from flown import Flown

from uavrt.core.messages import FlyThere
from uavrt.guidance.autopilot_behaviour import BEHAVIOURS
from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.control.commanded import Commanded
from uavrt.guidance.control.observed import PositionReport, TargetReport
from uavrt.guidance.control.observed_vehicle import ObservedVehicle
from uavrt.guidance.control.yaw import FOREIGN_TURN, YawWatch
from uavrt.guidance.plans import Go
from uavrt.link.mavlink import dialect
from uavrt.simulation.vehicle.airframe import Frame
from uavrt.simulation.vehicle.vehicle_telemetry import target_message

FLOWN = [
    (  # Commanded to -59° during a right turn to 22°.
        18.0,
        -58.5,
        (
            *(14.8, 16.3, 17.8, 18.9, 19.9, 20.6, 21.2, 21.5, 21.7, 21.7, 21.4, 21.0, 20.3),
            *(19.5, 18.4, 17.3, 15.8, 14.2, 12.3, 10.3, 8.0, 5.6, 2.9, 0.2, -3.0, -6.1),
        ),
    ),
    (  # Commanded to -24° during a left turn: the setpoint passed it by 21° and came back.
        -37.7,
        -24.5,
        (
            *(-14.9, -18.1, -22.0, -24.4, -27.8, -29.9, -32.7, -34.5, -36.9, -38.4, -40.3),
            *(-41.4, -42.9, -43.7, -44.7, -45.1, -45.6, -45.8, -45.8, -45.7, -45.2, -44.7),
            *(-43.8, -43.0, -41.7, -40.4, -38.5, -37.1, -34.7),
        ),
    ),
]
"""Rate before a command [°/s], bearing of its target [°], and the heading setpoint of PX4 1.17
(SIH) every 0.1 s after it [°]."""
AWAY_M = 25.5


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


@pytest.mark.parametrize(("before_deg_s", "bearing_deg", "setpoints_deg"), FLOWN)
def test_the_setpoint_that_was_recorded_is_ours(
    before_deg_s: float, bearing_deg: float, setpoints_deg: tuple[float, ...]
) -> None:
    watch = watch_of(before_deg_s, setpoints_deg[0])
    for number, yaw_deg in enumerate(setpoints_deg):
        assert watch.fault(0.1 * number, yaw_deg, bearing_deg, AWAY_M) is None


@pytest.mark.parametrize(("before_deg_s", "bearing_deg", "setpoints_deg"), FLOWN)
def test_a_setpoint_that_stays_where_its_turn_ended_is_not_ours(
    before_deg_s: float, bearing_deg: float, setpoints_deg: tuple[float, ...]
) -> None:
    ended = max(range(len(setpoints_deg)), key=lambda n: before_deg_s * setpoints_deg[n])
    watch = watch_of(before_deg_s, setpoints_deg[0])
    faults = [
        watch.fault(0.1 * number, setpoints_deg[min(number, ended)], bearing_deg, AWAY_M)
        for number in range(ended + 16)
    ]
    assert faults[ended] is None
    assert faults[-1] == FOREIGN_TURN


TURNED_ON = (
    *(11.4, 14.0, 16.7, 19.0, 21.2, 23.1, 24.9, 26.4, 27.9, 29.0, 30.0, 30.7, 31.3, 31.7, 31.8),
    *(31.8, 31.6, 31.2, 30.5, 29.7, 28.6, 27.5, 26.0, 24.4, 22.5, 20.5, 18.2, 15.9, 13.3, 11.2),
    *(9.1, 7.3, 5.6, 4.2, 2.9, 1.9, 1.1, 0.4, 0.0, -0.2, -0.3, -0.3),
)
"""Heading setpoint of PX4 1.17 (SIH) every 0.1 s after a command to another place with a
heading of -0.3°, given during a right turn at 28°/s [°]."""


def test_a_heading_asked_for_during_the_opposite_turn_is_no_takeover() -> None:
    watch = YawWatch(
        start_s=0.0,
        yaw_deg=TURNED_ON[0],
        tolerance_deg=2.0,
        wanted_deg=-0.3,
        exact=True,
        turning_deg_s=26.0,
    )
    for number, yaw_deg in enumerate(TURNED_ON):
        assert watch.fault(0.1 * number, yaw_deg) is None


FAST = (
    *(7.3, 10.6, 15.4, 18.4, 22.7, 26.2, 29.3, 32.3, 35.0, 37.6, 39.9, 42.2, 44.0, 45.5, 47.4),
    *(48.5, 49.9, 50.7, 51.6, 52.2, 52.6, 52.7, 52.7, 52.5, 52.0, 51.3, 50.5),
)
FAST_DEG_S = 41.0
"""The same with a heading of -4.1°, given during a turn at 43°/s, and the rate that PX4
reported with the second value [°/s]."""


def test_a_fast_turn_goes_on_as_far_as_its_reported_rate_lets_expect() -> None:
    vehicle = ObservedVehicle(BEHAVIOURS["px4"])
    for number, yaw_deg in enumerate(FAST[:2]):
        at_s = 10.0 + 0.1 * number
        seen = replace(BEFORE, time_s=at_s, boot_s=at_s, yaw_deg=yaw_deg)
        vehicle.store(replace(seen, yaw_rate_deg_s=FAST_DEG_S))
    assert vehicle.target_turning_deg_s == FAST_DEG_S
    for rate_deg_s, expected in ((FAST_DEG_S, False), (10.0 * (FAST[1] - FAST[0]), True)):
        watch = replace(watch_of(rate_deg_s, FAST[1]), wanted_deg=-4.1)
        faults = [watch.fault(0.1 * n, yaw_deg) for n, yaw_deg in enumerate(FAST[1:])]
        assert any(faults) is expected


MET = [
    *((13.4, 52.9), (16.6, 52.6), (20.1, 52.3), (22.4, 51.9), (26.1, 51.5), (29.5, 51.1)),
    *((32.7, 50.7), (35.6, 50.3), (37.3, 49.9), (39.9, 49.4), (42.2, 49.0), (44.4, 48.6)),
    *((46.2, 48.2), (47.3, 47.8), (48.8, 47.4), (50.0, 47.0), (51.1, 46.6), (51.9, 46.2)),
    *((52.4, 45.8), (52.7, 45.5), (52.8, 45.2), (52.7, 44.9), (52.4, 44.6), (51.9, 44.3)),
]
"""Heading setpoint and bearing of its target every 0.1 s [°]: as the drone still drifted, the
bearing came to meet the setpoint, which passed it at 15°/s and braked."""


def test_a_setpoint_that_meets_its_moving_aim_may_brake_beyond_it() -> None:
    watch = watch_of(29.0, MET[0][0])
    faults = [
        watch.fault(0.1 * n, yaw, bearing, AWAY_M) for n, (yaw, bearing) in enumerate(MET)
    ]
    assert not any(faults)


def test_a_setpoint_that_turns_on_beyond_its_aim_without_braking_is_not_ours() -> None:
    passed = next(number for number, (yaw, bearing) in enumerate(MET) if yaw > bearing)
    turned = [
        (yaw + 1.2 * max(0, number - passed), bearing)
        for number, (yaw, bearing) in enumerate(MET)
    ]
    watch = watch_of(29.0, MET[0][0])
    faults = [
        watch.fault(0.1 * n, yaw, bearing, AWAY_M) for n, (yaw, bearing) in enumerate(turned)
    ]
    assert FOREIGN_TURN in faults[passed : passed + 10]


def targets_after(sent_s: float, setpoints_deg: Iterable[float]) -> Iterator[TargetReport]:
    """Reports of the target of `STOP`, from 0.1 s after its command on."""
    for number, yaw_deg in enumerate(setpoints_deg, 1):
        seen_s = sent_s + 0.1 * number
        yield replace(BEFORE, time_s=seen_s, boot_s=seen_s, longitude_deg=0.0, yaw_deg=yaw_deg)


STOP = FlyThere(latitude_deg=0.0, longitude_deg=0.0, altitude_amsl_m=40.0, yaw_deg=-0.3)
BEFORE = TargetReport(
    time_s=10.0,
    boot_s=10.0,
    latitude_deg=0.0,
    longitude_deg=4e-4,
    altitude_amsl_m=40.0,
    yaw_deg=TURNED_ON[0],
)


@pytest.mark.parametrize(("elsewhere", "within_s"), [(True, 0.5), (False, 2.5)])
def test_a_new_place_shows_that_a_stop_is_obeyed_and_at_the_old_one_the_heading_does(
    elsewhere: bool, within_s: float
) -> None:
    """After 3 s still as far from the commanded heading as at the command, but coming back."""
    command = stopped(elsewhere=elsewhere)
    for seen in targets_after(10.0, TURNED_ON[1:30]):
        assert command.observe_target(seen, HERE, 26.0) is None
        if seen.time_s > 10.0 + within_s:
            assert command.obeyed
    assert command.overdue(13.1, 0.1) is None


def test_a_heading_that_stays_where_its_earlier_turn_ended_is_not_obeyed() -> None:
    command = stopped(elsewhere=False)
    ended = max(range(len(TURNED_ON)), key=lambda number: TURNED_ON[number])
    held = (TURNED_ON[min(number, ended)] for number in range(1, 60))
    faults = [command.observe_target(seen, HERE, 26.0) for seen in targets_after(10.0, held)]
    assert FOREIGN_TURN in faults or command.overdue(15.0, 0.1)
    assert not command.obeyed


def stopped(*, elsewhere: bool) -> Commanded:
    return Commanded(
        manoeuvre=STOP,
        behaviour=BEHAVIOURS["px4"],
        sent_s=10.0,
        first=False,
        before=BEFORE if elsewhere else replace(BEFORE, longitude_deg=0.0),
        start=HERE,
        turning_deg_s=26.0,
        previous=None,
    )


HERE = PositionReport(
    time_s=10.0,
    boot_s=10.0,
    latitude_deg=0.0,
    longitude_deg=0.0,
    altitude_amsl_m=40.0,
    altitude_relative_m=40.0,
    velocity_m_s=(1.0, 3.5, 0.0),
    yaw_deg=7.0,
)


def watch_of(before_deg_s: float, yaw_deg: float) -> YawWatch:
    return YawWatch(
        start_s=0.0, yaw_deg=yaw_deg, tolerance_deg=2.0, exact=True, turning_deg_s=before_deg_s
    )


@pytest.mark.parametrize("by_deg", [-15.0, -12.0, 12.0, 15.0])
def test_a_turn_at_our_target_by_another_is_seen_though_a_turn_was_going_on(
    by_deg: float,
) -> None:
    """The setpoint had already ended its own turn."""
    flown = redirected(0.6, 15.0, -21.0)
    flown.run(7.0)
    assert flown.authority.order_id is not None
    (_, last), setpoint = flown.commands[-1], target_message(flown.vehicle, 0)
    assert setpoint is not None
    assert isinstance(last, dialect.CommandInt)
    flown._reposition(x=last.x, y=last.y, z=last.z, param4=setpoint.yaw + math.radians(by_deg))
    sent = len(flown.commands)
    flown.run(2.0)
    assert flown.authority.standing is ControlStage.OUT
    assert len(flown.commands) == sent


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
    (_, last), setpoint = flown.commands[-1], target_message(vehicle, 0)
    assert setpoint is not None
    assert isinstance(last, dialect.CommandInt)
    flown._reposition(x=last.x, y=last.y, z=last.z, param4=setpoint.yaw + math.radians(by_deg))
    sent = len(flown.commands)
    flown.run(20.0)
    assert flown.authority.reason == FOREIGN_TURN
    assert len(flown.commands) == sent


PASSED = (
    (325.24, 313.60, 3.87), (323.74, 313.98, 3.41), (321.54, 314.48, 2.95),
    (319.57, 315.10, 2.51), (317.83, 315.90, 2.09), (316.32, 316.98, 1.69),
    (315.50, 318.87, 1.31), (314.38, 322.03, 0.97), (313.49, 326.80, 0.66),
)  # fmt: skip
"""Heading setpoint [°], bearing [°] and distance of the target [m], every 0.1 s: the end of a
simulated leg on which the bearing comes to meet the setpoint."""


def test_a_setpoint_that_passes_its_bearing_stops_behind_it_though_the_target_is_near() -> None:
    watch = watch_of(0.0, PASSED[0][0])
    times_s = [0.1 * (number + 1) for number in range(len(PASSED))]
    faults = [watch.fault(time_s, *row) for time_s, row in zip(times_s, PASSED, strict=True)]
    assert faults == [None] * len(PASSED)
