"""Read the wind from PX4's and ArduPilot's messages; no I/O.

ArduPilot sends WIND and PX4 sends WIND_COV if they estimate the wind. On a multirotor this
requires a measured drag (EK3_DRAG_*, EKF2_DRAG_CTRL).
"""

from math import cos, hypot, isfinite, radians, sin

from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.message import Message

STRONGEST_M_S = 60.0
"""Strongest plausible wind [m/s]; no drone flies in more, so it is ignored."""


def wind_of(message: Message) -> tuple[float, float] | None:
    """Return the wind velocity to the east and north [m/s]; None if a message has no wind."""
    match message:
        case dialect.Wind():  # the direction that it comes from
            comes = radians(message.direction)
            east, north = -message.speed * sin(comes), -message.speed * cos(comes)
        case dialect.WindCov():
            east, north = message.wind_y, message.wind_x
        case _:
            return None
    if not (isfinite(east) and isfinite(north) and hypot(east, north) <= STRONGEST_M_S):
        return None
    return east, north
