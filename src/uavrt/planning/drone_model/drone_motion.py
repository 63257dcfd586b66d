"""Compute a drone's position and its antenna's direction along candidate paths.

A multirotor accelerates, turns at its yaw rate, and does not drift unless the wind exceeds its
speed. A fixed wing keeps its airspeed and turns on circles. All candidate paths of a decision
are computed at once.
"""

from dataclasses import dataclass
from math import hypot
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import ConfigError
from uavrt.core.units import wrap_degrees_360
from uavrt.planning.drone_model.planner_actions import Action, Hold, Return, Rotate

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleState:
    """Time, position, height and heading of the drone."""

    time_s: float
    east_m: float
    north_m: float
    height_m: float
    """Height of the drone above the take-off point [m]."""
    yaw_deg: float = 0.0
    """Heading of the drone's nose and antenna, clockwise from true north [deg]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wind:
    """Velocity of the air relative to the ground."""

    east_m_s: float = 0.0
    north_m_s: float = 0.0

    @property
    def speed_m_s(self) -> float:
        """Speed of the wind [m/s]."""
        return hypot(self.east_m_s, self.north_m_s)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Path:
    """Positions of the drone at the time steps of an action."""

    time_s: _Floats
    """Times of the path's points [s], from one step after the start to the end, shape (n,)."""
    east_m: _Floats
    north_m: _Floats
    height_m: _Floats
    yaw_deg: _Floats

    def state(self, number: int) -> VehicleState:
        """State of the drone at time step `number`."""
        return VehicleState(
            time_s=float(self.time_s[number]),
            east_m=float(self.east_m[number]),
            north_m=float(self.north_m[number]),
            height_m=float(self.height_m[number]),
            yaw_deg=wrap_degrees_360(float(self.yaw_deg[number])),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Legs:
    """Sampled candidate paths from the present position: straight paths or turns in place, all
    with equally many samples.
    """

    duration_s: _Floats
    """Durations of the paths or turns [s], shape (legs,); infinite if the wind is too
    strong."""
    time_s: _Floats
    """Times of each path's sampled points, from now [s], shape (legs, samples)."""
    east_m: _Floats
    north_m: _Floats
    yaw_deg: _Floats


class Vehicle(Protocol):
    """Interface by which planners use the model of a drone."""

    @property
    def speed_m_s(self) -> float:
        """Airspeed in usual flight [m/s]."""

    @property
    def hovers(self) -> bool:
        """True if the drone can stay in place and turn."""

    def durations(
        self, state: VehicleState, east_m: _Floats, north_m: _Floats, wind: Wind
    ) -> _Floats:
        """Duration of the path to each position [s], shape (positions,); infinite if the wind
        is too strong.
        """

    def along(
        self,
        state: VehicleState,
        east_m: _Floats,
        north_m: _Floats,
        wind: Wind,
        time_s: _Floats,
    ) -> Legs:
        """Sample straight paths to positions (legs,) at times (legs, samples) from now [s]."""


def ground_speed_m_s(airspeed_m_s: float, course_rad: _Floats, wind: Wind) -> _Floats:
    """Speed over ground on each course [m/s]; zero or negative if the wind is too strong."""
    along = wind.east_m_s * np.sin(course_rad) + wind.north_m_s * np.cos(course_rad)
    across = wind.east_m_s * np.cos(course_rad) - wind.north_m_s * np.sin(course_rad)
    left = airspeed_m_s**2 - across**2
    return np.asarray(np.where(left > 0.0, along + np.sqrt(np.maximum(left, 0.0)), -1.0))


def headwind(state: VehicleState, home_m: tuple[float, float], speed_m_s: float) -> Wind:
    """Return a wind of a given speed that blows exactly against the flight home."""
    east, north = home_m[0] - state.east_m, home_m[1] - state.north_m
    against = -speed_m_s / max(hypot(east, north), 1e-9)
    return Wind(east_m_s=against * east, north_m_s=against * north)


def _turned_deg(start_deg: float, end_deg: _Floats) -> _Floats:
    return np.asarray(180.0 - np.remainder(180.0 - (end_deg - start_deg), 360.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Multirotor:
    """Motion of a drone that can hover."""

    speed_m_s: float = 10.0
    acceleration_m_s2: float = 4.0
    """Acceleration of the drone [m/s²]; infinite if its speed is assumed to change at once."""
    yaw_rate_deg_s: float = 45.0
    turns_first: bool = False
    """True if the drone first turns to its course and then moves."""
    airspeed_m_s: float | None = None
    """Maximum airspeed of an autopilot that maintains the ground speed `speed_m_s` against the
    wind [m/s]; None if `speed_m_s` is the airspeed."""

    def __post_init__(self) -> None:
        if min(self.speed_m_s, self.acceleration_m_s2, self.yaw_rate_deg_s) <= 0.0:
            raise ConfigError(
                "a multirotor's speed, acceleration and yaw rate must be above 0",
                remedy="Give the autopilot's settings",
            )

    @property
    def hovers(self) -> bool:
        """True: a multirotor can stay in place and turn."""
        return True

    def _ground_speed_m_s(self, course_rad: _Floats, wind: Wind) -> _Floats:
        if self.airspeed_m_s is None:
            return ground_speed_m_s(self.speed_m_s, course_rad, wind)
        most = max(self.airspeed_m_s, self.speed_m_s)
        return np.minimum(self.speed_m_s, ground_speed_m_s(most, course_rad, wind))

    def _profile(
        self, state: VehicleState, east_m: _Floats, north_m: _Floats, wind: Wind
    ) -> tuple[_Floats, _Floats, _Floats, _Floats, _Floats]:
        """For each path: distance [m], ground speed [m/s], turn [deg], and the durations of
        turn and flight [s], shape (legs,) each.
        """
        dx, dy = east_m - state.east_m, north_m - state.north_m
        distance = np.hypot(dx, dy)
        course = np.arctan2(dx, dy)
        speed = self._ground_speed_m_s(course, wind)
        turn = np.where(distance > 0.1, _turned_deg(state.yaw_deg, np.degrees(course)), 0.0)
        turning = np.abs(turn) / self.yaw_rate_deg_s
        steady = np.maximum(speed, 1e-9)
        if np.isinf(self.acceleration_m_s2):
            flying = distance / steady
        else:
            ramp = steady / self.acceleration_m_s2
            short = distance < steady * ramp
            flying = np.where(
                short,
                2.0 * np.sqrt(distance / self.acceleration_m_s2),
                distance / steady + ramp,
            )
        flying = np.where((speed > 0.0) | (distance < 0.1), flying, np.inf)
        return distance, speed, turn, turning, flying

    def durations(
        self, state: VehicleState, east_m: _Floats, north_m: _Floats, wind: Wind
    ) -> _Floats:
        """Duration of the path to each position [s], shape (positions,); infinite if the wind
        is too strong.
        """
        _, _, _, turning, flying = self._profile(state, east_m, north_m, wind)
        return turning + flying if self.turns_first else np.maximum(turning * 0.0, flying)

    def along(
        self,
        state: VehicleState,
        east_m: _Floats,
        north_m: _Floats,
        wind: Wind,
        time_s: _Floats,
    ) -> Legs:
        """Sample the paths to positions (legs,) at times (legs, samples) from now [s]."""
        distance, speed, turn, turning, flying = self._profile(state, east_m, north_m, wind)
        wait = turning if self.turns_first else np.zeros_like(turning)
        moving = np.clip(time_s - wait[:, None], 0.0, flying[:, None])
        if np.isinf(self.acceleration_m_s2):
            gone = speed[:, None] * moving
        else:
            gone = self._gone_m(moving, distance, speed, flying)
        share = np.clip(gone / np.maximum(distance, 0.1)[:, None], 0.0, 1.0)
        done = np.clip(time_s / np.maximum(turning, 1e-9)[:, None], 0.0, 1.0)
        return Legs(
            duration_s=wait + flying,
            time_s=time_s,
            east_m=state.east_m + share * (east_m - state.east_m)[:, None],
            north_m=state.north_m + share * (north_m - state.north_m)[:, None],
            yaw_deg=state.yaw_deg + done * turn[:, None],
        )

    def _gone_m(
        self, moving_s: _Floats, distance_m: _Floats, speed_m_s: _Floats, flying_s: _Floats
    ) -> _Floats:
        """Distance flown at each sample [m], shape (legs, samples), through acceleration,
        steady flight and braking.
        """
        a = self.acceleration_m_s2
        ramp = np.minimum(np.maximum(speed_m_s, 0.0) / a, 0.5 * flying_s)[:, None]
        left = flying_s[:, None] - moving_s
        up = 0.5 * a * np.minimum(moving_s, ramp) ** 2
        steady = a * ramp * np.clip(moving_s - ramp, 0.0, None)
        down = distance_m[:, None] - 0.5 * a * left**2
        return np.where(left < ramp, down, up + steady)


@dataclass(frozen=True, slots=True, kw_only=True)
class FixedWing:
    """Motion of a drone that must keep flying and turns on circles (Consi 2015)."""

    speed_m_s: float = 16.0
    turn_radius_m: float = 60.0

    def __post_init__(self) -> None:
        if min(self.speed_m_s, self.turn_radius_m) <= 0.0:
            raise ConfigError(
                "a fixed wing's speed and turn radius must be above 0",
                remedy="Give the autopilot's settings",
            )

    @property
    def hovers(self) -> bool:
        """False: a fixed wing cannot stay in place."""
        return False

    def _turns(
        self, state: VehicleState, east_m: _Floats, north_m: _Floats
    ) -> tuple[_Floats, _Floats, _Floats]:
        """For each path: side (+1 right) and angle [rad] of the first turn, and length of the
        straight part [m], shape (legs,) each.
        """
        yaw = np.radians(state.yaw_deg)
        dx, dy = east_m - state.east_m, north_m - state.north_m
        ahead = dx * np.sin(yaw) + dy * np.cos(yaw)
        right = dx * np.cos(yaw) - dy * np.sin(yaw)
        radius = self.turn_radius_m
        side = np.where(right >= 0.0, 1.0, -1.0)
        inside = np.hypot(ahead, np.abs(right) - radius) < radius
        side = np.where(inside, -side, side)
        across = radius - side * right
        from_centre = np.maximum(np.hypot(ahead, across), radius)
        straight = np.sqrt(from_centre**2 - radius**2)
        # Angle on the circle at which the tangent meets the place.
        angle = np.arctan2(ahead, across) - np.arccos(np.clip(radius / from_centre, -1, 1))
        return side, np.remainder(angle, 2.0 * np.pi), straight

    def durations(
        self, state: VehicleState, east_m: _Floats, north_m: _Floats, wind: Wind
    ) -> _Floats:
        """Duration of the path to each position [s], shape (positions,): a turn in still air,
        then a straight part in the wind.
        """
        _, angle, straight = self._turns(state, east_m, north_m)
        course = np.arctan2(east_m - state.east_m, north_m - state.north_m)
        speed = ground_speed_m_s(self.speed_m_s, course, wind)
        flying = np.where(speed > 0.0, straight / np.maximum(speed, 1e-9), np.inf)
        return np.asarray(angle * self.turn_radius_m / self.speed_m_s + flying)

    def along(
        self,
        state: VehicleState,
        east_m: _Floats,
        north_m: _Floats,
        wind: Wind,
        time_s: _Floats,
    ) -> Legs:
        """Sample the paths to positions (legs,) at times (legs, samples) from now [s]."""
        side, angle, straight = (one[:, None] for one in self._turns(state, east_m, north_m))
        total = self.durations(state, east_m, north_m, wind)
        radius, yaw = self.turn_radius_m, np.radians(state.yaw_deg)
        circling = angle * radius / self.speed_m_s
        turned = np.minimum(time_s * self.speed_m_s / radius, angle)
        left = np.maximum(total[:, None] - circling, 1e-9)
        gone = straight * np.clip((time_s - circling) / left, 0.0, 1.0)
        ahead = radius * np.sin(turned) + gone * np.cos(turned)
        right = side * (radius * (1.0 - np.cos(turned)) + gone * np.sin(turned))
        return Legs(
            duration_s=total,
            time_s=time_s,
            east_m=state.east_m + ahead * np.sin(yaw) + right * np.cos(yaw),
            north_m=state.north_m + ahead * np.cos(yaw) - right * np.sin(yaw),
            yaw_deg=state.yaw_deg + np.degrees(side * turned),
        )


def flown(
    vehicle: Vehicle,
    state: VehicleState,
    action: Action,
    *,
    home_m: tuple[float, float] = (0.0, 0.0),
    wind: Wind | None = None,
    step_s: float = 1.0,
) -> Path:
    """Return the drone's positions at each time step of an action. Raises `ConfigError` if the
    wind is too strong.
    """
    air = wind or Wind()
    if isinstance(action, Rotate | Hold):
        return _in_place(vehicle, state, action, air, step_s)
    target = home_m if isinstance(action, Return) else (action.east_m, action.north_m)
    return _straight(vehicle, state, target, air, step_s)


def _straight(
    vehicle: Vehicle, state: VehicleState, end_m: tuple[float, float], wind: Wind, step: float
) -> Path:
    east, north = np.array([end_m[0]]), np.array([end_m[1]])
    duration = float(vehicle.durations(state, east, north, wind)[0])
    if not np.isfinite(duration):
        raise ConfigError(
            f"the wind ({wind.east_m_s:.1f} m/s east, {wind.north_m_s:.1f} m/s north) is too "
            f"strong for a drone that flies {vehicle.speed_m_s:g} m/s",
            remedy="Land, or fly downwind only",
        )
    count = max(1, int(np.ceil(duration / step - 1e-6)))
    time = np.arange(1, count + 1, dtype=np.float64) * step
    legs = vehicle.along(state, east, north, wind, time[None, :])
    return Path(
        time_s=state.time_s + time,
        east_m=legs.east_m[0],
        north_m=legs.north_m[0],
        height_m=np.full(len(time), state.height_m),
        yaw_deg=legs.yaw_deg[0],
    )


def _in_place(
    vehicle: Vehicle, state: VehicleState, action: Rotate | Hold, wind: Wind, step: float
) -> Path:
    count = max(1, round(action.duration_s / step))
    time = np.arange(1, count + 1, dtype=np.float64) * step
    turn = action.turn_deg if isinstance(action, Rotate) else 0.0
    east = np.full(len(time), state.east_m)
    north = np.full(len(time), state.north_m)
    yaw = state.yaw_deg + turn * np.minimum(time / action.duration_s, 1.0)
    if not vehicle.hovers and isinstance(vehicle, FixedWing):
        radius, start = vehicle.turn_radius_m, np.radians(state.yaw_deg)
        turned = time * vehicle.speed_m_s / radius
        ahead, right = radius * np.sin(turned), radius * (1.0 - np.cos(turned))
        east = state.east_m + ahead * np.sin(start) + right * np.cos(start)
        north = state.north_m + ahead * np.cos(start) - right * np.sin(start)
        yaw = state.yaw_deg + np.degrees(turned)
    return Path(
        time_s=state.time_s + time,
        east_m=east,
        north_m=north,
        height_m=np.full(len(time), state.height_m),
        yaw_deg=yaw,
    )
