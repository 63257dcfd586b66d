"""Convert the autopilot's MAVLink messages to the vehicle state of `uavrt.guidance`, and
commands to messages; no I/O.
"""

from collections.abc import Iterator
from math import cos, degrees, hypot, isfinite, radians, sin
from typing import Any

from uavrt.core.units import wrap_degrees_360
from uavrt.guidance.autopilot_behaviour import AutopilotName
from uavrt.guidance.control.observed import (
    BootTimeReport,
    FailsafeReport,
    HomeReport,
    LandedReport,
    ModeReport,
    Observation,
    PositionLost,
    PositionReport,
    SticksReport,
    TargetReport,
)
from uavrt.guidance.control.vehicle_commands import VehicleCommand
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.pose_samples import position_sample
from uavrt.link.mavlink.dialect import (
    MavCmd,
    MavFrame,
    MavLandedState,
    MavModeFlag,
    MavState,
    MavSysStatusSensor,
    PositionTargetTypemask,
)
from uavrt.link.mavlink.message import Message

_KINDS: dict[int, AutopilotName] = {
    dialect.MavAutopilot.PX4: "px4",
    dialect.MavAutopilot.ARDUPILOTMEGA: "ardupilot",
}
_MULTIROTORS = frozenset({2, 3, 4, 13, 14, 15, 29, 35})
"""MAV_TYPE numbers of vehicles that hover: multicopters and helicopters. Planes circle instead,
and ArduPilot numbers their modes differently."""
WATCHED_HZ: dict[int, float] = {
    dialect.PositionTargetGlobalInt.ID: 10.0,
    dialect.RcChannels.ID: 10.0,
    dialect.HomePosition.ID: 1.0,
    dialect.SysStatus.ID: 2.0,
    dialect.ExtendedSysState.ID: 2.0,
    dialect.CurrentMode.ID: 10.0,
    dialect.Heartbeat.ID: 10.0,
    dialect.Wind.ID: 0.2,
    dialect.WindCov.ID: 0.2,
}
"""Messages that show when the pilot takes over, and their requested rates [Hz]. PX4 reports its
flight mode in CURRENT_MODE, ArduPilot in HEARTBEAT; the wind also arrives in a different
message from each."""
STRONGEST_M_S = 60.0
"""Strongest plausible wind [m/s]; no drone flies in more, so it is ignored."""
NO_CHANNEL_US = 65_535
STICKS, MOST_CHANNELS = 4, 18
TIMED = (dialect.GlobalPositionInt, dialect.AttitudeQuaternion, dialect.SystemTime)
"""Messages that carry the autopilot's time of sending."""
_FAILING: dict[int, str] = {
    MavSysStatusSensor.SYS_STATUS_GEOFENCE: "fence",
    MavSysStatusSensor.SYS_STATUS_AHRS: "position estimate",
    MavSysStatusSensor.BATTERY: "battery",
}
_NO_PLACE = PositionTargetTypemask.X_IGNORE | PositionTargetTypemask.Y_IGNORE
_RELATIVE = (MavFrame.GLOBAL_RELATIVE_ALT, MavFrame.GLOBAL_RELATIVE_ALT_INT)


def kind_of(heartbeat: dialect.Heartbeat) -> AutopilotName | None:
    """Return the kind of autopilot that sent a heartbeat; None if the kind is unknown or the
    vehicle has wings.
    """
    return _KINDS.get(heartbeat.autopilot) if heartbeat.type in _MULTIROTORS else None


def observations(
    message: Message, now_s: float, late_s: float | None = None
) -> Iterator[Observation]:
    """Convert an autopilot's message to observations of the vehicle; most yield none."""
    if isinstance(message, TIMED):
        yield BootTimeReport(now_s, message.time_boot_ms / 1e3, late_s)
    match message:
        case dialect.GlobalPositionInt():
            yield _position(message, now_s)
        case dialect.PositionTargetGlobalInt():
            yield _target(message, now_s)
        case dialect.Heartbeat():
            yield ModeReport(
                now_s,
                message.custom_mode,
                armed=bool(message.base_mode & MavModeFlag.SAFETY_ARMED),
                failsafe=message.system_status >= MavState.CRITICAL,
            )
        case dialect.CurrentMode():
            yield ModeReport(now_s, message.custom_mode)
        case dialect.RcChannels():
            yield _rc(message, now_s)
        case dialect.HomePosition():
            yield HomeReport(
                now_s, message.latitude / 1e7, message.longitude / 1e7, message.altitude / 1e3
            )
        case dialect.ExtendedSysState():
            state = message.landed_state
            known = state != MavLandedState.UNDEFINED
            yield LandedReport(now_s, state == MavLandedState.ON_GROUND if known else None)
        case dialect.FenceStatus() if message.breach_status:
            yield FailsafeReport(now_s, "fence")
        case dialect.SysStatus():
            yield from _failing(message, now_s)


