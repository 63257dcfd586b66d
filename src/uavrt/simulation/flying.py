"""A drone that flies as it is told, in the manners of PX4 1.17 or ArduCopter 4.7. Pure.

Speeds up, brakes and turns within its limits of acceleration and jerk, is pushed by gusts and
slowed by wind, drains its battery. It accepts, refuses and disobeys as the real ones were seen
to: PX4 takes any z for one above mean sea level and answers UNSUPPORTED to a DO_REPOSITION
without change of mode that it flies all the same.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

from uavrt.mavlink import dialect
from uavrt.mavlink.dialect import MavCmd, MavResult
from uavrt.simulation import geometry

Flavour = Literal["px4", "ardupilot"]
MODES: dict[Flavour, dict[str, int]] = {
    "px4": {
        "position": 3 << 16,
        "hold": 4 << 16 | 3 << 24,
        "return": 4 << 16 | 5 << 24,
        "land": 4 << 16 | 6 << 24,
        "takeoff": 4 << 16 | 2 << 24,
    },
    "ardupilot": {"position": 5, "hold": 4, "return": 6, "land": 9, "brake": 17},
}
"""``hold`` is the mode in which DO_REPOSITION is flown: AUTO.LOITER and GUIDED."""
LOOKS_UNTIL_M = 2.0
"""Distance to the target below which the heading stays; beyond it, it is the bearing."""
BESIDE_M = 0.8
"""Offset from the line to its target that PX4 does not correct before `LOOKS_UNTIL_M` [m]."""
AHEAD_S = 0.35
"""Time by which braking begins early, so that the limit of jerk causes no overshoot."""
VELOCITY_HOLDS_S = 3.0
"""ArduCopter's GUID_TIMEOUT: a velocity setpoint without another after it becomes zero."""
HOME_CORRECTED_S, HOME_STEP_S = 120.0, 0.3
"""PX4 1.17 corrects the altitude of home for this time after a take-off, this often."""
HOME_DRIFT_M, HOME_NOISE_M, HOME_LEAST_M = 6.0, 1.5, 1.0
"""Its whole correction, the spread of single ones, and the least one made [m]."""
DO_PAUSE_CONTINUE = 193
"""MAV_CMD of a ground station's pause; uavrt neither sends nor obeys it."""
FULL_SCALE_DEG = 1e7
SPOOL_S = 1.5
"""From the command until it leaves the ground."""
IDLE_S = 10.0
"""Armed on the ground: then it disarms (COM_DISARM_PRFLT, DISARM_DELAY)."""
NOWHERE = 2**31 - 1
"""INT32_MAX: no latitude or longitude, as NaN is in a COMMAND_LONG."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """How a vehicle moves."""

    speed_m_s: float = 8.0
    climb_m_s: float = 3.0
    acceleration_m_s2: float = 3.0
    jerk_m_s3: float = 4.0
    position_gain_hz: float = math.inf
    """Highest speed per distance to the target (PSC_POSXY_P, MPC_XY_P) [1/s]."""
    gust_m: float = 0.2
    """Standard deviation of the place by gusts."""
    hover_w: float = 400.0
    battery_wh: float = 120.0
    fence_m: float = 5_000.0
    """Radius around home."""
    wind_m_s: tuple[float, float] = (0.0, 0.0)
    """Where the air goes: north, east."""
    airspeed_m_s: float = 12.0
    """Greatest: against the wind it comes forward the slower."""
    drag_share: float = 0.1
    """Of the power of hovering, on top at an airspeed of 10 m/s; it grows with the cube."""
    return_height_m: float = 30.0
    """To which it climbs at least when it returns: RTL_RETURN_ALT (PX4, 60 m as delivered),
    RTL_ALT (ArduPilot, 15 m)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """What it flies to."""

    north_m: float
    east_m: float
    height_m: float
    """Above home."""


@dataclass(frozen=True, slots=True)
class _Turning:
    """How an autopilot turns the drone."""

    rate_deg_s: float
    acceleration_deg_s2: float
    setpoint: "_Turning | None" = None
    """Limits of the heading setpoint; None: its acceleration is not limited."""

    def rate(self, off_deg: float, now_deg_s: float, step_s: float) -> float:
        """Get the turning rate after a step, from the angle left and the present rate."""
        stops = math.sqrt(1.6 * self.acceleration_deg_s2 * abs(off_deg))
        wanted = math.copysign(min(self.rate_deg_s, stops, 4.0 * abs(off_deg)), off_deg)
        most = self.acceleration_deg_s2 * step_s
        return now_deg_s + max(-most, min(most, wanted - now_deg_s))


