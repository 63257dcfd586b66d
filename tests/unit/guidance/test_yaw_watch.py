"""Recorded turns of ours are no takeover; the same turns held or driven on by another are."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from math import atan2, copysign, degrees, hypot
from typing import Any

import pytest

from uavrt.core.messages import FlyThere
from uavrt.guidance.autopilot_behaviour import BEHAVIOURS
from uavrt.guidance.control.commanded import Commanded
from uavrt.guidance.control.observed import PositionReport, TargetReport
from uavrt.guidance.control.observed_vehicle import ObservedVehicle
from uavrt.guidance.control.yaw import FOREIGN_TURN, YawWatch
from uavrt.guidance.safety import SAFETY

Rows = Iterable[Sequence[Any]]


def heading(yaw_deg: float, **more: Any) -> YawWatch:
    """Watch a heading, which gusts move, after a command."""
    return YawWatch(start_s=0.0, yaw_deg=yaw_deg, tolerance_deg=SAFETY.yaw_deg, **more)


def setpoint(yaw_deg: float, before_deg_s: float, **more: Any) -> YawWatch:
    """Watch PX4's setpoint, which turned at a rate before the command."""
    turning: Any = {"tolerance_deg": 2.0, "exact": True, "turning_deg_s": before_deg_s}
    return YawWatch(start_s=0.0, yaw_deg=yaw_deg, **turning, **more)


def faults(watch: YawWatch, rows: Rows, first_s: float = 0.0) -> list[str | None]:
    """What the watch finds every 0.1 s: heading, bearing, distance and course may be given."""
    return [watch.fault(first_s + 0.1 * number, *row) for number, row in enumerate(rows)]


@pytest.mark.parametrize(
    ("course_deg", "ours"), [(178.0, True), (-176.0, True), (120.0, False)]
)
def test_to_look_straight_back_it_may_turn_either_way(course_deg: float, ours: bool) -> None:
    way = -copysign(1.0, course_deg)
    turned = [min(5.0 * step, 360.0 - abs(course_deg)) for step in range(1, 80)]
    found = faults(heading(0.0), [(way * one, course_deg, 100.0) for one in turned], 0.1)
    assert (set(found) == {None}) is ours


# ------------------------------------------------------------- where the drone arrives

TURNED = [
    (190.1, 190.1, 10.4), (190.1, 190.1, 9.6), (190.1, 190.1, 8.9), (190.2, 190.0, 8.2),
    (190.8, 190.0, 7.6), (192.4, 190.0, 7.0), (195.0, 190.1, 6.4), (198.5, 190.0, 5.8),
    (202.6, 190.1, 5.2), (207.0, 190.1, 4.7), (211.7, 190.0, 4.2), (216.5, 190.1, 3.7),
    (221.3, 190.3, 3.2), (226.0, 190.4, 2.8), (230.6, 190.5, 2.4), (235.1, 190.7, 2.0),
]  # fmt: skip
"""Heading, bearing of the target and distance of ArduCopter 4.7-dev (SITL), every 0.1 s, at the
end of a leg on which the pilot asked for another heading (MAV_CMD_CONDITION_YAW)."""


def aligned(yaw_deg: float) -> YawWatch:
    """A heading that has looked to its target for 1.5 s."""
    watch = heading(yaw_deg)
    near = [(yaw_deg, yaw_deg, 40.0 - 2.0 * tenth) for tenth in range(1, 16)]
    assert faults(watch, near, 0.1) == [None] * 15
    return watch


def test_the_turn_that_was_flown_is_noticed_before_the_target() -> None:
    found = faults(aligned(190.1), TURNED, 1.6)
    assert found[-1] == FOREIGN_TURN
    assert found[:9] == [None] * 9


def test_a_turn_at_the_target_is_noticed() -> None:
    turned = [(90.0, 90.0, 0.5), (100.0, 20.0, 0.3), (103.0, 300.0, 0.2)]
    assert faults(aligned(90.0), turned, 1.6) == [None, None, FOREIGN_TURN]


def test_a_drone_that_arrives_during_its_turn_may_end_it() -> None:
    turning = [(4.0 * tenth, 120.0, 3.0 - 0.1 * tenth) for tenth in range(1, 30)]
    assert not any(faults(heading(0.0), turning, 0.1))


