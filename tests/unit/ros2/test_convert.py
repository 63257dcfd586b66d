import math
from typing import Any

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.errors import FormatError
from uavrt.core.messages import Pulse, PulsePose
from uavrt.link.ros2 import ros_records as convert
from uavrt.link.ros2.types.ros_messages import RosPulse, RosTag, Time

PULSE = made.pulse(
    1_700_205_419_019_828_320,
    frequency_hz=148_710_012.5,
    snr_db=20.5,
    group_snr_db=20.25,
    score=2.5,
    group_index=3,
    group_sequence=17,
    noise_psd=1e-9,
    predicted_next_start_ns=1_700_205_420_204_828_320,
)

milliseconds = st.integers(1, 1000).map(float)
tags = st.builds(
    RosTag,
    tag_id=st.integers(1, 2**32 - 1),
    frequency=st.integers(20_000_000, 1_000_000_000).map(float),
    pulse_duration=st.integers(1, 30).map(float),
    interpulse_time_1=st.integers(900, 3000).map(float),
    interpulse_time_uncert=st.integers(0, 15).map(float),
    interpulse_time_jitter=st.integers(0, 30).map(float),
    interpulse_time_2=st.sampled_from([0.0, 700.0, 4000.0]),
    k=st.integers(1, 10),
    false_alarm_probability=st.floats(1e-6, 0.5),
)


@given(tags)
def test_a_tag_comes_back_as_it_was_sent(message: RosTag) -> None:
    assert convert.tag_to_ros(convert.tag_from_ros(message)) == message


@given(st.integers(1, 2**31 * 10**9 - 1))
def test_a_time_keeps_every_nanosecond(time_ns: int) -> None:
    # The original lost the zeros between seconds and nanoseconds.
    assert convert.time_from_ros(convert.time_to_ros(time_ns)) == time_ns


def test_a_tag_s_units_are_those_of_the_original() -> None:
    tag = made.tag()
    message = convert.tag_to_ros(tag)
    assert (message.frequency, message.pulse_duration) == (148_710_000.0, 20.0)
    assert (message.interpulse_time_1, message.interpulse_time_2) == (1254.0, 0.0)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ({"tag_id": 0}, "tag_id must be a whole number from 1"),
        ({"frequency": 148.71}, "frequency looks like MHz"),
        ({"frequency": math.nan}, "frequency is not a finite number"),
        ({"pulse_duration": 0.02}, "is it in seconds"),
        ({"interpulse_time_1": math.inf}, "interpulse_time_1 is not a finite number"),
        ({"k": 0}, "k must be"),
        (
            {"false_alarm_probability": 1.0},
            "false_alarm_probability must be above 0 and at most 0.5",
        ),
    ],
)
def test_a_tag_that_makes_no_sense_is_refused_in_the_words_of_its_field(
    fault: dict[str, float], words: str
) -> None:
    good = {
        "tag_id": 2,
        "frequency": 148.71e6,
        "pulse_duration": 20.0,
        "interpulse_time_1": 1254.0,
        "k": 3,
        "false_alarm_probability": 0.01,
    }
    with pytest.raises(FormatError, match=words):
        convert.tag_from_ros(RosTag(**(good | fault)))  # type: ignore[arg-type]


def test_a_pulse_is_in_megahertz_and_has_its_full_times() -> None:
    message = convert.pulse_to_ros(PULSE, "/flight/detector_log/tag_id_2")
    assert message.frequency == pytest.approx(148.7100125, abs=1e-12)
    assert message.start_time == Time(sec=1_700_205_419, nanosec=19_828_320)
    assert message.predict_next_end == Time()
    assert message.detection_status
    assert message.detector_dir.endswith("tag_id_2")


def test_a_pulse_from_another_computer_keeps_what_the_message_carries() -> None:
    read = convert.pulse_from_ros(convert.pulse_to_ros(PULSE, ""), 5)
    for name in Pulse.__slots__:
        if name not in ("group_sequence", "noise_psd"):
            assert getattr(read, name) == getattr(PULSE, name), name
    assert read.group_sequence == 5


@pytest.mark.parametrize(
    "fault",
    [
        {"tag_id": 0},
        {"snr": math.nan},
        {"frequency": -1.0},
        {"end_time": Time(sec=1)},
        {"start_time": Time()},
    ],
)
def test_a_pulse_that_no_detector_finds_is_refused(fault: dict[str, Any]) -> None:
    good = convert.pulse_to_ros(PULSE, "")
    values = {name: getattr(good, name) for name in RosPulse.__slots__} | fault
    with pytest.raises(FormatError, match="not a valid pulse"):
        convert.pulse_from_ros(RosPulse(**values), 1)


def test_a_pose_that_is_not_known_is_nan_and_never_zero() -> None:
    pose = convert.pulse_pose_to_ros(PulsePose(pulse=PULSE, pose=None), "").antenna_pose
    numbers = (*vars_of(pose.position), *vars_of(pose.orientation))
    assert len(numbers) == 7
    assert all(map(math.isnan, numbers))


def test_a_pose_is_latitude_longitude_altitude_and_its_quaternion_ends_with_w() -> None:
    pose = made.pose(
        5_000_000_007, 47.0, 8.5, altitude_amsl_m=500.0, quaternion_wxyz=(0.5, 0.5, -0.5, 0.5)
    )
    message = convert.pose_stamped(pose)
    assert message.header.stamp == Time(sec=5, nanosec=7)
    assert tuple(vars_of(message.pose.position)) == (47.0, 8.5, 500.0)
    assert tuple(vars_of(message.pose.orientation)) == (0.5, -0.5, 0.5, 0.5)


def vars_of(message: object) -> list[float]:
    return [getattr(message, name) for name in type(message).__slots__]  # type: ignore[attr-defined]
