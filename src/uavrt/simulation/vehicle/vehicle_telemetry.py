"""Create MAVLink messages of a simulated vehicle, as PX4 or ArduCopter sends them."""

import math

from uavrt.core.messages import Pose
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.message import Message
from uavrt.simulation.vehicle.simulated_flying import FULL_SCALE_DEG, FlyingVehicle


def position_message(vehicle: FlyingVehicle, boot_ms: int) -> dialect.GlobalPositionInt:
    """Create the position message; its height is relative to the autopilot's home altitude."""
    latitude, longitude = vehicle.latitude_longitude()
    north, east, up = vehicle.body.velocity_m_s
    height = vehicle.body.shown_height_m
    return dialect.GlobalPositionInt(
        time_boot_ms=boot_ms & 0xFFFFFFFF,
        lat=round(latitude * FULL_SCALE_DEG),
        lon=round(longitude * FULL_SCALE_DEG),
        alt=round((vehicle.plane.altitude_amsl_m + height) * 1e3),
        relative_alt=round((height - vehicle.ground.home_up_m) * 1e3),
        vx=round(north * 100),
        vy=round(east * 100),
        vz=round(-up * 100),
        hdg=math.floor(vehicle.heading.yaw_deg * 100) % 36_000,
    )


def home_message(vehicle: FlyingVehicle) -> dialect.HomePosition:
    """Create the message with position and altitude of home, the origin of all heights."""
    plane = vehicle.plane
    return dialect.HomePosition(
        latitude=round(plane.latitude_deg * FULL_SCALE_DEG),
        longitude=round(plane.longitude_deg * FULL_SCALE_DEG),
        altitude=round((plane.altitude_amsl_m + vehicle.ground.home_up_m) * 1e3),
        q=(1.0, 0.0, 0.0, 0.0),
    )


def target_message(
    vehicle: FlyingVehicle, boot_ms: int
) -> dialect.PositionTargetGlobalInt | None:
    """Create the message with the target of the flight; None if there is no target."""
    target, px4 = vehicle.target, vehicle.flavour == "px4"
    hidden = vehicle.taking_off and not px4
    if target is None or hidden or vehicle.body.velocity_setpoint is not None:
        return None
    latitude, longitude = vehicle.plane.to_geodetic(target.north_m, target.east_m)
    yaw_deg, rate_deg_s = vehicle.heading.shown_setpoint(boot_ms & 0xFFFFFFFF)
    ignored = dialect.PositionTargetTypemask
    return dialect.PositionTargetGlobalInt(
        time_boot_ms=boot_ms & 0xFFFFFFFF,
        coordinate_frame=dialect.MavFrame.GLOBAL_INT,
        type_mask=0 if px4 else ignored.YAW_IGNORE | ignored.YAW_RATE_IGNORE,
        lat_int=round(latitude * FULL_SCALE_DEG),
        lon_int=round(longitude * FULL_SCALE_DEG),
        alt=vehicle.plane.altitude_amsl_m + target.height_m,
        yaw=math.radians(yaw_deg),
        yaw_rate=math.radians(rate_deg_s),
    )


def wind_message(vehicle: FlyingVehicle, boot_ms: int) -> dialect.Wind | dialect.WindCov:
    """Create the message with the wind: WIND for ArduPilot, WIND_COV for PX4."""
    north, east = vehicle.body.frame.wind_m_s
    if vehicle.flavour == "ardupilot":
        comes_deg = math.degrees(math.atan2(-east, -north))
        return dialect.Wind(direction=comes_deg, speed=math.hypot(north, east))
    return dialect.WindCov(
        time_usec=boot_ms * 1000,
        wind_x=north,
        wind_y=east,
        var_horiz=0.5,
        wind_alt=vehicle.plane.altitude_amsl_m + vehicle.body.height_m,
        horiz_accuracy=0.5,
    )


def landed_message(vehicle: FlyingVehicle) -> dialect.ExtendedSysState:
    """Create the message that says whether the vehicle is on the ground."""
    state = dialect.MavLandedState
    return dialect.ExtendedSysState(
        landed_state=state.ON_GROUND if vehicle.ground.shown_landed else state.IN_AIR
    )


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
