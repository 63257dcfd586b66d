"""ArduCopter looks along its course: a swing after a new target is no takeover."""

from math import atan2, degrees, hypot

from uavrt.guidance.control.yaw import FOREIGN_TURN, YawWatch
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
REVERSED = [
    *(
        (45.43, 0.41, 61, -120),
        (36.05, 0.61, 60, -120),
        (24.42, 0.83, 60, -120),
        (10.8, 1.08, 60, -120),
        (355.32, 1.34, 60, -120),
        (338.45, 1.62, 60, -120),
        (320.95, 1.9, 61, -119),
        (303.81, 2.19, 60, -118),
        (287.91, 2.46, 61, -118),
        (273.57, 2.72, 61, -117),
        (261.09, 2.96, 61, -116),
        (250.31, 3.18, 61, -116),
        (241.49, 3.36, 61, -115),
        (235.07, 3.51, 61, -115),
        (231.17, 3.62, 61, -115),
        (229.45, 3.7, 61, None),
        (229.25, 3.73, 61, None),
        (229.88, 3.73, 61, None),
        (230.85, 3.7, 61, 68),
        (231.86, 3.64, 61, 67),
        (232.57, 3.55, 61, 66),
        (232.25, 3.43, 60, 66),
        (230.09, 3.3, 60, 65),
        (225.5, 3.13, 60, 65),
        (218.25, 2.93, 59, 64),
        (208.4, 2.72, 59, 63),
        (196.15, 2.49, 58, 63),
        (181.7, 2.24, 58, 62),
        (165.31, 1.97, 57, 62),
        (147.79, 1.7, 56, 62),
        (129.92, 1.41, 55, 62),
        (112.95, 1.14, 53, 62),
        (97.43, 0.88, 50, 62),
        (83.61, 0.64, 45, 62),
        (71.59, 0.43, 36, 62),
        (61.54, 0.27, 16, 62),
        (53.91, 0.19, -22, 61),
        (49.01, 0.22, -60, 59),
    ),
]
"""Heading [°], distance [m], bearing and course [°] every 0.1 s of the same, commanded to stay
while it accelerated to another's target; it flew 3.7 m away, stood, and came back."""
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
    assert found.index(FOREIGN_TURN) - PEAK <= 12


def test_a_heading_that_turns_away_from_both_course_and_bearing_is_not_ours() -> None:
    turned = [
        (yaw - 8.0 * max(0, n - PEAK), north, east)
        for n, (yaw, north, east) in enumerate(FLOWN)
    ]
    away = [(yaw - 10.0 * n, north, east) for n, (yaw, north, east) in enumerate(FLOWN)]
    assert FOREIGN_TURN in faults(turned)
    assert FOREIGN_TURN in faults(away)[:8]


def test_a_heading_that_follows_a_fast_course_near_the_target_is_ours() -> None:
    watch = YawWatch(start_s=0.0, yaw_deg=SWUNG[0][0], tolerance_deg=SAFETY.yaw_deg)
    for number, (yaw, away_m, course) in enumerate(SWUNG):
        assert watch.fault(0.1 * number, yaw, -75.0, away_m, course) is None


def faults_of_reversal(rows: list[tuple[float, float, int, int | None]]) -> list[str | None]:
    watch = YawWatch(
        start_s=0.0, yaw_deg=52.4, tolerance_deg=SAFETY.yaw_deg, turning_deg_s=-45.0
    )
    return [watch.fault(0.1 * number, *row) for number, row in enumerate(rows)]


def test_a_heading_that_waits_while_the_drone_reverses_its_course_is_ours() -> None:
    assert not any(faults_of_reversal(REVERSED))


def test_a_heading_that_stays_after_the_course_was_reversed_is_not_ours() -> None:
    stood = next(number for number, row in enumerate(REVERSED) if row[3] is None)
    yaw = REVERSED[stood][0]
    held = [
        (yaw if number > stood else row[0], *row[1:]) for number, row in enumerate(REVERSED)
    ]
    assert 5 <= faults_of_reversal(held).index(FOREIGN_TURN) - stood <= 15
