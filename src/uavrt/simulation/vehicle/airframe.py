"""Simulate the motion of a vehicle that accelerates and brakes as PX4 and ArduCopter do."""

import math
from dataclasses import dataclass
from typing import Literal

from uavrt.simulation.scene import geometry

Flavour = Literal["px4", "ardupilot"]
HOLD_HEADING_M = 2.0
"""Distance to the target above which the drone faces the target [m]; closer to it, the heading
does not change."""
LINE_TOLERANCE_M = 0.8
"""Distance from the flight line that PX4 tolerates until `HOLD_HEADING_M` from its end [m]."""
VELOCITY_TIMEOUT_S = 3.0
"""Time after which ArduCopter sets a velocity setpoint to zero if it is not repeated [s]
(GUID_TIMEOUT)."""
RETURN_SPEED_M_S = 0.4
"""Speed below which the drone starts to fly back to the target after an overshoot [m/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """Properties of a simulated vehicle: limits of its motion, power, fence and wind."""

    speed_m_s: float = 8.0
    climb_m_s: float = 3.0
    acceleration_m_s2: float = 3.0
    jerk_m_s3: float = 4.0
    position_gain_hz: float = math.inf
    """Ratio of the highest allowed speed to the distance from the target [1/s] (PSC_POSXY_P,
    MPC_XY_P)."""
    gust_m: float = 0.2
    """Standard deviation of the drone's position due to gusts [m]."""
    hover_w: float = 400.0
    battery_wh: float = 120.0
    fence_m: float = 5_000.0
    wind_m_s: tuple[float, float] = (0.0, 0.0)
    """Wind velocity to the north and east [m/s]."""
    airspeed_m_s: float = 12.0
    drag_share: float = 0.1
    """Power against drag at an airspeed of 10 m/s, as a fraction of the hover power; it grows
    with the cube of the airspeed."""
    return_height_m: float = 30.0
    """Minimum height of the return flight [m]: RTL_RETURN_ALT (PX4, 60 m by default), RTL_ALT
    (ArduPilot, 15 m)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """Target position of a simulated vehicle."""

    north_m: float
    east_m: float
    height_m: float


@dataclass(frozen=True, slots=True)
class _Braking:
    """Parameters of how an autopilot brakes at its target."""

    share: float
    """Deceleration at the target as a fraction of the drone's greatest acceleration."""
    overshoot_share: float
    """Overshoot as a fraction of the braking distance."""
    overshoot_m: float
    return_s: float
    """Time constant of the return to the target after an overshoot [s]."""
    early_s: float
    """Time by which braking begins earlier because the jerk is limited [s]."""
    early_while_accelerating_s: float
    """Time by which braking begins earlier if the vehicle is still accelerating towards the
    target [s]."""


_BRAKING: dict[Flavour, _Braking] = {
    "px4": _Braking(0.45, 0.1, 0.95, 6.0, 0.35, 0.35),
    "ardupilot": _Braking(0.87, 0.048, 0.46, 0.5, 0.15, 0.45),
}
"""Measured braking of two autopilots. PX4 1.17 (SIH) overshoots by 0.4 to 1.5 m from 5 m/s
(median 0.83 m) and is at rest 7 s after it was 3 m off. ArduCopter 4.7-dev (SITL) brakes with
2.6 m/s². From 10 m/s it overshoots by 0.60 to 0.65 m and is at rest after 2.1 to 2.5 s; from
5.7 m/s the values are 0.25 m and 0.7 s."""