# ---------------------------------------------- ArduCopter's heading follows the course

FOLLOWED = [
    *((22.1, 1.61, 0.64), (22.1, 1.37, 0.55), (22.1, 1.13, 0.45), (22.6, 0.89, 0.36)),
    *((24.2, 0.65, 0.29), (27.6, 0.43, 0.26), (32.9, 0.22, 0.28), (40.2, 0.03, 0.36)),
    *((49.3, -0.12, 0.49), (59.7, -0.23, 0.68), (70.7, -0.28, 0.89), (81.6, -0.26, 1.12)),
    *((91.3, -0.16, 1.37), (99.0, 0.0, 1.62), (104.0, 0.21, 1.87), (106.1, 0.45, 2.13)),
    *((104.9, 0.71, 2.37), (100.7, 0.95, 2.62), (94.4, 1.18, 2.85), (87.4, 1.38, 3.08)),
    *((80.7, 1.55, 3.3), (75.0, 1.69, 3.51), (70.6, 1.81, 3.72), (67.4, 1.91, 3.92)),
    *((65.3, 1.99, 4.12), (64.1, 2.05, 4.32), (63.7, 2.11, 4.52), (63.9, 2.17, 4.72)),
]
"""Heading [°] and velocity north and east [m/s] of ArduCopter 4.7 (SITL) every 0.1 s after a
new target, given while it still flew to one that was 1 m away."""
SWUNG = [
    *((288.6, 0.23, 106.0), (293.0, 0.38, 106.0), (299.7, 0.55, 106.0), (308.6, 0.74, 106.0)),
    *((319.7, 0.95, 105.0), (333.0, 1.17, 105.0), (348.5, 1.4, 104.0), (6.1, 1.63, 103.0)),
    *((23.6, 1.85, 102.0), (40.4, 2.05, 101.0), (55.8, 2.24, 100.0), (69.9, 2.39, 98.0)),
    *((82.8, 2.52, 96.0), (94.2, 2.6, 91.0)),
]
"""Heading [°], distance [m] and course [°] of the same, commanded to stay where it was; it
flew 2.6 m away, faster than 1 m/s, and came back. The bearing was -75°."""
REVERSED = [
    *((45.43, 0.41, 61, -120), (36.05, 0.61, 60, -120), (24.42, 0.83, 60, -120)),
    *((10.8, 1.08, 60, -120), (355.32, 1.34, 60, -120), (338.45, 1.62, 60, -120)),
    *((320.95, 1.9, 61, -119), (303.81, 2.19, 60, -118), (287.91, 2.46, 61, -118)),
    *((273.57, 2.72, 61, -117), (261.09, 2.96, 61, -116), (250.31, 3.18, 61, -116)),
    *((241.49, 3.36, 61, -115), (235.07, 3.51, 61, -115), (231.17, 3.62, 61, -115)),
    *((229.45, 3.7, 61, None), (229.25, 3.73, 61, None), (229.88, 3.73, 61, None)),
    *((230.85, 3.7, 61, 68), (231.86, 3.64, 61, 67), (232.57, 3.55, 61, 66)),
    *((232.25, 3.43, 60, 66), (230.09, 3.3, 60, 65), (225.5, 3.13, 60, 65)),
    *((218.25, 2.93, 59, 64), (208.4, 2.72, 59, 63), (196.15, 2.49, 58, 63)),
    *((181.7, 2.24, 58, 62), (165.31, 1.97, 57, 62), (147.79, 1.7, 56, 62)),
    *((129.92, 1.41, 55, 62), (112.95, 1.14, 53, 62), (97.43, 0.88, 50, 62)),
    *((83.61, 0.64, 45, 62), (71.59, 0.43, 36, 62), (61.54, 0.27, 16, 62)),
    *((53.91, 0.19, -22, 61), (49.01, 0.22, -60, 59)),
]
"""Heading [°], distance [m], bearing and course [°] every 0.1 s of the same, commanded to stay
while it accelerated to another's target; it flew 3.7 m away, stood, and came back."""
PEAK = max(range(len(FOLLOWED)), key=lambda number: FOLLOWED[number][0])


