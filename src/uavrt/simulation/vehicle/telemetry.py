"""Create telemetry messages of the simulated autopilot from the vehicle's pose."""

import math

from uavrt.core.messages import Pose
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.message import Message


def default_intervals_ns(flavour: str, link: str) -> dict[int, int]:
    """Periods of the default telemetry [ns], by message id; ArduPilot has none."""
    if flavour == "ardupilot":
        return {}
    rates_hz = {
        dialect.AttitudeQuaternion.ID: 50.0 if link == "companion" else 10.0,
        dialect.GlobalPositionInt.ID: 50.0 if link == "companion" else 5.0,
        dialect.SystemTime.ID: 1.0,
        dialect.SysStatus.ID: 1.0,
    }
    return {message_id: round(1e9 / rate) for message_id, rate in rates_hz.items()}


def telemetry_message(message_id: int, pose: Pose, boot_ms: int, time_ns: int) -> Message:
    """Create a telemetry message for a time since boot; `KeyError` for an unknown message."""
    boot_ms &= 0xFFFFFFFF
    match message_id:
        case dialect.AttitudeQuaternion.ID:
            return _attitude(pose, boot_ms)
        case dialect.GlobalPositionInt.ID:
            return _position(pose, boot_ms)
        case dialect.SystemTime.ID:
            return dialect.SystemTime(time_unix_usec=time_ns // 1000, time_boot_ms=boot_ms)
        case dialect.SysStatus.ID:
            return dialect.SysStatus(
                load=300, voltage_battery=16_200, current_battery=-1, battery_remaining=80
            )
    raise KeyError(message_id)


def _attitude(pose: Pose, boot_ms: int) -> dialect.AttitudeQuaternion:
    w, x, y, z = pose.quaternion_wxyz
    return dialect.AttitudeQuaternion(time_boot_ms=boot_ms, q1=w, q2=x, q3=y, q4=z)


def _position(pose: Pose, boot_ms: int) -> dialect.GlobalPositionInt:
    w, x, y, z = pose.quaternion_wxyz
    yaw = math.degrees(math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    return dialect.GlobalPositionInt(
        time_boot_ms=boot_ms,
        lat=round(pose.latitude_deg * 1e7),
        lon=round(pose.longitude_deg * 1e7),
        alt=round(pose.altitude_amsl_m * 1e3),
        relative_alt=round(pose.altitude_relative_m * 1e3),
        hdg=round(yaw * 100) % 36_000,
    )