class Airframe:
    """Position, velocity and battery of a simulated vehicle."""

    def __init__(
        self, flavour: Flavour, frame: Frame, north_m: float, east_m: float, height_m: float
    ) -> None:
        self._flavour, self.frame = flavour, frame
        self.north_m, self.east_m, self.height_m = north_m, east_m, height_m
        self.velocity_m_s: geometry.Vector = (0.0, 0.0, 0.0)
        self._acceleration_m_s2: geometry.Vector = (0.0, 0.0, 0.0)
        """Acceleration over ground north and east [m/s²]; the third number is unused."""
        self.elapsed_s = self.used_wh = 0.0
        self.velocity_setpoint: tuple[geometry.Vector, float] | None = None
        """Velocity setpoint and its time [s]; meanwhile ArduCopter reports no target."""
        self._overshoot_m = 0.0
        """Distance of the aiming point beyond the target, along the line of flight [m]."""
        self._line = (0.0, 0.0)
        """Direction to the target from the position where the command arrived (unit vector)."""

    @property
    def battery_percent(self) -> float:
        """Remaining charge of the battery [%]."""
        return max(0.0, 100.0 * (1.0 - self.used_wh / self.frame.battery_wh))

    @property
    def power_w(self) -> float:
        """Power at the present airspeed [W]."""
        north, east = self.frame.wind_m_s
        airspeed = math.hypot(self.velocity_m_s[0] - north, self.velocity_m_s[1] - east)
        return self.frame.hover_w * (1.0 + self.frame.drag_share * (airspeed / 10.0) ** 3)

    @property
    def place_m(self) -> tuple[float, float]:
        """Position north and east of home, including gusts [m]."""
        push = self.frame.gust_m * math.sqrt(2.0) * min(1.0, self.height_m / 2.0)
        return (
            self.north_m + push * math.sin(0.9 * self.elapsed_s),
            self.east_m + push * math.sin(0.7 * self.elapsed_s + 1.0),
        )

    @property
    def shown_height_m(self) -> float:
        """Height above home, including gusts [m]."""
        push = 0.5 * self.frame.gust_m * math.sqrt(2.0) * min(1.0, self.height_m / 2.0)
        return self.height_m + push * math.sin(1.1 * self.elapsed_s + 2.0)

    @property
    def here(self) -> Target:
        """Present position of the vehicle as a target, including the shift by gusts."""
        north, east = self.place_m
        return Target(north_m=north, east_m=east, height_m=self.shown_height_m)

    def elapse(self, step_s: float, *, armed: bool) -> None:
        """Advance the time of the simulation; an armed vehicle drains its battery."""
        self.elapsed_s += step_s
        if armed:
            self.used_wh += self.power_w * step_s / 3600.0

    def end_leg(self) -> None:
        """End the simulated overshoot, so that the vehicle flies straight to the target."""
        self._line = (0.0, 0.0)

    def begin_leg(self, target: Target) -> None:
        """Start to fly along a line to a new target; a velocity setpoint ends."""
        north, east = target.north_m - self.north_m, target.east_m - self.east_m
        way = math.hypot(north, east)
        self._line = (north / way, east / way) if way > HOLD_HEADING_M else (0.0, 0.0)
        self._overshoot_m, self.velocity_setpoint = 0.0, None

    def set_velocity(self, velocity_m_s: geometry.Vector | None) -> None:
        """Follow a velocity setpoint; with None, fly to the target again."""
        self.velocity_setpoint = (
            None if velocity_m_s is None else (velocity_m_s, self.elapsed_s)
        )

    def move(self, target: Target | None, step_s: float, *, paused: bool) -> None:
        """Move the vehicle for `step_s`, to its target or with its velocity setpoint.

        Without a target and a setpoint the vehicle stops.
        """
        climb, level = 0.0, (0.0, 0.0, 0.0)
        if self.velocity_setpoint is not None:
            velocity, asked_s = self.velocity_setpoint
            if self.elapsed_s - asked_s < VELOCITY_TIMEOUT_S and not paused:
                climb, level = velocity[2], (velocity[0], velocity[1], 0.0)
        elif target is not None:
            most = self.frame.climb_m_s
            climb = max(-most, min(most, target.height_m - self.height_m))
            self._overshoot(step_s)
            level = self._towards(target)
        self._accelerate(level, step_s)
        north, east, _ = self.velocity_m_s
        self.velocity_m_s = (north, east, climb)
        self.north_m += north * step_s
        self.east_m += east * step_s
        self.height_m = max(0.0, self.height_m + climb * step_s)

    def _overshoot(self, step_s: float) -> None:
        speed = math.hypot(*self.velocity_m_s[:2])
        brakes = _BRAKING[self._flavour]
        way_m = speed**2 / (2.0 * brakes.share * self.frame.acceleration_m_s2)
        overshoot_m = min(brakes.overshoot_m, brakes.overshoot_share * way_m)
        if speed < RETURN_SPEED_M_S:
            self._overshoot_m *= 1.0 - step_s / brakes.return_s
        self._overshoot_m = max(self._overshoot_m, overshoot_m)

    def _towards(self, target: Target) -> geometry.Vector:
        along, aside = self._line
        north = target.north_m + self._overshoot_m * along - self.north_m
        east = target.east_m + self._overshoot_m * aside - self.east_m
        ahead, off = north * along + east * aside, east * along - north * aside
        if self._flavour == "px4" and ahead > HOLD_HEADING_M:
            kept = max(-LINE_TOLERANCE_M, min(LINE_TOLERANCE_M, off))
            north = ahead * along - (off - kept) * aside
            east = ahead * aside + (off - kept) * along
        left = math.hypot(north, east)
        if left < 1e-6:
            return (0.0, 0.0, 0.0)
        unit = (north / left, east / left, 0.0)
        eased = self.frame.position_gain_hz * left
        nears = sum(a * b for a, b in zip(unit, self.velocity_m_s, strict=True))
        brakes = _BRAKING[self._flavour]
        gains = sum(a * b for a, b in zip(unit, self._acceleration_m_s2, strict=True)) > 0.0
        early_s = brakes.early_while_accelerating_s if gains else brakes.early_s
        left = max(0.0, left - max(0.0, nears) * early_s)
        pull, ease = self.frame.acceleration_m_s2 * brakes.share, self.frame.jerk_m_s3
        lag = pull * pull / ease
        stops = 0.5 * (math.sqrt(lag * lag + 8.0 * pull * left) - lag)
        speed = min(self.frame.speed_m_s, eased, stops, self._against_wind_m_s(*unit[:2]))
        return geometry.scale(unit, speed)

    def _accelerate(self, wanted: geometry.Vector, step_s: float) -> None:
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
        """Highest ground speed in a direction [m/s]; wind matters, as airspeed is limited."""
        wind_north, wind_east = self.frame.wind_m_s
        along = wind_north * north + wind_east * east
        across = wind_east * north - wind_north * east
        return max(0.0, along + math.sqrt(max(0.0, self.frame.airspeed_m_s**2 - across**2)))
