"""Positions and paths of the other drones in a shared search; no I/O.

The drones have no common clock. So the whole straight path from a drone's last known position
to its goal is reserved for it, and nothing depends on the delay of messages.
"""

from collections.abc import Collection, Sequence
from itertools import pairwise

import numpy as np

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import Neighbour
from uavrt.guidance.operator_orders import Place
from uavrt.guidance.safety import SAFETY
from uavrt.planning.beliefs import Beliefs
from uavrt.planning.division import Start
from uavrt.planning.drone_model.drone_motion import Path, VehicleState
from uavrt.planning.drone_model.other_drones import OtherDrones, Separation, Strip
from uavrt.planning.shares import tags_by_drone

SEPARATION = Separation()
_OWN = 0
"""Number of this drone in calculations; other drones have numbers from 1."""
_Metres = tuple[float, float]


def paths_of(others: Sequence[Neighbour], plane: TangentPlane) -> tuple[Strip, ...]:
    """Return the strips reserved for other drones, along their present and assigned paths."""
    return tuple(strip for one in others for strip in pairwise(_corners(one, plane)))


def _corners(one: Neighbour, plane: TangentPlane) -> list[_Metres]:
    """Return another drone's position, goal, and leg assigned next, as (east, north) [m]."""
    course = one.course
    if course is None:
        return []
    places = [course.place, course.goal, *course.requested_leg]
    return [_local(plane, place) for place in places]


def _local(plane: TangentPlane, place: Place) -> _Metres:
    east, north = plane.to_local(*place)
    return float(east), float(north)


def other_drones_of(
    others: Sequence[Neighbour],
    state: VehicleState,
    plane: TangentPlane,
    beliefs: Beliefs,
    found: Collection[int],
    held: Collection[int],
    *,
    speed_m_s: float,
) -> tuple[OtherDrones, tuple[int, ...]]:
    """Return the planner's data on other drones, and the tags that this drone searches for."""
    starts = {_OWN: Start(east_m=state.east_m, north_m=state.north_m)}
    owners, listening = dict.fromkeys(held, _OWN), []
    for one in others:
        course = one.course
        if course is None or one.age_s > SAFETY.missing_s:
            continue
        if course.searching and not course.returning:
            path = _path(_corners(one, plane), state, speed_m_s)
            listening.append(path)
            starts[one.vehicle] = Start(
                east_m=float(path.east_m[-1]),
                north_m=float(path.north_m[-1]),
                after_s=float(path.time_s[-1] - path.time_s[0]),
            )
            owners |= dict.fromkeys(course.held, one.vehicle)
    rounds = tags_by_drone(beliefs, found, starts, owners, speed_m_s=speed_m_s)
    mine = rounds.pop(_OWN)
    # What others are after and is not known here is theirs: they know where it is.
    theirs = {tag_id for tag_id, drone in owners.items() if drone != _OWN} - set(mine)
    theirs |= {tag_id for tags in rounds.values() for tag_id in tags}
    wanted = set(beliefs) - set(found)
    drones = OtherDrones(
        separation=SEPARATION,
        listening=tuple(listening),
        left=frozenset(theirs & wanted) if wanted - theirs else frozenset(),
        strips=paths_of(others, plane),
    )
    return drones, tuple(mine)


def _path(corners: list[_Metres], state: VehicleState, speed_m_s: float) -> Path:
    """Return a drone's predicted path along `corners`, from now on and at `speed_m_s`."""
    east, north = np.array(corners).T
    steps = np.hypot(np.diff(east), np.diff(north))
    yaw = np.degrees(np.arctan2(np.diff(east), np.diff(north)))
    time = state.time_s + np.append(0.0, np.cumsum(steps)) / speed_m_s
    count = len(corners)
    return Path(
        time_s=time,
        east_m=east,
        north_m=north,
        height_m=np.full(count, state.height_m),
        yaw_deg=np.append(yaw, yaw[-1]),
    )


def nearest_m(drones: OtherDrones, places: Sequence[_Metres]) -> float:
    """Return the smallest distance between a path and the other drones' paths [m]."""
    return min(
        float(drones.strip_distance_m(begin, np.array([end[0]]), np.array([end[1]]))[0])
        for begin, end in pairwise(places)
    )
