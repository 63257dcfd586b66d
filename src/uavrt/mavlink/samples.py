"""Convert the autopilot's pose messages to our records; None for other messages."""

import math

from uavrt.mavlink.dialect import AttitudeQuaternion, GlobalPositionInt
from uavrt.messages import AttitudeSample, PositionSample

NORM_TOLERANCE = 0.01
"""A quaternion in float32 has norm 1 within 1e-6; this far off it is none."""


def attitude_sample(message: AttitudeQuaternion, time_ns: int) -> AttitudeSample | None:
    """Read an attitude of the instant `time_ns`; None unless it is a unit quaternion."""
    quaternion = (message.q1, message.q2, message.q3, message.q4)
    norm = math.hypot(*quaternion)
    if not abs(norm - 1.0) < NORM_TOLERANCE:  # also NaN
        return None
    w, x, y, z = (part / norm for part in quaternion)
    return AttitudeSample(time_ns=time_ns, quaternion_wxyz=(w, x, y, z))


def position_sample(message: GlobalPositionInt, time_ns: int) -> PositionSample | None:
    """Read a position of the instant `time_ns`.

    None outside the globe, and at latitude 0, longitude 0 to the last digit, which is what
    ArduPilot sends before it has a fix.
    """
    if abs(message.lat) > 900_000_000 or abs(message.lon) > 1_800_000_000:
        return None
    if message.lat == 0 and message.lon == 0:
        return None
    return PositionSample(
        time_ns=time_ns,
        latitude_deg=message.lat / 1e7,
        longitude_deg=message.lon / 1e7,
        altitude_amsl_m=message.alt / 1e3,
        altitude_relative_m=message.relative_alt / 1e3,
    )