def _position(message: dialect.GlobalPositionInt, now_s: float) -> Observation:
    sample = position_sample(message, 0)
    if sample is None:
        return PositionLost(now_s)
    return PositionReport(
        time_s=now_s,
        boot_s=message.time_boot_ms / 1e3,
        latitude_deg=sample.latitude_deg,
        longitude_deg=sample.longitude_deg,
        altitude_amsl_m=sample.altitude_amsl_m,
        altitude_relative_m=sample.altitude_relative_m,
        velocity_m_s=(message.vx / 100.0, message.vy / 100.0, -message.vz / 100.0),
        yaw_deg=None if message.hdg == NO_CHANNEL_US else message.hdg / 100.0,
    )


def _target(message: dialect.PositionTargetGlobalInt, now_s: float) -> TargetReport:
    boot_s = message.time_boot_ms / 1e3
    if message.type_mask & _NO_PLACE:
        return TargetReport(
            time_s=now_s,
            boot_s=boot_s,
            latitude_deg=None,
            longitude_deg=None,
            altitude_amsl_m=None,
            yaw_deg=None,
        )
    # Neither autopilot reports targets above home; such a target would not be ours.
    relative = message.coordinate_frame in _RELATIVE
    ignored, mask = message.type_mask, PositionTargetTypemask
    no_yaw = ignored & mask.YAW_IGNORE or not isfinite(message.yaw)
    no_rate = ignored & mask.YAW_RATE_IGNORE or not isfinite(message.yaw_rate)
    return TargetReport(
        time_s=now_s,
        boot_s=boot_s,
        latitude_deg=message.lat_int / 1e7,
        longitude_deg=message.lon_int / 1e7,
        altitude_amsl_m=None if relative else message.alt,
        yaw_deg=None if no_yaw else wrap_degrees_360(degrees(message.yaw)),
        yaw_rate_deg_s=None if no_yaw or no_rate else degrees(message.yaw_rate),
    )


def _rc(message: dialect.RcChannels, now_s: float) -> SticksReport:
    """Values of all RC channels; empty without an RC receiver, or if the receiver has lost the
    transmitter.
    """
    count = min(message.chancount, MOST_CHANNELS)
    raw = [getattr(message, f"chan{number}_raw") for number in range(1, count + 1)]
    known_us = tuple(0 if one == NO_CHANNEL_US else int(one) for one in raw)
    if count < STICKS or 0 in known_us[:STICKS]:
        return SticksReport(now_s, ())
    return SticksReport(now_s, known_us[:STICKS], known_us[STICKS:])


def _failing(message: dialect.SysStatus, now_s: float) -> Iterator[FailsafeReport]:
    ill = message.onboard_control_sensors_enabled & ~message.onboard_control_sensors_health
    for bit, what in _FAILING.items():
        if ill & bit:
            yield FailsafeReport(now_s, what)  # type: ignore[arg-type]


def command_message(command: VehicleCommand, system_id: int) -> Message:
    """Make the MAVLink message of a command to the autopilot with number `system_id`.

    DO_REPOSITION is sent as COMMAND_INT with frame GLOBAL_INT, which PX4 and ArduPilot both
    interpret correctly. Other commands are sent as COMMAND_LONG.
    """
    number = MavCmd[command.name]
    head: dict[str, Any] = {
        "target_system": system_id,
        "target_component": 1,
        "command": number,
        **{f"param{n}": getattr(command, f"param{n}") for n in range(1, 5)},
    }
    if number == MavCmd.DO_REPOSITION:
        return dialect.CommandInt(
            frame=MavFrame.GLOBAL_INT, x=command.x, y=command.y, z=command.z_m, **head
        )
    return dialect.CommandLong(
        param5=command.param5, param6=command.param6, param7=command.z_m, **head
    )


def wind_of(message: Message) -> tuple[float, float] | None:
    """Return the wind velocity to the east and north [m/s]; None if a message has no wind.

    Autopilots send it if they estimate the wind. On a multirotor this requires a measured drag
    (EK3_DRAG_*, EKF2_DRAG_CTRL).
    """
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
