"""ArduCopter looks along its course: a swing after a new target is no takeover."""

from math import atan2, degrees, hypot

from uavrt.guidance.control.yaw import OTHERS_TURN, YawWatch
from uavrt.guidance.safety import SAFETY

BEARING_DEG, AWAY_M = 67.5, 24.0
FLOWN = [
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
PEAK = max(range(len(FLOWN)), key=lambda number: FLOWN[number][0])


def course_deg(north_m_s: float, east_m_s: float) -> float | None:
    moves = hypot(north_m_s, east_m_s) > SAFETY.course_m_s
    return degrees(atan2(east_m_s, north_m_s)) if moves else None


def faults(rows: list[tuple[float, float, float]]) -> list[str | None]:
    watch = YawWatch(start_s=0.0, yaw_deg=rows[0][0], tolerance_deg=SAFETY.yaw_deg)
    return [
        watch.fault(0.1 * n, yaw, BEARING_DEG, AWAY_M, course_deg(north, east))
        for n, (yaw, north, east) in enumerate(rows)
    ]


def test_a_heading_that_follows_a_swing_of_the_course_is_ours() -> None:
    assert not any(faults(FLOWN))


def test_a_heading_that_stays_where_the_course_swung_to_is_not_ours() -> None:
    held = [(FLOWN[min(n, PEAK)][0], *row[1:]) for n, row in enumerate(FLOWN)]
    found = faults(held)
    assert found.index(OTHERS_TURN) - PEAK <= 12


def test_a_heading_that_turns_away_from_both_course_and_bearing_is_not_ours() -> None:
    turned = [
        (yaw - 8.0 * max(0, n - PEAK), north, east)
        for n, (yaw, north, east) in enumerate(FLOWN)
    ]
    away = [(yaw - 10.0 * n, north, east) for n, (yaw, north, east) in enumerate(FLOWN)]
    assert OTHERS_TURN in faults(turned)
    assert OTHERS_TURN in faults(away)[:8]


def test_a_heading_that_follows_a_fast_course_near_the_target_is_ours() -> None:
    watch = YawWatch(start_s=0.0, yaw_deg=SWUNG[0][0], tolerance_deg=SAFETY.yaw_deg)
    for number, (yaw, away_m, course) in enumerate(SWUNG):
        assert watch.fault(0.1 * number, yaw, -75.0, away_m, course) is None
