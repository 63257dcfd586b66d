"""Convert uavrt's records to tunnel messages and back.

The conversion changes units, rounds values and encodes missing values.
"""

import math
from collections.abc import Callable, Mapping
from typing import TypeVar

from uavrt.core.commands import Generation, SystemState
from uavrt.core.earth.attitude import euler_deg, from_euler_deg
from uavrt.core.earth.on_earth import OffEarthError, is_attitude, place_on_earth
from uavrt.core.errors import TunnelError
from uavrt.core.messages import DetectionStatus, Pose, Pulse, PulsePose, SearchReport, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s, s_from_ms
from uavrt.link.tunnel.generations.g0 import FAILURE, SUCCESS, AckG0, PulseG0, TagG0
from uavrt.link.tunnel.generations.g1 import (
    STATUS_CONFIRMED,
    STATUS_DETECTED,
    STATUS_NOTHING_FOUND,
    STATUS_NUMBERS,
    STATUS_SUBTHRESHOLD,
    SYSTEM_CONTROLLER,
    AckG1,
    Heartbeat,
    PulseG1,
    TagG1,
)
from uavrt.link.tunnel.generations.g2 import AckG2, PulseG2, PulseG2v1

R = TypeVar("R")

LATEST_S = 9.2e9
"""Latest time that fits into 64 bits as nanoseconds: the year 2261 [s since 1970]."""

ROOM_G1, ROOM_G2 = 115, 107
"""Largest size of an acknowledgement's text in G1 and G2, without the final NUL [bytes]."""
_USABLE = 0xF000
"""Offset of the usable share of time [per mille] in a search report's `group_sequence`; a
smaller value there means that the share is unknown."""

STATUS_NUMBERS_OF_PULSES: dict[DetectionStatus, int] = {
    "subthreshold": STATUS_SUBTHRESHOLD,
    "detected": STATUS_DETECTED,
    "confirmed": STATUS_CONFIRMED,
}
DETECTION_STATUSES: dict[int, DetectionStatus] = {
    number: status for status, number in STATUS_NUMBERS_OF_PULSES.items()
}


def tag_to_wire(tag: Tag, generation: Generation = "G1") -> TagG0 | TagG1:
    """Convert a tag to its message, in whole ms and Hz; `TunnelError` above two rates."""
    if not 1 <= len(tag.pulse_intervals_s) <= 2:
        raise TunnelError(f"tag {tag.tag_id} needs one or two pulse intervals", b"")
    if tag.coded:
        raise TunnelError(f"tag {tag.tag_id} is coded, but this message cannot carry gaps", b"")
    intervals = [round(interval * 1000) for interval in tag.pulse_intervals_s]
    build = TagG0 if generation == "G0" else TagG1
    return build(
        tag_id=tag.tag_id,
        frequency_hz=round(tag.frequency_hz),
        pulse_width_ms=round(tag.pulse_width_s * 1000),
        interval1_ms=intervals[0],
        interval2_ms=intervals[1] if len(intervals) == 2 else 0,
        interval_uncertainty_ms=round(tag.interval_uncertainty_s * 1000),
        interval_jitter_ms=round(tag.interval_jitter_s * 1000),
        k=tag.k,
        false_alarm_probability=tag.false_alarm_probability,
    )


