"""Path of the simulated drone: a list of legs with smooth changes of position and heading."""

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le

from uavrt.simulation.scene import geometry
from uavrt.simulation.scene.record import ScenarioRecord

_GRAVITY_M_S2 = 9.80665
# Shares of a leg spent in speeding up, and the same again in slowing down. The peak rate is
# 1/(1 - ease) times the mean: 1.25 in turning; a way s in T takes 6.6·s/T² of acceleration.
_TURN_EASE = 0.2
_MOVE_EASE = 0.35


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg(ScenarioRecord):
    """Part of the flight that starts and ends at rest; a value of None stays unchanged."""

    duration_s: Annotated[float, Gt(0)]
    north_m: float | None = None
    """End position of the leg: distance north of home [m]; None: unchanged."""
    east_m: float | None = None
    height_m: Annotated[float, Ge(0)] | None = None
    turn_deg: float = 0.0
    """Change of heading during the leg, clockwise [°]; 360 is a full turn on the spot."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight(ScenarioRecord):
    """Whole flight of the simulated drone; it rests before the first and after the last leg."""

    north_m: float = 0.0
    """Start position: distance north of home [m]."""
    east_m: float = 0.0
    height_m: Annotated[float, Ge(0)] = 0.0
    heading_deg: float = 0.0
    wobble_deg: Annotated[float, Ge(0), Le(20)] = 1.0
    """Standard deviation of roll and pitch that gusts cause in the air [°]."""
    drag_per_s: Annotated[float, Ge(0), Le(2)] = 0.15
    """Ratio of the deceleration by drag to the speed [1/s]; 0.15/s tilts the drone by 9° at 10
    m/s."""
    leg: tuple[Leg, ...] = ()

    @property
    def duration_s(self) -> float:
        """Total duration of all legs [s]."""
        return sum(leg.duration_s for leg in self.leg)


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleState:
    """Position and attitude of the drone in the tangent plane at home."""

    position_ned_m: tuple[float, float, float]
    heading_deg: float
    quaternion_wxyz: tuple[float, float, float, float]
    velocity_ned_m_s: tuple[float, float, float]


def _progress(time_share: float, ease: float) -> tuple[float, float, float]:
    """Fraction of a leg's path that is flown, and its first two derivatives.

    The speed rises as 3x² - 2x³ during the first fraction `ease` of the time and falls
    correspondingly during the last.
    """
    top = 1.0 / (1.0 - ease)
    if time_share <= 0.0:
        return 0.0, 0.0, 0.0
    if time_share >= 1.0:
        return 1.0, 0.0, 0.0
    if time_share > 0.5:
        share, speed, acceleration = _progress(1.0 - time_share, ease)
        return 1.0 - share, speed, -acceleration
    if time_share >= ease:
        return top * (time_share - ease / 2), top, 0.0
    x = time_share / ease
    speed = top * (3 - 2 * x) * x * x
    return top * ease * (x**3 - x**4 / 2), speed, top / ease * 6 * x * (1 - x)


def _wobble(flight: Flight, elapsed_s: float, height_m: float, phase: float) -> float:
    """Tilt caused by gusts [°]: sum of three sines below 1.1 Hz; 0 on the ground."""
    sines = sum(
        math.sin(2 * math.pi * frequency * elapsed_s + phase * (number + 1))
        for number, frequency in enumerate((0.23, 0.57, 1.03))
    )
    return flight.wobble_deg * math.sqrt(2 / 3) * sines * min(1.0, height_m / 2.0)


def vehicle_state(flight: Flight, elapsed_s: float) -> VehicleState:
    """Compute the drone's position and attitude at a time of the flight [s].

    Roll and pitch are those that a multirotor needs to accelerate and to fly against drag.
    """
    place = (flight.north_m, flight.east_m, flight.height_m)
    heading = flight.heading_deg
    velocity = acceleration = (0.0, 0.0, 0.0)
    left_s = elapsed_s
    for leg in flight.leg:
        if left_s <= 0.0:
            break
        goal = (
            place[0] if leg.north_m is None else leg.north_m,
            place[1] if leg.east_m is None else leg.east_m,
            place[2] if leg.height_m is None else leg.height_m,
        )
        share, speed, pull = _progress(left_s / leg.duration_s, _MOVE_EASE)
        way = geometry.subtract(goal, place)
        place = geometry.add(place, geometry.scale(way, share))
        velocity = geometry.scale(way, speed / leg.duration_s)
        acceleration = geometry.scale(way, pull / leg.duration_s**2)
        heading += leg.turn_deg * _progress(left_s / leg.duration_s, _TURN_EASE)[0]
        left_s -= leg.duration_s
    return _state(flight, elapsed_s, place, velocity, acceleration, heading)


def _state(
    flight: Flight,
    elapsed_s: float,
    place: geometry.Vector,
    velocity: geometry.Vector,
    acceleration: geometry.Vector,
    heading_deg: float,
) -> VehicleState:
    push_north = acceleration[0] + flight.drag_per_s * velocity[0]
    push_east = acceleration[1] + flight.drag_per_s * velocity[1]
    sine, cosine = math.sin(math.radians(heading_deg)), math.cos(math.radians(heading_deg))
    forward, right = (
        push_north * cosine + push_east * sine,
        push_east * cosine - push_north * sine,
    )
    pitch = -math.degrees(math.atan2(forward, _GRAVITY_M_S2))
    roll = math.degrees(math.atan2(right, _GRAVITY_M_S2))
    height = place[2]
    return VehicleState(
        position_ned_m=(place[0], place[1], -height),
        heading_deg=heading_deg % 360.0,
        quaternion_wxyz=geometry.from_euler_deg(
            roll + _wobble(flight, elapsed_s, height, 1.0),
            pitch + _wobble(flight, elapsed_s, height, 2.0),
            heading_deg,
        ),
        velocity_ned_m_s=(velocity[0], velocity[1], -velocity[2]),
    )
