"""Convert uavrt's records to ROS 2 messages and back.

Units are converted only here: in ROS 2 messages, frequencies of pulses are in MHz, frequencies
of tags in Hz and times of tags in ms.
"""

import math
from collections.abc import Mapping

from uavrt.config.tags.tag_drafts import Entry, Fault, Quantity, TagDraft
from uavrt.config.tags.tag_rules import tags_from_drafts
from uavrt.core.errors import FormatError
from uavrt.core.messages import Pose, Pulse, PulsePose, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND, hz_from_mhz, mhz_from_hz, ns_from_s
from uavrt.link.ros2.types.ros_messages import (
    Header,
    KeyValue,
    Point,
    PoseStamped,
    Quaternion,
    RosBurst,
    RosCodedTag,
    RosPose,
    RosPulse,
    RosPulsePose,
    RosTag,
    Time,
)

UNKNOWN_POSE = RosPose(
    position=Point(x=math.nan, y=math.nan, z=math.nan),
    orientation=Quaternion(x=math.nan, y=math.nan, z=math.nan, w=math.nan),
)
"""Pose of NaN values that stands for an unknown pose, because ROS 2 has no null."""


def time_to_ros(time_ns: int | None) -> Time:
    """Convert a time [ns, UTC]; None becomes zero.

    >>> time_to_ros(1_700_205_419_019_828_320)
    Time(sec=1700205419, nanosec=19828320)
    """
    seconds, nanoseconds = divmod(time_ns or 0, NANOSECONDS_PER_SECOND)
    return Time(sec=seconds, nanosec=nanoseconds)


def time_from_ros(time: Time) -> int | None:
    """Convert a time to nanoseconds UTC; zero becomes None."""
    return time.sec * NANOSECONDS_PER_SECOND + time.nanosec or None


def pose_to_ros(pose: Pose | None) -> RosPose:
    """Convert a pose to latitude (x), longitude (y) and altitude above mean sea level (z); NaN
    without a pose.
    """
    if pose is None:
        return UNKNOWN_POSE
    w, x, y, z = pose.quaternion_wxyz
    return RosPose(
        position=Point(x=pose.latitude_deg, y=pose.longitude_deg, z=pose.altitude_amsl_m),
        orientation=Quaternion(x=x, y=y, z=z, w=w),
    )


def pose_stamped(pose: Pose) -> PoseStamped:
    """Convert an antenna pose to a message with the time of the pose, not of sending."""
    header = Header(stamp=time_to_ros(pose.time_ns), frame_id="antenna_pose")
    return PoseStamped(header=header, pose=pose_to_ros(pose))


def pulse_to_ros(pulse: Pulse, detector_dir: str) -> RosPulse:
    """Convert a pulse; `detector_dir` is the tag's directory in the flight."""
    return RosPulse(
        detector_dir=detector_dir,
        tag_id=pulse.tag_id,
        frequency=mhz_from_hz(pulse.frequency_hz),
        start_time=time_to_ros(pulse.start_time_ns),
        end_time=time_to_ros(pulse.end_time_ns),
        predict_next_start=time_to_ros(pulse.predicted_next_start_ns),
        predict_next_end=time_to_ros(pulse.predicted_next_end_ns),
        snr=pulse.snr_db,
        stft_score=pulse.score,
        group_ind=min(pulse.group_index, 0xFFFF),
        group_snr=pulse.group_snr_db,
        detection_status=pulse.detection_status != "subthreshold",
        confirmed_status=pulse.confirmed,
    )


def burst_to_ros(pulse: Pulse, detector_dir: str) -> RosBurst:
    """Convert a coded tag's burst, with its pulses, to a ROS 2 message."""
    return RosBurst(
        pulse=pulse_to_ros(pulse, detector_dir),
        starts=tuple(map(time_to_ros, pulse.burst_starts_ns)),
        snrs=pulse.burst_snrs_db,
        also_possible_tag_ids=pulse.also_possible_tag_ids,
    )


