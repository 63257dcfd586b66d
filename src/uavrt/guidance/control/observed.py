"""Reports of the vehicle, each with its time of arrival [s, monotonic]."""

from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, radians
from typing import Literal

from uavrt.core.earth.geodesy import distance_m
from uavrt.core.messages import FlyThere
from uavrt.core.units import wrap_degrees_180


@dataclass(frozen=True, slots=True)
class ModeReport:
    """Report of the flight mode, from HEARTBEAT or CURRENT_MODE."""

    time_s: float
    mode: int
    """Number of the flight mode (MAVLink ``custom_mode``)."""
    armed: bool | None = None
    """True if the motors are armed; None if the message does not contain it."""
    failsafe: bool = False
    """True if the autopilot's system status is critical or worse."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionReport:
    """Report of position and velocity, from GLOBAL_POSITION_INT."""

    time_s: float
    boot_s: float
    """Time of the report by the autopilot's clock, which counts from its start [s]."""
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    altitude_relative_m: float
    """Height above home [m]."""
    velocity_m_s: tuple[float, float, float]
    """Velocity north, east and up [m/s]."""
    yaw_deg: float | None

    @property
    def speed_m_s(self) -> float:
        """Speed over ground [m/s]."""
        return hypot(self.velocity_m_s[0], self.velocity_m_s[1])

    @property
    def course_deg(self) -> float:
        """Direction of motion over ground, clockwise from north [deg]."""
        return degrees(atan2(self.velocity_m_s[1], self.velocity_m_s[0]))

    def way_to(self, place: FlyThere) -> tuple[float, float]:
        """Return the bearing [deg] and the distance [m] from here to a position."""
        east = wrap_degrees_180(place.longitude_deg - self.longitude_deg)
        north = place.latitude_deg - self.latitude_deg
        bearing = degrees(atan2(east * cos(radians(self.latitude_deg)), north))
        return bearing, between_m(self, place)


@dataclass(frozen=True, slots=True)
class PositionLost:
    """Report that the autopilot has no position."""

    time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetReport:
    """Report of the autopilot's present target, from POSITION_TARGET_GLOBAL_INT."""

    time_s: float
    boot_s: float
    """Time of the report by the autopilot's clock, which counts from its start [s]."""
    latitude_deg: float | None
    """Latitude of the target [deg]; None if the autopilot has no target position."""
    longitude_deg: float | None
    altitude_amsl_m: float | None
    yaw_deg: float | None
    yaw_rate_deg_s: float | None = None
    """Turn rate of the target heading [°/s]; None if not reported."""


@dataclass(frozen=True, slots=True)
class SticksReport:
    """Report of the remote control's channels, from RC_CHANNELS; empty without a signal."""

    time_s: float
    channels_us: tuple[int, ...]
    """Pulse widths of RC channels 1 to 4 [µs]: roll, pitch, throttle and yaw sticks."""
    switches_us: tuple[int, ...] = ()
    """Pulse widths of the RC channels from 5 on [µs], mostly switches; 0 if unused."""


@dataclass(frozen=True, slots=True)
class HomeReport:
    """Report of the home position, from HOME_POSITION."""

    time_s: float
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float


@dataclass(frozen=True, slots=True)
class LandedReport:
    """Report whether the vehicle is on the ground, from EXTENDED_SYS_STATE."""

    time_s: float
    on_ground: bool | None
    """True if the vehicle is on the ground; None if the autopilot reports it as unknown."""


@dataclass(frozen=True, slots=True)
class FailsafeReport:
    """Report that the autopilot has started a failsafe action."""

    time_s: float
    cause: Literal["fence", "battery", "position estimate", "critical state"]


@dataclass(frozen=True, slots=True)
class BootTimeReport:
    """Report of the autopilot's time since its start, from any message with a timestamp."""

    time_s: float
    boot_s: float
    late_s: float | None = None
    """Delay of the message on the link, measured by TIMESYNC [s]; None if unknown."""


@dataclass(frozen=True, slots=True)
class AutopilotStarted:
    """Event: an autopilot was found that is new or has restarted."""

    time_s: float


Observation = (
    ModeReport
    | PositionReport
    | PositionLost
    | TargetReport
    | SticksReport
    | HomeReport
    | LandedReport
    | FailsafeReport
    | BootTimeReport
    | AutopilotStarted
)
Located = PositionReport | TargetReport | HomeReport | FlyThere


def between_m(one: Located, other: Located) -> float:
    """Return the horizontal distance between two positions [m]; 0 if one is missing."""
    a, b, c, d = one.latitude_deg, one.longitude_deg, other.latitude_deg, other.longitude_deg
    return 0.0 if a is None or b is None or c is None or d is None else distance_m(a, b, c, d)


def same_place(one: Located, other: Located, within_m: float) -> bool:
    """True if two targets agree in position and height within `within_m`, or both lack one."""
    if one.latitude_deg is None or other.latitude_deg is None:
        return one.latitude_deg is other.latitude_deg
    a, b = one.altitude_amsl_m, other.altitude_amsl_m
    if a is None or b is None:
        return False
    return between_m(one, other) <= within_m and abs(a - b) <= within_m
