"""Generate candidate paths for planners and check which of them may be flown."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.planning.drone_model.drone_motion import Legs, VehicleState
from uavrt.planning.drone_model.planner_actions import FlyTo
from uavrt.planning.situation import Situation

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CandidatePaths:
    """Straight paths from the drone's position, with the results of the checks whether they may
    be flown.
    """

    east_m: _Floats
    """East coordinate of each candidate path's end [m], shape (paths,)."""
    north_m: _Floats
    refused: list[str | None]
    """For each candidate path, the reason why it must not be flown; None if it may."""
    disturbs: NDArray[np.bool_]
    """True for paths refused only because they may come too close to an animal, shape
    (paths,)."""
    kept: _Floats
    """Probability that each path keeps the set distance from the animal most at risk, shape
    (paths,)."""

    @property
    def allowed(self) -> NDArray[np.bool_]:
        """True for the paths that may be flown, shape (paths,)."""
        return np.array([reason is None for reason in self.refused])

    def action(self, number: int) -> FlyTo:
        """Return the flight to the end of path `number` as an action."""
        return FlyTo(east_m=float(self.east_m[number]), north_m=float(self.north_m[number]))


def headings(
    situation: Situation, count: int, distance_m: float, *, first_deg: float = 0.0
) -> tuple[_Floats, _Floats]:
    """End points, east and north [m], of paths of equal length in evenly spread directions."""
    angle = np.radians(first_deg + np.arange(count) * 360.0 / count)
    state = situation.state
    return (
        state.east_m + distance_m * np.sin(angle),
        state.north_m + distance_m * np.cos(angle),
    )


def tangents(
    state_m: tuple[float, float], place_m: tuple[float, float], radius_m: float
) -> tuple[_Floats, _Floats]:
    """Ends of three paths: to a circle's nearest edge, and to its two tangent points."""
    dx, dy = place_m[0] - state_m[0], place_m[1] - state_m[1]
    distance = max(float(np.hypot(dx, dy)), 1e-6)
    course = np.arctan2(dx, dy)
    if distance <= radius_m:
        # Inside: straight away from the middle.
        out = radius_m - distance
        return (
            np.array([state_m[0] - out * np.sin(course)]),
            np.array([state_m[1] - out * np.cos(course)]),
        )
    off = np.arcsin(min(1.0, radius_m / distance))
    touching = np.sqrt(distance**2 - radius_m**2)
    angles = np.array([course, course - off, course + off])
    lengths = np.array([distance - radius_m, touching, touching])
    return state_m[0] + lengths * np.sin(angles), state_m[1] + lengths * np.cos(angles)


def checked(
    situation: Situation, east_m: _Floats, north_m: _Floats, *, stays_s: float = 0.0
) -> CandidatePaths:
    """Check which paths, including stays at their ends, are allowed by the area, other drones
    and animals.
    """
    state = situation.state
    here = (state.east_m, state.north_m)
    refused = situation.area.refusals(here, east_m, north_m, state.height_m)
    refused = _near_others(situation, east_m, north_m, refused)
    if not situation.vehicle.hovers:
        refused = _circling(situation, east_m, north_m, refused)
    kept = np.ones(len(east_m))
    rule = situation.keep_away
    if rule is not None:
        kept = rule.kept(
            situation.beliefs,
            here,
            east_m,
            north_m,
            speed_m_s=situation.vehicle.speed_m_s,
            stays_s=stays_s,
        ).min(axis=0)
    least = 0.0 if rule is None else rule.probability
    disturbs = np.array([one is None for one in refused]) & (kept < least)
    if rule is not None:
        reason = f"the path may come within {rule.radius_m * rule.margin:.0f} m of an animal"
        refused = [reason if near else one for one, near in zip(refused, disturbs, strict=True)]
    return CandidatePaths(
        east_m=east_m, north_m=north_m, refused=refused, disturbs=disturbs, kept=kept
    )