def tag_from_wire(message: TagG0 | TagG1) -> Tag:
    """Convert a tag message to a tag; raises `TunnelError` for values that a detector cannot
    use.

    The means and deviations of G1 are ignored: their unit is not documented and senders leave
    them NaN. Refused are an id, frequency, width, interval or K of zero (the thesis's id 0 is
    "no tag"), and a false-alarm probability outside (0, 1).
    """
    needed = {
        "id": message.tag_id,
        "frequency": message.frequency_hz,
        "pulse width": message.pulse_width_ms,
        "pulse interval": message.interval1_ms,
        "K": message.k,
    }
    for name, value in needed.items():
        if value == 0:
            raise TunnelError(f"tag {message.tag_id}: {name} is 0", message.encode())
    if not 0.0 < message.false_alarm_probability < 1.0:
        raise TunnelError(
            f"tag {message.tag_id}: false alarm probability must be between 0 and 1",
            message.encode(),
        )
    if message.pulse_width_ms >= message.interval1_ms:
        raise TunnelError(
            f"tag {message.tag_id}: pulse width exceeds interval", message.encode()
        )
    intervals = [message.interval1_ms] + [message.interval2_ms] * (message.interval2_ms > 0)
    return Tag(
        tag_id=message.tag_id,
        frequency_hz=float(message.frequency_hz),
        pulse_width_s=s_from_ms(message.pulse_width_ms),
        pulse_intervals_s=tuple(s_from_ms(interval) for interval in intervals),
        interval_uncertainty_s=s_from_ms(message.interval_uncertainty_ms),
        interval_jitter_s=s_from_ms(message.interval_jitter_ms),
        k=message.k,
        false_alarm_probability=message.false_alarm_probability,
    )


def in_generation(pulse: PulseG1, generation: Generation) -> PulseG1 | PulseG2v1 | PulseG2:
    """Convert a pulse message of generation G1 to that of a later protocol version."""
    if generation == "G2v1":
        return PulseG2v1(pulse=pulse)
    return PulseG2(pulse=pulse) if generation == "G2" else pulse


def from_pulse(record: Callable[..., R], pulse: Pulse, **others: float) -> R:
    """Make a pulse message of any generation; `record` is its class.

    `others`: the fields that only this generation has. A missing prediction becomes 0.
    """
    return record(
        tag_id=pulse.tag_id,
        frequency_hz=round(pulse.frequency_hz),
        start_time_s=pulse.start_time_ns / NANOSECONDS_PER_SECOND,
        predict_next_start_s=(pulse.predicted_next_start_ns or 0) / NANOSECONDS_PER_SECOND,
        snr_db=pulse.snr_db,
        stft_score=pulse.score,
        group_snr_db=pulse.group_snr_db,
        detection_status=STATUS_NUMBERS_OF_PULSES[pulse.detection_status],
        **others,
    )


def from_search_report(record: Callable[..., R], report: SearchReport, **others: float) -> R:
    """Make the message "searched, nothing found" (status 3); `record` is its class.

    `others`: the fields that only this generation has.
    """
    return record(
        tag_id=report.tag_id,
        frequency_hz=round(report.frequency_hz),
        start_time_s=report.time_ns / NANOSECONDS_PER_SECOND,
        stft_score=report.best_score,
        noise_psd=report.noise_psd,
        detection_status=STATUS_NOTHING_FOUND,
        **others,
    )


def pulse_to_wire(
    pulse_pose: PulsePose, generation: Generation = "G1"
) -> PulseG0 | PulseG1 | PulseG2v1 | PulseG2:
    """Convert a pulse to its message; an unknown pose is NaN in every field, never zero."""
    pulse, pose = pulse_pose.pulse, pulse_pose.pose
    latitude = math.nan if pose is None else pose.latitude_deg
    longitude = math.nan if pose is None else pose.longitude_deg
    if generation == "G0":
        w, x, y, z = (math.nan,) * 4 if pose is None else pose.quaternion_wxyz
        return from_pulse(
            PulseG0,
            pulse,
            group_index=pulse.group_index & 0xFFFF,
            confirmed_status=int(pulse.confirmed),
            position_x=latitude,
            position_y=longitude,
            position_z=math.nan if pose is None else pose.altitude_amsl_m,
            orientation_x=x,
            orientation_y=y,
            orientation_z=z,
            orientation_w=w,
        )
    yaw, pitch, roll = (math.nan,) * 3 if pose is None else euler_deg(pose.quaternion_wxyz)
    modern = from_pulse(
        PulseG1,
        pulse,
        group_sequence=pulse.group_sequence & 0xFFFF,
        group_index=pulse.group_index & 0xFFFF,
        noise_psd=pulse.noise_psd,
        confirmed_status=int(pulse.confirmed),
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_relative_m=math.nan if pose is None else pose.altitude_relative_m,
        roll_deg=roll,
        pitch_deg=pitch,
        yaw_deg=yaw,
    )
    return in_generation(modern, generation)


