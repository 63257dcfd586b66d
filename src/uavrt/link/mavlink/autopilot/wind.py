"""Read the wind in the messages of each autopilot; no I/O.

ArduPilot sends WIND and PX4 WIND_COV, where they estimate it: a multirotor needs its drag to be
measured for that (EK3_DRAG_*, EKF2_DRAG_CTRL).
"""

from math import cos, hypot, isfinite, radians, sin

from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.message import Message

STRONGEST_M_S = 60.0
"""Strongest plausible wind [m/s]; stronger reports are ignored, as no drone flies then."""


def wind_of(message: Message) -> tuple[float, float] | None:
    """Velocity of the air, east and north [m/s]; None for a message without wind."""
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
