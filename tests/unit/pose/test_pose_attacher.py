"""Pulses wait for their poses, not for ever."""

import made
import pytest
from some import some

from uavrt.core.earth.attitude import from_euler_deg, yaw_deg
from uavrt.core.messages import AttitudeSample, PositionSample, Pulse
from uavrt.localization.pose.attacher import PoseAttacher
from uavrt.localization.pose.ring import PoseRing

START_NS = 1_700_205_419_230_494_976
SECOND_NS = 1_000_000_000


@pytest.fixture
def ring() -> PoseRing:
    return PoseRing()


def fly(ring: PoseRing, start_s: float, end_s: float) -> None:
    """Turn at 30°/s, 50 Hz."""
    for step in range(round(start_s * 50), round(end_s * 50) + 1):
        time_ns = START_NS + step * SECOND_NS // 50
        ring.add_attitude(
            AttitudeSample(
                time_ns=time_ns, quaternion_wxyz=from_euler_deg(30.0 * step / 50, 0.0, 0.0)
            )
        )
        ring.add_position(
            PositionSample(
                time_ns=time_ns,
                latitude_deg=47.4,
                longitude_deg=8.5,
                altitude_amsl_m=488.0,
                altitude_relative_m=30.0,
            )
        )


def pulse(center_s: float, tag_id: int = 2) -> Pulse:
    center_ns = START_NS + round(center_s * SECOND_NS)
    return made.pulse(
        center_ns - 10_000_000,
        tag_id=tag_id,
        end_time_ns=center_ns + 10_000_000,
        detection_status="detected",
        confirmed=False,
    )


def at(seconds: float) -> int:
    return START_NS + round(seconds * SECOND_NS)


def test_a_pulse_has_the_heading_of_its_centre(ring: PoseRing) -> None:
    fly(ring, 0.0, 5.0)
    attacher = PoseAttacher(ring, wait_s=1.0)
    attacher.add(pulse(3.0), at(4.0))
    (attached,) = attacher.ready(at(4.0))
    assert attached.pose is not None
    assert yaw_deg(attached.pose.quaternion_wxyz) == pytest.approx(90.0, abs=1e-6)
    assert attached.pose.time_ns == at(3.0)
    assert attacher.attached == 1


def test_a_pulse_waits_for_the_pose_after_it(ring: PoseRing) -> None:
    fly(ring, 0.0, 3.0)
    attacher = PoseAttacher(ring, wait_s=1.0)
    attacher.add(pulse(3.01), at(3.05))
    assert attacher.ready(at(3.06)) == []
    assert attacher.next_deadline_ns() == at(4.05)
    fly(ring, 3.02, 3.04)
    (attached,) = attacher.ready(at(3.1))
    assert not some(attached.pose).extrapolated


def test_when_its_time_is_over_a_pulse_goes_with_a_marked_guess(ring: PoseRing) -> None:
    fly(ring, 0.0, 3.0)
    attacher = PoseAttacher(ring, wait_s=1.0)
    attacher.add(pulse(3.5), at(3.6))
    assert attacher.ready(at(4.599)) == []
    (attached,) = attacher.ready(at(4.6))
    assert some(attached.pose).extrapolated
    assert attacher.extrapolated == 1


def test_without_an_autopilot_a_pulse_goes_without_a_pose(ring: PoseRing) -> None:
    attacher = PoseAttacher(ring, wait_s=1.0)
    attacher.add(pulse(3.0), at(3.1))
    assert attacher.ready(at(3.2)) == []
    (attached,) = attacher.ready(at(4.1))
    assert attached.pose is None
    assert attacher.without_pose == 1


def test_with_no_time_to_wait_a_pulse_goes_at_once(ring: PoseRing) -> None:
    attacher = PoseAttacher(ring, wait_s=0.0)
    attacher.add(pulse(3.0), at(3.1))
    assert len(attacher.ready(at(3.1))) == 1


def test_a_tag_that_waits_does_not_hold_up_another(ring: PoseRing) -> None:
    fly(ring, 0.0, 3.0)
    attacher = PoseAttacher(ring, wait_s=1.0)
    attacher.add(pulse(3.5, tag_id=2), at(3.6))
    attacher.add(pulse(2.9, tag_id=2), at(3.6))
    attacher.add(pulse(2.9, tag_id=4), at(3.6))
    (attached,) = attacher.ready(at(3.6))
    assert attached.pulse.tag_id == 4
    assert [waiting.pulse.start_time_ns for waiting in attacher.flush()] == [
        pulse(3.5).start_time_ns,
        pulse(2.9).start_time_ns,
    ]