@dataclass(frozen=True, slots=True)
class _Braking:
    """How an autopilot brakes at its target."""

    share: float
    """Braking acceleration as a share of the greatest acceleration."""
    beyond_share: float
    """Overshoot as a share of the way on which it brakes."""
    beyond_m: float
    """Largest overshoot [m]."""
    back_s: float
    """Time constant of the return to the target [s]."""


_BRAKING: dict[Flavour, _Braking] = {
    "px4": _Braking(0.45, 0.1, 0.95, 6.0),
    "ardupilot": _Braking(0.87, 0.045, 0.8, 1.5),
}
"""PX4 1.17 in SIH overshoots by 0.4 to 1.5 m at 5 m/s (median of 8: 0.83 m) and settles within
0.5 m, 7 s after it was 3 m before the target. ArduCopter 4.7-dev in SITL brakes with 2.6 m/s²,
overshoots by 0.64 m from 9 m/s and by 0.25 m from 5.7 m/s, and settles after 2.3 and 0.7 s."""
BACK_BELOW_M_S = 0.4
"""Highest speed of the return to the target [m/s]."""
SETTLED_DEG = 0.3
"""Within this angle of the commanded heading, PX4's setpoint equals it exactly."""
_TURNING: dict[Flavour, _Turning] = {
    "px4": _Turning(65.0, 90.0, _Turning(58.0, 32.0)),
    "ardupilot": _Turning(200.0, 185.0),
}
"""ArduCopter 4.7-dev turns by 107° with up to 129°/s and by 180° with up to 165°/s."""