def _near_others(
    situation: Situation, east_m: _Floats, north_m: _Floats, refused: list[str | None]
) -> list[str | None]:
    """Refuse paths close to other drones' paths; a drone that is already too close may only
    move away.
    """
    others, state = situation.others, situation.state
    if others is None or not others.strips:
        return refused
    apart, start = others.separation, (state.east_m, state.north_m)
    near = others.strip_distance_m(start, east_m, north_m)
    place = np.array([state.east_m]), np.array([state.north_m])
    now = float(others.strip_distance_m(start, *place)[0])
    least = np.clip(now - 1e-6, apart.distance_m, apart.margin * apart.distance_m)
    reason = f"the path comes within {apart.distance_m:.0f} m of another drone's path"
    return [
        one or (reason if off < least else None) for one, off in zip(refused, near, strict=True)
    ]


def here(situation: Situation) -> CandidatePaths:
    """Checked candidate "stay here for one planner cycle", a path of zero length."""
    state = situation.state
    place = np.array([state.east_m]), np.array([state.north_m])
    return checked(situation, *place, stays_s=situation.cycle_s)


def _circling(
    situation: Situation, east_m: _Floats, north_m: _Floats, refused: list[str | None]
) -> list[str | None]:
    """Refuse paths of a fixed wing if the curve that it would fly, or a circle to turn back,
    leaves the allowed area.
    """
    state, vehicle = situation.state, situation.vehicle
    spans = vehicle.durations(state, east_m, north_m, situation.wind)
    spans = np.where(np.isfinite(spans), np.maximum(spans, 1.0), 1.0)
    legs = sampled(situation, east_m, north_m, spans, 60)
    out = list(refused)
    for number in range(len(east_m)):
        if out[number] is None:
            x, y = legs.east_m[number], legs.north_m[number]
            out[number] = situation.area.refusal(x, y, state.height_m)
        if out[number] is None:
            out[number] = _no_room(situation, legs, number)
    return out


def _no_room(situation: Situation, legs: Legs, number: int) -> str | None:
    """Reason why a fixed wing has no room for a full circle after a planner cycle or at a
    path's end; None if it has.
    """
    radius = getattr(situation.vehicle, "turn_radius_m", 0.0)
    at_cycle = int(np.searchsorted(legs.time_s[number], situation.cycle_s))
    turn = np.linspace(0.0, 2.0 * np.pi, 25)
    for place in {min(at_cycle, legs.time_s.shape[1] - 1), legs.time_s.shape[1] - 1}:
        yaw = np.radians(legs.yaw_deg[number, place])
        fits = False
        for side in (1.0, -1.0):
            ahead, right = radius * np.sin(turn), side * radius * (1.0 - np.cos(turn))
            x = legs.east_m[number, place] + ahead * np.sin(yaw) + right * np.cos(yaw)
            y = legs.north_m[number, place] + ahead * np.cos(yaw) - right * np.sin(yaw)
            fits |= situation.area.refusal(x, y, situation.state.height_m) is None
        if not fits:
            return "the path leaves no room to turn back"
    return None


def sampled(
    situation: Situation, east_m: _Floats, north_m: _Floats, spans_s: _Floats, samples: int
) -> Legs:
    """Sample each path at the middles of equal shares of its duration."""
    shares = (np.arange(samples) + 0.5) / samples
    return situation.vehicle.along(
        situation.state, east_m, north_m, situation.wind, spans_s[:, None] * shares
    )


def turning(state: VehicleState, turn_deg: float, duration_s: float, samples: int) -> Legs:
    """Return positions and headings during a turn in place, in the form of sampled paths."""
    shares = (np.arange(samples) + 0.5) / samples
    return Legs(
        duration_s=np.array([duration_s]),
        time_s=(duration_s * shares)[None],
        east_m=np.full((1, samples), state.east_m),
        north_m=np.full((1, samples), state.north_m),
        yaw_deg=(state.yaw_deg + turn_deg * shares)[None],
    )
