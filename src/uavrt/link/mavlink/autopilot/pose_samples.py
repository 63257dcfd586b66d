"""Convert the autopilot's pose messages to attitude and position samples."""

import math

from uavrt.core.messages import AttitudeSample, PositionSample
from uavrt.link.mavlink.dialect import AttitudeQuaternion, GlobalPositionInt

NORM_TOLERANCE = 0.01
"""Largest deviation of a quaternion's norm from 1; float32 keeps 1e-6."""


def attitude_sample(message: AttitudeQuaternion, time_ns: int) -> AttitudeSample | None:
    """Make an attitude sample for time `time_ns`; None if the quaternion's norm is not 1."""
    quaternion = (message.q1, message.q2, message.q3, message.q4)
    norm = math.hypot(*quaternion)
    if not abs(norm - 1.0) < NORM_TOLERANCE:  # also NaN
        return None
    w, x, y, z = (part / norm for part in quaternion)
    return AttitudeSample(time_ns=time_ns, quaternion_wxyz=(w, x, y, z))


def is_place(latitude_1e7: int, longitude_1e7: int) -> bool:
    """True if a latitude and longitude [1e-7 deg] are on the globe; False for 0, 0, which
    autopilots send without a GNSS fix.
    """
    on_globe = abs(latitude_1e7) <= 900_000_000 and abs(longitude_1e7) <= 1_800_000_000
    return on_globe and (latitude_1e7 != 0 or longitude_1e7 != 0)


def position_sample(message: GlobalPositionInt, time_ns: int) -> PositionSample | None:
    """Make a position sample for time `time_ns`; None if the message has no valid position."""
    if not is_place(message.lat, message.lon):
        return None
    return PositionSample(
        time_ns=time_ns,
        latitude_deg=message.lat / 1e7,
        longitude_deg=message.lon / 1e7,
        altitude_amsl_m=message.alt / 1e3,
        altitude_relative_m=message.relative_alt / 1e3,
    )
