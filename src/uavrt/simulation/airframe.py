"""Motion of a vehicle: it speeds up, brakes and drifts as PX4 and ArduCopter do. Pure."""

import math
from dataclasses import dataclass
from typing import Literal

from uavrt.simulation import geometry

Flavour = Literal["px4", "ardupilot"]
LOOKS_UNTIL_M = 2.0
"""Distance to the target below which the heading stays; beyond it, it is the bearing."""
BESIDE_M = 0.8
"""Offset from the line to its target that PX4 does not correct before `LOOKS_UNTIL_M` [m]."""
AHEAD_S = 0.35
"""Time by which braking begins early, so that the limit of jerk causes no overshoot."""
VELOCITY_HOLDS_S = 3.0
"""ArduCopter's GUID_TIMEOUT: a velocity setpoint without another after it becomes zero."""
BACK_BELOW_M_S = 0.4
"""Highest speed of the return to the target [m/s]."""


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
    """Standard deviation of the position due to gusts."""
    hover_w: float = 400.0
    battery_wh: float = 120.0
    fence_m: float = 5_000.0
    """Radius of the fence around home."""
    wind_m_s: tuple[float, float] = (0.0, 0.0)
    """Velocity of the air: north, east."""
    airspeed_m_s: float = 12.0
    """Greatest airspeed."""
    drag_share: float = 0.1
    """Additional power of drag at an airspeed of 10 m/s, as a share of hovering; grows with the
    cube."""
    return_height_m: float = 30.0
    """Least height of the return: RTL_RETURN_ALT (PX4, 60 m by default), RTL_ALT (ArduPilot, 15
    m)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """Position, height and heading that it flies to."""

    north_m: float
    east_m: float
    height_m: float
    """Height above home."""


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


class Airframe:
    """Position, velocity and battery of a vehicle."""

    def __init__(
        self, flavour: Flavour, frame: Frame, north_m: float, east_m: float, height_m: float
    ) -> None:
        self._flavour, self.frame = flavour, frame
        self.north_m, self.east_m, self.height_m = north_m, east_m, height_m
        self.velocity_m_s: geometry.Vector = (0.0, 0.0, 0.0)
        """North, east, up."""
        self._acceleration_m_s2: geometry.Vector = (0.0, 0.0, 0.0)
        """Over ground; its third component is not used."""
        self.elapsed_s = self.used_wh = 0.0
        self.velocity_asked: tuple[geometry.Vector, float] | None = None
        """Velocity setpoint, under which ArduCopter reports no target, and when it came."""
        self._beyond_m = 0.0
        """Distance of the aiming point behind the target, on the line of flight."""
        self._line = (0.0, 0.0)
        """Direction of the line to the target, from where the command reached the drone."""

    @property
    def battery_percent(self) -> float:
        """Remaining charge."""
        return max(0.0, 100.0 * (1.0 - self.used_wh / self.frame.battery_wh))

    @property
    def power_w(self) -> float:
        """Power at the present airspeed."""
        north, east = self.frame.wind_m_s
        airspeed = math.hypot(self.velocity_m_s[0] - north, self.velocity_m_s[1] - east)
        return self.frame.hover_w * (1.0 + self.frame.drag_share * (airspeed / 10.0) ** 3)

    @property
    def place_m(self) -> tuple[float, float]:
        """North and east, including gusts."""
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

    @property
    def here(self) -> Target:
        """The present place as a target, gusts included."""
        north, east = self.place_m
        return Target(north_m=north, east_m=east, height_m=self.shown_height_m)

    def elapse(self, step_s: float, *, armed: bool) -> None:
        """Advance the time; drain the battery of an armed vehicle."""
        self.elapsed_s += step_s
        if armed:
            self.used_wh += self.power_w * step_s / 3600.0

    def end_leg(self) -> None:
        """Aim straight at the target from now on."""
        self._line = (0.0, 0.0)

    def begin_leg(self, target: Target) -> None:
        """Aim along the line to a new target, instead of a velocity setpoint."""
        north, east = target.north_m - self.north_m, target.east_m - self.east_m
        way = math.hypot(north, east)
        self._line = (north / way, east / way) if way > LOOKS_UNTIL_M else (0.0, 0.0)
        self._beyond_m, self.velocity_asked = 0.0, None

    def ask_velocity(self, velocity_m_s: geometry.Vector | None) -> None:
        """Follow a velocity setpoint; None: targets again."""
        self.velocity_asked = None if velocity_m_s is None else (velocity_m_s, self.elapsed_s)

    def move(self, target: Target | None, step_s: float, *, paused: bool) -> None:
        """Fly towards a target or with a velocity setpoint, or stop."""
        climb, level = 0.0, (0.0, 0.0, 0.0)
        if self.velocity_asked is not None:
            velocity, asked_s = self.velocity_asked
            if self.elapsed_s - asked_s < VELOCITY_HOLDS_S and not paused:
                climb, level = velocity[2], (velocity[0], velocity[1], 0.0)
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
        """Overshoot the target, farther at higher speed, then come back to it."""
        speed = math.hypot(*self.velocity_m_s[:2])
        brakes = _BRAKING[self._flavour]
        way_m = speed**2 / (2.0 * brakes.share * self.frame.acceleration_m_s2)
        beyond_m = min(brakes.beyond_m, brakes.beyond_share * way_m)
        if speed < BACK_BELOW_M_S:
            self._beyond_m *= 1.0 - step_s / brakes.back_s
        self._beyond_m = max(self._beyond_m, beyond_m)

    def _towards(self, target: Target) -> geometry.Vector:
        """Target velocity: the highest that allows braking before the target."""
        along, aside = self._line
        north = target.north_m + self._beyond_m * along - self.north_m
        east = target.east_m + self._beyond_m * aside - self.east_m
        ahead, off = north * along + east * aside, east * along - north * aside
        if self._flavour == "px4" and ahead > LOOKS_UNTIL_M:
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
        pull *= _BRAKING[self._flavour].share
        lag = pull * pull / ease
        brakes = 0.5 * (math.sqrt(lag * lag + 8.0 * pull * left) - lag)
        speed = min(self.frame.speed_m_s, eased, brakes, self._against_wind_m_s(*unit[:2]))
        return geometry.scale(unit, speed)

    def _accelerate(self, wanted: geometry.Vector, step_s: float) -> None:
        """Change the velocity towards one over ground, within the limits."""
        now = (self.velocity_m_s[0], self.velocity_m_s[1], 0.0)
        change = geometry.subtract(wanted, now)
        size, ease = geometry.length(change), self.frame.jerk_m_s3
        pull = min(self.frame.acceleration_m_s2, math.sqrt(1.3 * ease * size), 3.0 * size)
        asked = geometry.scale(change, pull / size) if size > 1e-9 else (0.0, 0.0, 0.0)
        jerk = geometry.subtract(asked, self._acceleration_m_s2)
        most, jerks = ease * step_s, geometry.length(jerk)
        if jerks > most:
            jerk = geometry.scale(jerk, most / jerks)
        self._acceleration_m_s2 = geometry.add(self._acceleration_m_s2, jerk)
        self.velocity_m_s = geometry.add(now, geometry.scale(self._acceleration_m_s2, step_s))

    def _against_wind_m_s(self, north: float, east: float) -> float:
        """Greatest speed over ground in a direction."""
        wind_north, wind_east = self.frame.wind_m_s
        along = wind_north * north + wind_east * east
        across = wind_east * north - wind_north * east
        return max(0.0, along + math.sqrt(max(0.0, self.frame.airspeed_m_s**2 - across**2)))