@dataclass(slots=True)
class FlyingVehicle:
    """The vehicle; `advance` lets time pass, `command` takes a command of whoever sends one.

    `plane`: around home.
    """

    flavour: Flavour
    plane: geometry.TangentPlane
    frame: Frame = field(default_factory=Frame)
    north_m: float = 0.0
    east_m: float = 0.0
    height_m: float = 40.0
    yaw_deg: float = 0.0
    velocity_m_s: geometry.Vector = (0.0, 0.0, 0.0)
    """North, east, up."""
    acceleration_m_s2: geometry.Vector = (0.0, 0.0, 0.0)
    """Over ground; its third component is not used."""
    mode: int = -1
    armed: bool = True
    target: Target | None = None
    paused: bool = False
    """By DO_PAUSE_CONTINUE, which ArduCopter shows in no message: mode and target stay."""
    velocity_asked_m_s: geometry.Vector | None = None
    """Velocity setpoint of another, under which ArduCopter reports no target."""
    velocity_asked_s: float = 0.0
    wanted_yaw_deg: float | None = None
    yaw_setpoint_deg: float | None = None
    """As PX4 reports it; it turns ahead of the drone."""
    yaw_rate_deg_s: float = 0.0
    turn_left_deg: float = 0.0
    """Of a CONDITION_YAW, signed."""
    turn_rate_deg_s: float = 20.0
    used_wh: float = 0.0
    elapsed_s: float = 0.0
    landed: bool = False
    taking_off: bool = False
    """Until somebody commands something else; ArduPilot shows no target then."""
    takeoff_height_m: float = 2.5
    """Where the command tells none: MIS_TAKEOFF_ALT."""
    idle_s: float = 0.0
    home_up_m: float = 0.0
    """Altitude of home above that of the plane: by PX4's corrections after a take-off."""
    off_ground_s: float | None = None
    """When it took off."""
    _setpoint_rate_deg_s: float = 0.0
    _beyond_m: float = 0.0
    """Distance of the point that it aims at behind the target, on the line of flight."""
    _line: tuple[float, float] = (0.0, 0.0)
    """Direction of the line to the target, from where the command reached the drone."""

    def __post_init__(self) -> None:
        self.landed = self.landed or self.height_m <= 0.0
        if self.mode < 0:
            self.mode = MODES[self.flavour]["position"]

    # ------------------------------------------------------------------- what it shows

    @property
    def commanded(self) -> bool:
        """Whether it is in the mode that flies what it is told."""
        return self.mode == MODES[self.flavour]["hold"]

    @property
    def battery_percent(self) -> float:
        """What is left."""
        return max(0.0, 100.0 * (1.0 - self.used_wh / self.frame.battery_wh))

    @property
    def power_w(self) -> float:
        """What it takes now, at the airspeed that it has."""
        north, east = self.frame.wind_m_s
        airspeed = math.hypot(self.velocity_m_s[0] - north, self.velocity_m_s[1] - east)
        return self.frame.hover_w * (1.0 + self.frame.drag_share * (airspeed / 10.0) ** 3)

    @property
    def place_m(self) -> tuple[float, float]:
        """North and east, gusts included."""
        push = self.frame.gust_m * math.sqrt(2.0) * min(1.0, self.height_m / 2.0)
        return (
            self.north_m + push * math.sin(0.9 * self.elapsed_s),
            self.east_m + push * math.sin(0.7 * self.elapsed_s + 1.0),
        )

    @property
    def shown_height_m(self) -> float:
        """Height above home, gusts included."""
        push = 0.5 * self.frame.gust_m * math.sqrt(2.0) * min(1.0, self.height_m / 2.0)
        return self.height_m + push * math.sin(1.1 * self.elapsed_s + 2.0)

    def latitude_longitude(self) -> tuple[float, float]:
        """Where it is [deg]."""
        return self.plane.to_geodetic(*self.place_m)

    def position(self, boot_ms: int) -> dialect.GlobalPositionInt:
        """Where it is; the height is above home as the autopilot has corrected it."""
        latitude, longitude = self.latitude_longitude()
        north, east, up = self.velocity_m_s
        height = self.shown_height_m
        return dialect.GlobalPositionInt(
            time_boot_ms=boot_ms & 0xFFFFFFFF,
            lat=round(latitude * FULL_SCALE_DEG),
            lon=round(longitude * FULL_SCALE_DEG),
            alt=round((self.plane.altitude_amsl_m + height) * 1e3),
            relative_alt=round((height - self.home_up_m) * 1e3),
            vx=round(north * 100),
            vy=round(east * 100),
            vz=round(-up * 100),
            hdg=math.floor(self.yaw_deg * 100) % 36_000,
        )

    def home(self) -> dialect.HomePosition:
        """Where it started, and the altitude that height is counted from."""
        return dialect.HomePosition(
            latitude=round(self.plane.latitude_deg * FULL_SCALE_DEG),
            longitude=round(self.plane.longitude_deg * FULL_SCALE_DEG),
            altitude=round((self.plane.altitude_amsl_m + self.home_up_m) * 1e3),
            q=(1.0, 0.0, 0.0, 0.0),
        )

    def position_target(self, boot_ms: int) -> dialect.PositionTargetGlobalInt | None:
        """What it flies to; None while there is no target."""
        untold = self.taking_off and self.flavour == "ardupilot"
        if self.target is None or untold or self.velocity_asked_m_s is not None:
            return None
        latitude, longitude = self.plane.to_geodetic(self.target.north_m, self.target.east_m)
        px4 = self.flavour == "px4"
        return dialect.PositionTargetGlobalInt(
            time_boot_ms=boot_ms,
            coordinate_frame=dialect.MavFrame.GLOBAL_INT,
            type_mask=0 if px4 else dialect.PositionTargetTypemask.YAW_IGNORE,
            lat_int=round(latitude * FULL_SCALE_DEG),
            lon_int=round(longitude * FULL_SCALE_DEG),
            alt=self.plane.altitude_amsl_m + self.target.height_m,
            yaw=math.radians(
                self.yaw_deg if self.yaw_setpoint_deg is None else self.yaw_setpoint_deg
            ),
        )

    def wind(self, boot_ms: int) -> dialect.Wind | dialect.WindCov:
        """The wind, as each of the autopilots tells it."""
        north, east = self.frame.wind_m_s
        if self.flavour == "ardupilot":
            comes_deg = math.degrees(math.atan2(-east, -north))
            return dialect.Wind(direction=comes_deg, speed=math.hypot(north, east))
        return dialect.WindCov(
            time_usec=boot_ms * 1000,
            wind_x=north,
            wind_y=east,
            var_horiz=0.5,
            wind_alt=self.plane.altitude_amsl_m + self.height_m,
            horiz_accuracy=0.5,
        )

    def landed_state(self) -> dialect.ExtendedSysState:
        """Whether it stands on the ground."""
        state = dialect.MavLandedState
        return dialect.ExtendedSysState(
            landed_state=state.ON_GROUND if self.landed else state.IN_AIR
        )

    # ------------------------------------------------------------------- what it is told

    def set_mode(self, mode: int) -> None:
        """Change the mode, as a switch on the remote control does."""
        if mode == self.mode:
            return
        self.mode, self.taking_off, self.paused = mode, False, False
        self.wanted_yaw_deg, self.turn_left_deg = None, 0.0
        self.velocity_asked_m_s, self._line = None, (0.0, 0.0)
        names = MODES[self.flavour]
        if self.landed:
            self.target = None
        elif mode == names["return"]:
            height = max(self.height_m, self.frame.return_height_m)
            self.target = Target(north_m=0.0, east_m=0.0, height_m=height)
        elif mode == names["land"]:
            self.target = Target(north_m=self.north_m, east_m=self.east_m, height_m=0.0)
        elif mode in (names["hold"], names.get("takeoff")):
            self.target = self._here()
        else:
            self.target = None

    def command(self, message: dialect.CommandInt | dialect.CommandLong) -> int | None:
        """Handle a command of motion; None for those that are none."""
        match message.command:
            case MavCmd.DO_REPOSITION:
                return self._reposition(message)
            case MavCmd.CONDITION_YAW:
                return self._turn(message)
            case MavCmd.NAV_RETURN_TO_LAUNCH:
                self.set_mode(MODES[self.flavour]["return"])
                return MavResult.ACCEPTED
            case MavCmd.DO_SET_MODE:
                return self._ask_mode(message)
            case MavCmd.NAV_TAKEOFF:
                return self._take_off(message)
            case MavCmd.COMPONENT_ARM_DISARM:
                return self._arm(on=message.param1 == 1.0)
            case _ if message.command == DO_PAUSE_CONTINUE:
                return self._pause(on=message.param1 == 0.0)
        return None

    def _pause(self, *, on: bool) -> int:
        """Stop where it can, in the mode that it is in; ArduCopter in GUIDED alone does it."""
        if self.flavour == "px4":
            return MavResult.UNSUPPORTED
        if not self.commanded or self.landed:
            return MavResult.FAILED
        self.paused = on
        return MavResult.ACCEPTED

    def ask_velocity(self, north_m_s: float, east_m_s: float, up_m_s: float) -> None:
        """Handle SET_POSITION_TARGET_LOCAL_NED with a velocity; only in GUIDED it is flown."""
        if self.flavour == "ardupilot" and self.commanded and not self.landed:
            self.velocity_asked_m_s = (north_m_s, east_m_s, up_m_s)
            self.velocity_asked_s = self.elapsed_s

    def _arm(self, *, on: bool) -> int:
        """As a pilot does; ArduPilot not in the modes that end on the ground."""
        names = MODES[self.flavour]
        ending = self.flavour == "ardupilot" and self.mode in (names["return"], names["land"])
        if not self.landed or (on and ending):
            return MavResult.DENIED
        self.armed, self.idle_s = on, 0.0
        return MavResult.ACCEPTED

    def _take_off(self, message: dialect.CommandInt | dialect.CommandLong) -> int:
        """PX4 takes it disarmed, too, and climbs once somebody arms; ArduPilot does not."""
        z = message.z if isinstance(message, dialect.CommandInt) else message.param7
        px4 = self.flavour == "px4"
        if not px4 and not (self.armed and self.landed and self.commanded and z > 0.0):
            return MavResult.FAILED
        if not self.landed:
            return MavResult.DENIED
        height = z - self.plane.altitude_amsl_m if px4 else z
        if not math.isfinite(height):
            height = self.height_m + self.takeoff_height_m
        if px4:
            self.set_mode(MODES["px4"]["takeoff"])
        north, east = self.place_m
        self.target, self._line = (
            Target(north_m=north, east_m=east, height_m=height),
            (0.0, 0.0),
        )
        self.taking_off, self.idle_s = True, 0.0
        return MavResult.ACCEPTED

    def _ask_mode(self, message: dialect.CommandInt | dialect.CommandLong) -> int:
        if self.flavour == "px4":
            mode = int(message.param2) << 16 | int(message.param3) << 24
        else:
            mode = int(message.param2)
        if mode not in MODES[self.flavour].values():
            return MavResult.DENIED
        self.set_mode(mode)
        return MavResult.ACCEPTED

    def _turn(self, message: dialect.CommandInt | dialect.CommandLong) -> int:
        if self.flavour == "px4":
            return MavResult.UNSUPPORTED
        if not self.commanded:
            return MavResult.FAILED
        way = -1.0 if message.param3 < 0.0 else 1.0
        if message.param4:
            self.turn_left_deg = way * message.param1
        else:
            off = (message.param1 - self.yaw_deg + 180.0) % 360.0 - 180.0
            self.turn_left_deg = off
        self.turn_rate_deg_s = message.param2 or 20.0
        return MavResult.ACCEPTED

    def _reposition(self, message: dialect.CommandInt | dialect.CommandLong) -> int:
        """Fly there, with what each of the autopilots makes of it."""
        px4, whole = self.flavour == "px4", isinstance(message, dialect.CommandInt)
        if not px4 and not whole:
            return MavResult.UNSUPPORTED
        changes = bool(int(message.param2) & 1)
        if not changes and not self.commanded:
            return MavResult.UNSUPPORTED if px4 else MavResult.DENIED
        target = self._asked_place(message)
        if target is None:
            return MavResult.DENIED
        if math.hypot(target.north_m, target.east_m) > self.frame.fence_m:
            return MavResult.ACCEPTED if px4 else MavResult.FAILED
        self.taking_off = False
        if changes:
            self.set_mode(MODES[self.flavour]["hold"])
        self.target, self.velocity_asked_m_s = target, None
        north, east = target.north_m - self.north_m, target.east_m - self.east_m
        way = math.hypot(north, east)
        self._line = (north / way, east / way) if way > LOOKS_UNTIL_M else (0.0, 0.0)
        self._beyond_m = 0.0
        self.wanted_yaw_deg, self.turn_left_deg = None, 0.0
        if px4 and math.isfinite(message.param4):
            self.wanted_yaw_deg = math.degrees(message.param4) % 360.0
        return MavResult.ACCEPTED if changes or not px4 else MavResult.UNSUPPORTED

    def _asked_place(self, message: dialect.CommandInt | dialect.CommandLong) -> Target | None:
        here = self._here()
        if isinstance(message, dialect.CommandInt):
            nowhere = NOWHERE in (message.x, message.y)
            latitude, longitude = message.x / FULL_SCALE_DEG, message.y / FULL_SCALE_DEG
            z, relative = message.z, message.frame in (3, 6)
        else:
            nowhere = not math.isfinite(message.param5 + message.param6)
            latitude, longitude = message.param5, message.param6
            z, relative = message.param7, False
        if nowhere and self.flavour == "ardupilot":
            return None
        height = here.height_m
        if math.isfinite(z):
            absolute = self.flavour == "px4" or not relative
            height = z - self.plane.altitude_amsl_m if absolute else z
        north, east = (
            (here.north_m, here.east_m) if nowhere else self.plane.to_local(latitude, longitude)
        )
        return Target(north_m=north, east_m=east, height_m=height)

    def _here(self) -> Target:
        north, east = self.place_m
        return Target(north_m=north, east_m=east, height_m=self.shown_height_m)

    # ------------------------------------------------------------------- how it moves

    def advance(self, step_s: float) -> None:
        """Let a short time pass."""
        self.elapsed_s += step_s
        if not self.armed:
            return
        self.used_wh += self.power_w * step_s / 3600.0
        if self.landed:
            self._stand(step_s)
            return
        self._correct_home(step_s)
        target = None if self.paused else self.target
        self._move(target, step_s)
        self._look(target or self._here(), step_s)
        self._land()

    def _correct_home(self, step_s: float) -> None:
        """Move the altitude of home, as PX4 1.17 does after a take-off; the drone stays."""
        if self.off_ground_s is None or self.flavour == "ardupilot":
            return
        since_s = self.elapsed_s - self.off_ground_s
        number = math.floor(since_s / HOME_STEP_S)
        due = number > math.floor((since_s - step_s) / HOME_STEP_S)
        if not due or since_s > HOME_CORRECTED_S:
            return
        # Any fixed numbers without a pattern do.
        noise = math.sin(12.9898 * number) * 43758.5453 % 1.0 - 0.5
        wanted = HOME_DRIFT_M * (1.0 - math.exp(-since_s / 40.0)) + 2.0 * HOME_NOISE_M * noise
        if abs(wanted - self.home_up_m) >= HOME_LEAST_M:
            self.home_up_m = wanted

    def _stand(self, step_s: float) -> None:
        """Armed on the ground: leave it when told to, or disarm."""
        self.idle_s += step_s
        if self.taking_off:
            self.landed = self.idle_s < SPOOL_S
            self.off_ground_s = None if self.landed else self.elapsed_s
        elif self.idle_s > IDLE_S:
            self.armed = False

    def _move(self, target: Target | None, step_s: float) -> None:
        climb, level = 0.0, (0.0, 0.0, 0.0)
        if self.velocity_asked_m_s is not None:
            holds = self.elapsed_s - self.velocity_asked_s < VELOCITY_HOLDS_S
            level = self.velocity_asked_m_s if holds and not self.paused else level
            climb, level = level[2], (level[0], level[1], 0.0)
        elif target is not None:
            most = self.frame.climb_m_s
            climb = max(-most, min(most, target.height_m - self.height_m))
            self._pass_by(step_s)
            level = self._towards(target)
        self._accelerate(level, step_s)
        north, east, _ = self.velocity_m_s
        self.velocity_m_s = (north, east, climb)
        self.north_m += north * step_s
        self.east_m += east * step_s
        self.height_m = max(0.0, self.height_m + climb * step_s)

    def _pass_by(self, step_s: float) -> None:
        """Aim behind the target, farther at higher speed, then come back to it."""
        speed = math.hypot(*self.velocity_m_s[:2])
        brakes = _BRAKING[self.flavour]
        way_m = speed**2 / (2.0 * brakes.share * self.frame.acceleration_m_s2)
        beyond_m = min(brakes.beyond_m, brakes.beyond_share * way_m)
        if speed < BACK_BELOW_M_S:
            self._beyond_m *= 1.0 - step_s / brakes.back_s
        self._beyond_m = max(self._beyond_m, beyond_m)

    def _towards(self, target: Target) -> geometry.Vector:
        """Velocity that it aims at: as fast as it can brake from before the target."""
        along, aside = self._line
        north = target.north_m + self._beyond_m * along - self.north_m
        east = target.east_m + self._beyond_m * aside - self.east_m
        ahead, off = north * along + east * aside, east * along - north * aside
        if self.flavour == "px4" and ahead > LOOKS_UNTIL_M:
            kept = max(-BESIDE_M, min(BESIDE_M, off))
            north = ahead * along - (off - kept) * aside
            east = ahead * aside + (off - kept) * along
        left = math.hypot(north, east)
        if left < 1e-6:
            return (0.0, 0.0, 0.0)
        unit = (north / left, east / left, 0.0)
        eased = self.frame.position_gain_hz * left
        nears = sum(a * b for a, b in zip(unit, self.velocity_m_s, strict=True))
        left = max(0.0, left - max(0.0, nears) * AHEAD_S)
        pull, ease = self.frame.acceleration_m_s2, self.frame.jerk_m_s3
        pull *= _BRAKING[self.flavour].share
        lag = pull * pull / ease
        brakes = 0.5 * (math.sqrt(lag * lag + 8.0 * pull * left) - lag)
        speed = min(self.frame.speed_m_s, eased, brakes, self._against_wind_m_s(*unit[:2]))
        return geometry.scale(unit, speed)

    def _accelerate(self, wanted: geometry.Vector, step_s: float) -> None:
        """Come nearer to a velocity over ground, within the limits."""
        now = (self.velocity_m_s[0], self.velocity_m_s[1], 0.0)
        change = geometry.subtract(wanted, now)
        size, ease = geometry.length(change), self.frame.jerk_m_s3
        pull = min(self.frame.acceleration_m_s2, math.sqrt(1.3 * ease * size), 3.0 * size)
        asked = geometry.scale(change, pull / size) if size > 1e-9 else (0.0, 0.0, 0.0)
        jerk = geometry.subtract(asked, self.acceleration_m_s2)
        most, jerks = ease * step_s, geometry.length(jerk)
        if jerks > most:
            jerk = geometry.scale(jerk, most / jerks)
        self.acceleration_m_s2 = geometry.add(self.acceleration_m_s2, jerk)
        self.velocity_m_s = geometry.add(now, geometry.scale(self.acceleration_m_s2, step_s))

    def _against_wind_m_s(self, north: float, east: float) -> float:
        """Greatest speed over ground in a direction."""
        wind_north, wind_east = self.frame.wind_m_s
        along = wind_north * north + wind_east * east
        across = wind_east * north - wind_north * east
        return max(0.0, along + math.sqrt(max(0.0, self.frame.airspeed_m_s**2 - across**2)))

    def _look(self, target: Target, step_s: float) -> None:
        """Turn to what was asked for, or where it flies to."""
        turning = _TURNING[self.flavour]
        if self.turn_left_deg:
            most = self.turn_rate_deg_s * step_s
            step = max(-most, min(most, self.turn_left_deg))
            self.turn_left_deg -= step
            self.yaw_deg = (self.yaw_deg + step) % 360.0
            self.yaw_rate_deg_s = step / step_s
            self.yaw_setpoint_deg = None
            return
        if self.yaw_setpoint_deg is None:
            self.yaw_setpoint_deg, self._setpoint_rate_deg_s = self.yaw_deg, 0.0
        self._move_setpoint(turning, self._wanted_yaw(target), step_s)
        off = (self.yaw_setpoint_deg - self.yaw_deg + 180.0) % 360.0 - 180.0
        self.yaw_rate_deg_s = turning.rate(off, self.yaw_rate_deg_s, step_s)
        self.yaw_deg = (self.yaw_deg + self.yaw_rate_deg_s * step_s) % 360.0

    def _move_setpoint(self, turning: _Turning, wanted: float, step_s: float) -> None:
        """Turn the heading setpoint; with inertia it continues an earlier turn for a while."""
        assert self.yaw_setpoint_deg is not None
        off = (wanted - self.yaw_setpoint_deg + 180.0) % 360.0 - 180.0
        smooth = turning.setpoint
        if smooth is None:
            most = turning.rate_deg_s * step_s
            self._setpoint_rate_deg_s = max(-most, min(most, off)) / step_s
        else:
            self._setpoint_rate_deg_s = smooth.rate(off, self._setpoint_rate_deg_s, step_s)
        self.yaw_setpoint_deg += self._setpoint_rate_deg_s * step_s
        self.yaw_setpoint_deg %= 360.0
        off = (wanted - self.yaw_setpoint_deg + 180.0) % 360.0 - 180.0
        if abs(off) < SETTLED_DEG and abs(self._setpoint_rate_deg_s) < SETTLED_DEG / 0.1:
            self.yaw_setpoint_deg = wanted  # exactly the commanded value
            self._setpoint_rate_deg_s = 0.0

    def _wanted_yaw(self, target: Target) -> float:
        """Heading that was asked for, or the bearing to a target that is not near."""
        assert self.yaw_setpoint_deg is not None
        if self.wanted_yaw_deg is not None or not self.commanded:
            return self.yaw_setpoint_deg if self.wanted_yaw_deg is None else self.wanted_yaw_deg
        place = self.place_m
        north, east = target.north_m - place[0], target.east_m - place[1]
        if math.hypot(north, east) <= LOOKS_UNTIL_M:
            return self.yaw_setpoint_deg
        return math.degrees(math.atan2(east, north)) % 360.0

    def _land(self) -> None:
        """Come down at home, and disarm on the ground."""
        names, target = MODES[self.flavour], self.target
        if self.mode == names.get("takeoff") and target is not None:
            if self.height_m > target.height_m - 0.5:
                self.set_mode(names["hold"])
                self.target = target
            return
        if target is None or self.mode not in (names["return"], names["land"]):
            return
        if self.mode == names["return"] and target.height_m > 0.0:
            at_home = math.hypot(self.north_m, self.east_m) < 1.0
            if at_home and abs(self.height_m - target.height_m) < 1.0:
                self.target = Target(north_m=0.0, east_m=0.0, height_m=0.0)
        elif self.height_m < 0.1:
            self.armed, self.landed, self.target = False, True, None
