"""Observed vehicle state, each item with our monotonic arrival time [s]."""

from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, radians
from typing import Literal

from uavrt.geodesy import distance_m
from uavrt.messages import FlyThere
from uavrt.units import wrap_degrees_180


@dataclass(frozen=True, slots=True)
class ModeSeen:
    """A heartbeat or CURRENT_MODE."""

    time_s: float
    mode: int
    """Custom mode."""
    armed: bool | None = None
    """None: not in the message."""
    failsafe: bool = False
    """The autopilot's own state is critical or worse."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionSeen:
    """GLOBAL_POSITION_INT."""

    time_s: float
    boot_s: float
    """The autopilot's time since its start."""
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    altitude_relative_m: float
    """Above home."""
    velocity_m_s: tuple[float, float, float]
    """North and east over ground, and up."""
    yaw_deg: float | None

    @property
    def speed_m_s(self) -> float:
        """Speed over ground."""
        return hypot(self.velocity_m_s[0], self.velocity_m_s[1])

    @property
    def course_deg(self) -> float:
        """Direction of motion over ground, clockwise from north [deg]."""
        return degrees(atan2(self.velocity_m_s[1], self.velocity_m_s[0]))

    def way_to(self, place: FlyThere) -> tuple[float, float]:
        """Bearing [deg] of a place and its distance [m]."""
        east = wrap_degrees_180(place.longitude_deg - self.longitude_deg)
        north = place.latitude_deg - self.latitude_deg
        bearing = degrees(atan2(east * cos(radians(self.latitude_deg)), north))
        return bearing, between_m(self, place)


@dataclass(frozen=True, slots=True)
class PositionLost:
    """The autopilot says that it has no position."""

    time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetSeen:
    """POSITION_TARGET_GLOBAL_INT: where the autopilot is flying to."""

    time_s: float
    boot_s: float
    """The autopilot's time since its start."""
    latitude_deg: float | None
    """None: it follows no place."""
    longitude_deg: float | None
    altitude_amsl_m: float | None
    yaw_deg: float | None


@dataclass(frozen=True, slots=True)
class SticksSeen:
    """RC_CHANNELS in microseconds; empty: no receiver, or it has lost the sender."""

    time_s: float
    channels_us: tuple[int, ...]
    """Roll, pitch, throttle, yaw."""
    switches_us: tuple[int, ...] = ()
    """Channels from 5 on, 0 where one is not used."""


@dataclass(frozen=True, slots=True)
class HomeSeen:
    """HOME_POSITION."""

    time_s: float
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float


@dataclass(frozen=True, slots=True)
class LandedSeen:
    """EXTENDED_SYS_STATE."""

    time_s: float
    on_ground: bool | None
    """None: the autopilot does not know."""


@dataclass(frozen=True, slots=True)
class FailsafeSeen:
    """The autopilot reports a failsafe."""

    time_s: float
    what: Literal["fence", "battery", "position estimate", "critical state"]


@dataclass(frozen=True, slots=True)
class BootTimeSeen:
    """Any message with the time since the autopilot's start."""

    time_s: float
    boot_s: float
    late_s: float | None = None
    """From when it was made to its arrival, by the clocks' TIMESYNC; None: not known."""


@dataclass(frozen=True, slots=True)
class Boot:
    """A new autopilot was found, or another one."""

    time_s: float


Observation = (
    ModeSeen
    | PositionSeen
    | PositionLost
    | TargetSeen
    | SticksSeen
    | HomeSeen
    | LandedSeen
    | FailsafeSeen
    | BootTimeSeen
    | Boot
)
Located = PositionSeen | TargetSeen | HomeSeen | FlyThere


def between_m(one: Located, other: Located) -> float:
    """Distance over ground; 0 where one of them is no place."""
    a, b, c, d = one.latitude_deg, one.longitude_deg, other.latitude_deg, other.longitude_deg
    return 0.0 if a is None or b is None or c is None or d is None else distance_m(a, b, c, d)


def same_place(one: Located, other: Located, within_m: float) -> bool:
    """Whether both are one place and height, or neither is a place."""
    if one.latitude_deg is None or other.latitude_deg is None:
        return one.latitude_deg is other.latitude_deg
    a, b = one.altitude_amsl_m, other.altitude_amsl_m
    if a is None or b is None:
        return False
    return between_m(one, other) <= within_m and abs(a - b) <= within_m
