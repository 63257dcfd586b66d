"""A pilot's turn is noticed also where the drone is about to arrive."""

from uavrt.guidance.control.yaw import FOREIGN_TURN, YawWatch

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
    watch = YawWatch(start_s=0.0, yaw_deg=yaw_deg, tolerance_deg=25.0)
    for tenth in range(1, 16):
        assert watch.fault(0.1 * tenth, yaw_deg, yaw_deg, 40.0 - 2.0 * tenth) is None
    return watch


def test_the_turn_that_was_flown_is_noticed_before_the_target() -> None:
    watch = aligned(190.1)
    faults = [watch.fault(1.6 + 0.1 * number, *sample) for number, sample in enumerate(TURNED)]
    assert faults[-1] == FOREIGN_TURN
    assert faults[:9] == [None] * 9


def test_a_turn_at_the_target_is_noticed() -> None:
    watch = aligned(90.0)
    assert watch.fault(1.6, 90.0, 90.0, 0.5) is None
    assert watch.fault(1.7, 100.0, 20.0, 0.3) is None
    assert watch.fault(1.8, 103.0, 300.0, 0.2) == FOREIGN_TURN


def test_a_drone_that_arrives_during_its_turn_may_end_it() -> None:
    watch = YawWatch(start_s=0.0, yaw_deg=0.0, tolerance_deg=25.0)
    for tenth in range(1, 30):
        assert watch.fault(0.1 * tenth, 4.0 * tenth, 120.0, 3.0 - 0.1 * tenth) is None