def followed(rows: Rows) -> list[str | None]:
    """Of headings and velocities with a target 24 m away."""

    def course_deg(north_m_s: float, east_m_s: float) -> float | None:
        moves = hypot(north_m_s, east_m_s) > SAFETY.course_m_s
        return degrees(atan2(east_m_s, north_m_s)) if moves else None

    watch = heading(FOLLOWED[0][0])
    return faults(watch, [(yaw, 67.5, 24.0, course_deg(*moves)) for yaw, *moves in rows])


def test_a_heading_that_follows_a_swing_of_the_course_is_ours() -> None:
    assert not any(followed(FOLLOWED))


def test_a_heading_that_stays_where_the_course_swung_to_is_not_ours() -> None:
    held = [(FOLLOWED[min(n, PEAK)][0], *row[1:]) for n, row in enumerate(FOLLOWED)]
    assert followed(held).index(FOREIGN_TURN) - PEAK <= 12


def test_a_heading_that_turns_away_from_both_course_and_bearing_is_not_ours() -> None:
    turned = [
        (yaw - 8.0 * max(0, n - PEAK), *moves) for n, (yaw, *moves) in enumerate(FOLLOWED)
    ]
    away = [(yaw - 10.0 * n, *moves) for n, (yaw, *moves) in enumerate(FOLLOWED)]
    assert FOREIGN_TURN in followed(turned)
    assert FOREIGN_TURN in followed(away)[:8]


def test_a_heading_that_follows_a_fast_course_near_the_target_is_ours() -> None:
    swung = [(yaw, -75.0, away_m, course) for yaw, away_m, course in SWUNG]
    assert not any(faults(heading(SWUNG[0][0]), swung))


def test_a_heading_that_waits_while_the_drone_reverses_its_course_is_ours() -> None:
    assert not any(faults(heading(52.4, turning_deg_s=-45.0), REVERSED))


def test_a_heading_that_stays_after_the_course_was_reversed_is_not_ours() -> None:
    stood = next(number for number, row in enumerate(REVERSED) if row[3] is None)
    yaw = REVERSED[stood][0]
    held = [
        (yaw if number > stood else row[0], *row[1:]) for number, row in enumerate(REVERSED)
    ]
    found = faults(heading(52.4, turning_deg_s=-45.0), held)
    assert 5 <= found.index(FOREIGN_TURN) - stood <= 15


# ----------------------------------------------------- PX4's setpoint turns with inertia