def pulse_from_ros(message: RosPulse, sequence: int) -> Pulse:
    """Convert a pulse that a detector on another computer has published.

    Fields missing in the message are set: the noise power to 0 (unknown, so bearings do without
    it), the rate to the first, and the group's number to `sequence`. Raises `FormatError` for
    an impossible pulse: no time, no frequency, an SNR that is not finite.
    """
    start_ns, end_ns = time_from_ros(message.start_time), time_from_ros(message.end_time)
    numbers = (message.frequency, message.snr, message.group_snr, message.stft_score)
    if (
        start_ns is None
        or end_ns is None
        or not 0 < end_ns - start_ns <= NANOSECONDS_PER_SECOND
        or message.tag_id == 0
        or not all(map(math.isfinite, numbers))
        or not 1.0 < message.frequency < 1e5
    ):
        raise FormatError(
            f"the message is not a valid pulse: tag {message.tag_id}, {message.frequency:g} "
            f"MHz, from {start_ns} to {end_ns} ns, SNR {message.snr:g} dB"
        )
    return Pulse(
        tag_id=message.tag_id,
        frequency_hz=hz_from_mhz(message.frequency),
        start_time_ns=start_ns,
        end_time_ns=end_ns,
        snr_db=message.snr,
        group_snr_db=message.group_snr,
        score=message.stft_score,
        group_index=max(1, message.group_ind),
        group_sequence=sequence,
        noise_psd=0.0,
        detection_status=(
            "confirmed"
            if message.confirmed_status
            else "detected"
            if message.detection_status
            else "subthreshold"
        ),
        confirmed=message.confirmed_status,
        rate=1,
        predicted_next_start_ns=time_from_ros(message.predict_next_start),
        predicted_next_end_ns=time_from_ros(message.predict_next_end),
    )


def heartbeat(tag_id: int, time_ns: int, detector_dir: str) -> RosPulse:
    """Make the heartbeat of a tag's detector: a pulse with frequency 0."""
    stamp = time_to_ros(time_ns)
    return RosPulse(detector_dir=detector_dir, tag_id=tag_id, start_time=stamp, end_time=stamp)


def pulse_pose_to_ros(pulse_pose: PulsePose, detector_dir: str) -> RosPulsePose:
    """Convert a pulse with its pose to a ROS 2 message."""
    return RosPulsePose(
        pulse=pulse_to_ros(pulse_pose.pulse, detector_dir),
        antenna_pose=pose_to_ros(pulse_pose.pose),
    )


def tag_to_ros(tag: Tag) -> RosTag:
    """Convert a tag to a ROS 2 message; a tag with one rate has 0 as its second interval."""
    intervals_s = (*tag.pulse_intervals_s, 0.0)
    return RosTag(
        tag_id=tag.tag_id,
        frequency=tag.frequency_hz,
        pulse_duration=_ms(tag.pulse_width_s),
        interpulse_time_1=_ms(intervals_s[0]),
        interpulse_time_uncert=_ms(tag.interval_uncertainty_s),
        interpulse_time_jitter=_ms(tag.interval_jitter_s),
        interpulse_time_2=_ms(intervals_s[1]),
        k=tag.k,
        false_alarm_probability=tag.false_alarm_probability,
    )


def coded_tag_to_ros(tag: Tag) -> RosCodedTag:
    """Convert a coded tag to a ROS 2 message."""
    return RosCodedTag(tag=tag_to_ros(tag), gaps=tuple(map(_ms, tag.gaps_s)))


def _ms(seconds: float) -> float:
    """Convert seconds to milliseconds, exact to a nanosecond: 0.0201 s is 20.1 ms."""
    return ns_from_s(seconds) / 1e6


_QUANTITIES: dict[str, Quantity] = {
    "tag_id": "id",
    "frequency": "frequency",
    "pulse_duration": "pulse_width",
    "interpulse_time_1": "interval",
    "interpulse_time_uncert": "interval_uncertainty",
    "interpulse_time_jitter": "interval_jitter",
    "interpulse_time_2": "second_interval",
    "k": "k",
    "false_alarm_probability": "false_alarm_probability",
}


def tag_from_ros(message: RosTag | RosCodedTag) -> Tag:
    """Convert a tag by the rules of a tag file; raises `FormatError`, naming the field."""
    gaps = None
    if isinstance(message, RosCodedTag):
        gaps = tuple(Entry(number=gap, label="gaps", line=0) for gap in message.gaps)
        message = message.tag
        if not gaps or message.interpulse_time_2 != 0.0:
            raise FormatError(
                f"coded tag {message.tag_id} refused: it needs gaps and exactly one interval"
            )
    entries: dict[Quantity, Entry] = {
        quantity: Entry(
            number=getattr(message, name),
            label=name,
            line=0,
            unit="Hz" if quantity == "frequency" else "",
        )
        for name, quantity in _QUANTITIES.items()
        if quantity != "second_interval" or message.interpulse_time_2 != 0.0
    }
    faults: list[Fault] = []
    tags = tags_from_drafts([TagDraft(line=0, entries=entries, gaps=gaps)], faults)
    if faults or not tags:
        reasons = "; ".join(fault.text for fault in faults)
        raise FormatError(f"tag {message.tag_id} is refused: {reasons}")
    return tags[0]


def key_values(values: Mapping[str, object]) -> tuple[KeyValue, ...]:
    """Convert named values to the text pairs of ROS 2's diagnostics messages."""
    return tuple(KeyValue(key=key, value=str(value)) for key, value in values.items())