def search_report_to_wire(report: SearchReport) -> PulseG1:
    """Convert a search report to "searched, nothing found" (status 3), missing in G0."""
    share, weakest_db = report.usable_share, report.weakest_enr_db
    return from_search_report(
        PulseG1,
        report,
        group_sequence=0 if share is None else _USABLE + round(1000.0 * share),
        group_snr_db=0.0 if weakest_db is None else weakest_db,
    )


def detector_heartbeat(tag_id: int, time_ns: int) -> PulseG1:
    """Make the heartbeat of a tag's detector: a pulse at frequency 0 (G1)."""
    return PulseG1(tag_id=tag_id, frequency_hz=0, start_time_s=time_ns / NANOSECONDS_PER_SECOND)


def pulse_from_wire(
    message: PulseG0 | PulseG1, tag: Tag | None = None
) -> PulsePose | SearchReport | None:
    """Convert a message to a pulse; None if the message is a detector's heartbeat.

    Fields missing on the wire: the end follows from the tag's pulse width; without a tag it is
    the start. The other altitude, and the noise of G0, are NaN. The rate is the one whose next
    pulse agrees with the message's prediction, 1 without a tag. A pulse with the number after
    the tag's is from the original's second detector: rate 2.

    `tag`: the pulse's tag, see `tag_of_number`. Raises `TunnelError` for a status that no
    generation has, or invalid times.
    """
    if message.frequency_hz == 0:
        return None
    times_s = (message.start_time_s, message.predict_next_start_s)
    if not all(0.0 <= time_s < LATEST_S for time_s in times_s):
        raise TunnelError("a pulse has an invalid time", message.encode())
    start_ns = ns_from_s(message.start_time_s)
    if message.detection_status == STATUS_NOTHING_FOUND and isinstance(message, PulseG1):
        usable = _USABLE <= message.group_sequence <= _USABLE + 1000
        return SearchReport(
            tag_id=message.tag_id if tag is None else tag.tag_id,
            time_ns=start_ns,
            frequency_hz=float(message.frequency_hz),
            noise_psd=message.noise_psd,
            best_score=message.stft_score,
            usable_share=(message.group_sequence - _USABLE) / 1000.0 if usable else None,
            weakest_enr_db=message.group_snr_db or None if usable else None,
        )
    status = DETECTION_STATUSES.get(message.detection_status)
    if status is None:
        raise TunnelError(
            f"unknown detection status {message.detection_status}", message.encode()
        )
    width_ns = 0 if tag is None else ns_from_s(tag.pulse_width_s)
    next_ns = ns_from_s(message.predict_next_start_s) or None
    pulse = Pulse(
        tag_id=message.tag_id if tag is None else tag.tag_id,
        frequency_hz=float(message.frequency_hz),
        start_time_ns=start_ns,
        end_time_ns=start_ns + width_ns,
        snr_db=message.snr_db,
        group_snr_db=message.group_snr_db,
        score=message.stft_score,
        group_index=message.group_index,
        group_sequence=message.group_sequence if isinstance(message, PulseG1) else 0,
        noise_psd=message.noise_psd if isinstance(message, PulseG1) else math.nan,
        detection_status=status,
        confirmed=message.confirmed_status != 0,
        rate=1 if tag is None else _rate_of(message, tag),
        predicted_next_start_ns=next_ns,
        predicted_next_end_ns=None if next_ns is None else next_ns + width_ns,
    )
    return PulsePose(pulse=pulse, pose=_pose_from_wire(message, start_ns + width_ns // 2))


def tag_of_number(tag_id: int, tags: Mapping[int, Tag]) -> Tag | None:
    """Find the listed tag with a message's number; None if no listed tag has it.

    For a tag with a second rate, the original system runs a second detector under the number
    after the tag's. So its tags have even numbers.
    """
    first = tags.get(tag_id - 1)
    if tag_id not in tags and first is not None and len(first.pulse_intervals_s) == 2:
        return first
    return tags.get(tag_id)


def _rate_of(message: PulseG0 | PulseG1, tag: Tag) -> int:
    """Number, from 1, of the tag's interval that agrees with the predicted next pulse.

    The message has the start of the predicted window: the interval less its uncertainty.
    """
    if message.tag_id == tag.tag_id + 1:
        return 2
    if message.predict_next_start_s == 0.0 or len(tag.pulse_intervals_s) == 1:
        return 1
    until_next_s = message.predict_next_start_s - message.start_time_s
    half_s = tag.interval_uncertainty_s + tag.interval_jitter_s

    def distance_s(interval_s: float) -> tuple[float, float]:
        early_s = interval_s - until_next_s
        return max(0.0, early_s - half_s, -early_s), abs(early_s)

    distances = [distance_s(interval_s) for interval_s in tag.pulse_intervals_s]
    return 1 + distances.index(min(distances))


def has_place(message: PulseG0 | PulseG1) -> bool:
    """True if a pulse message holds a position, even an invalid one."""
    return all(map(math.isfinite, _place_on_wire(message)))


def _place_on_wire(message: PulseG0 | PulseG1) -> tuple[float, float]:
    if isinstance(message, PulseG1):
        return message.latitude_deg, message.longitude_deg
    return message.position_x, message.position_y


def _pose_from_wire(message: PulseG0 | PulseG1, time_ns: int) -> Pose | None:
    """Return the pose in a pulse message; None if it holds no valid position."""
    if isinstance(message, PulseG1):
        quaternion = from_euler_deg(message.yaw_deg, message.pitch_deg, message.roll_deg)
        amsl, relative = math.nan, message.altitude_relative_m
    else:
        quaternion = (
            message.orientation_w,
            message.orientation_x,
            message.orientation_y,
            message.orientation_z,
        )
        amsl, relative = message.position_z, math.nan
    try:
        place = place_on_earth(*_place_on_wire(message))
    except OffEarthError:
        return None
    if place is None or not is_attitude(quaternion):
        return None
    return Pose(
        time_ns=time_ns,
        latitude_deg=place[0],
        longitude_deg=place[1],
        altitude_amsl_m=amsl,
        altitude_relative_m=relative,
        quaternion_wxyz=quaternion,
    )


def ack_to_wire(
    command: int,
    accepted: bool,
    message: str,
    generation: Generation = "G1",
    request_id: int = 0,
) -> AckG0 | AckG1 | AckG2:
    """Make an acknowledgement message; generation G0 has no room for the text."""
    result = SUCCESS if accepted else FAILURE
    if generation == "G2":
        return AckG2(
            acked_command=command,
            request_id=request_id,
            result=result,
            message=_path_that_fits(message, ROOM_G2),
        )
    if generation == "G0":
        return AckG0(acked_command=command, result=result)
    return AckG1(
        acked_command=command, result=result, message=_path_that_fits(message, ROOM_G1)
    )


def _path_that_fits(message: str, room: int) -> str:
    """Shorten a path at its front if it is too long, because its end names the flight."""
    if not message.startswith("/") or len(message.encode()) <= room:
        return message
    tail = message.encode()[-(room - len("…".encode())) :]
    return "…" + tail.decode(errors="ignore")


def heartbeat_to_wire(state: SystemState, cpu_temperature_c: float | None) -> Heartbeat:
    """Make the drone's heartbeat; an unknown temperature becomes NaN."""
    return Heartbeat(
        system_id=SYSTEM_CONTROLLER,
        status=STATUS_NUMBERS[state],
        cpu_temperature_c=math.nan if cpu_temperature_c is None else cpu_temperature_c,
    )