RECORDED = [
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


@pytest.mark.parametrize(("before_deg_s", "bearing_deg", "setpoints_deg"), RECORDED)
def test_the_setpoint_that_was_recorded_is_ours_and_one_that_stays_where_it_turned_to_is_not(
    before_deg_s: float, bearing_deg: float, setpoints_deg: Sequence[float]
) -> None:
    def found(yaws_deg: Sequence[float]) -> list[str | None]:
        watch = setpoint(yaws_deg[0], before_deg_s)
        return faults(watch, [(yaw, bearing_deg, 25.5) for yaw in yaws_deg])

    assert not any(found(setpoints_deg))
    ended = max(range(len(setpoints_deg)), key=lambda n: before_deg_s * setpoints_deg[n])
    held = found([*setpoints_deg[:ended], *[setpoints_deg[ended]] * 16])
    assert held[ended] is None
    assert held[-1] == FOREIGN_TURN


TURNED_ON = (
    *(11.4, 14.0, 16.7, 19.0, 21.2, 23.1, 24.9, 26.4, 27.9, 29.0, 30.0, 30.7, 31.3, 31.7, 31.8),
    *(31.8, 31.6, 31.2, 30.5, 29.7, 28.6, 27.5, 26.0, 24.4, 22.5, 20.5, 18.2, 15.9, 13.3, 11.2),
    *(9.1, 7.3, 5.6, 4.2, 2.9, 1.9, 1.1, 0.4, 0.0, -0.2, -0.3, -0.3),
)
"""Heading setpoint of PX4 1.17 (SIH) every 0.1 s after a command to another place with a
heading of -0.3°, given during a right turn at 28°/s [°]."""


def test_a_heading_asked_for_during_the_opposite_turn_is_no_takeover() -> None:
    watch = setpoint(TURNED_ON[0], 26.0, wanted_deg=-0.3)
    assert not any(faults(watch, [(yaw_deg,) for yaw_deg in TURNED_ON]))


FAST = (
    *(7.3, 10.6, 15.4, 18.4, 22.7, 26.2, 29.3, 32.3, 35.0, 37.6, 39.9, 42.2, 44.0, 45.5, 47.4),
    *(48.5, 49.9, 50.7, 51.6, 52.2, 52.6, 52.7, 52.7, 52.5, 52.0, 51.3, 50.5),
)
FAST_DEG_S = 41.0
"""The same with a heading of -4.1°, given during a turn at 43°/s, and the rate that PX4
reported with the second value [°/s]."""


@pytest.mark.parametrize(
    ("rate_deg_s", "ours"), [(FAST_DEG_S, True), (10.0 * (FAST[1] - FAST[0]), False)]
)
def test_a_fast_turn_goes_on_as_far_as_its_reported_rate_lets_expect(
    rate_deg_s: float, ours: bool
) -> None:
    watch = setpoint(FAST[1], rate_deg_s, wanted_deg=-4.1)
    assert any(faults(watch, [(yaw_deg,) for yaw_deg in FAST[1:]])) is not ours


MET = [
    *((13.4, 52.9), (16.6, 52.6), (20.1, 52.3), (22.4, 51.9), (26.1, 51.5), (29.5, 51.1)),
    *((32.7, 50.7), (35.6, 50.3), (37.3, 49.9), (39.9, 49.4), (42.2, 49.0), (44.4, 48.6)),
    *((46.2, 48.2), (47.3, 47.8), (48.8, 47.4), (50.0, 47.0), (51.1, 46.6), (51.9, 46.2)),
    *((52.4, 45.8), (52.7, 45.5), (52.8, 45.2), (52.7, 44.9), (52.4, 44.6), (51.9, 44.3)),
]
"""Heading setpoint and bearing of its target every 0.1 s [°]: as the drone still drifted, the
bearing came to meet the setpoint, which passed it at 15°/s and braked."""


def met(rows: Iterable[tuple[float, float]]) -> list[str | None]:
    return faults(setpoint(MET[0][0], 29.0), [(*row, 25.5) for row in rows])


def test_a_setpoint_that_meets_its_moving_aim_may_brake_beyond_it() -> None:
    assert not any(met(MET))


def test_a_setpoint_that_turns_on_beyond_its_aim_without_braking_is_not_ours() -> None:
    passed = next(number for number, (yaw, bearing) in enumerate(MET) if yaw > bearing)
    turned = [
        (yaw + 1.2 * max(0, number - passed), bearing)
        for number, (yaw, bearing) in enumerate(MET)
    ]
    assert FOREIGN_TURN in met(turned)[passed : passed + 10]


PASSED = (
    (325.24, 313.60, 3.87), (323.74, 313.98, 3.41), (321.54, 314.48, 2.95),
    (319.57, 315.10, 2.51), (317.83, 315.90, 2.09), (316.32, 316.98, 1.69),
    (315.50, 318.87, 1.31), (314.38, 322.03, 0.97), (313.49, 326.80, 0.66),
)  # fmt: skip
"""Heading setpoint [°], bearing [°] and distance of the target [m], every 0.1 s: the end of a
simulated leg on which the bearing comes to meet the setpoint."""


def test_a_setpoint_that_passes_its_bearing_stops_behind_it_though_the_target_is_near() -> None:
    assert not any(faults(setpoint(PASSED[0][0], 0.0), PASSED, 0.1))


# ------------------------------------------------------ what a command is obeyed by


def test_the_rate_of_a_setpoint_is_the_reported_one() -> None:
    vehicle = ObservedVehicle(BEHAVIOURS["px4"])
    for number, yaw_deg in enumerate(FAST[:2]):
        at_s = 10.0 + 0.1 * number
        seen = replace(BEFORE, time_s=at_s, boot_s=at_s, yaw_deg=yaw_deg)
        vehicle.store(replace(seen, yaw_rate_deg_s=FAST_DEG_S))
    assert vehicle.target_turning_deg_s == FAST_DEG_S


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
    found = [command.observe_target(seen, HERE, 26.0) for seen in targets_after(10.0, held)]
    assert FOREIGN_TURN in found or command.overdue(15.0, 0.1)
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
