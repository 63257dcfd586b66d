"""Decide where a search flies, within its order, the wind and other drones' paths; no I/O."""

from collections.abc import Sequence
from math import atan2, degrees, hypot

import numpy as np

from uavrt.core.messages import FoundTag, Neighbour
from uavrt.guidance.operator_orders import VehicleNow
from uavrt.guidance.plans import too_windy
from uavrt.guidance.safety import SAFETY
from uavrt.guidance.search.neighbour_drones import SEPARATION, nearest_m, other_drones_of
from uavrt.guidance.search.search_task import SearchTask
from uavrt.guidance.search_rules import SEARCH_RULES
from uavrt.localization.position.trackers import TrackEstimate
from uavrt.planning.drone_model.drone_motion import VehicleState
from uavrt.planning.drone_model.other_drones import OtherDrones
from uavrt.planning.drone_model.planner_actions import Action, FlyTo, Hold, Return
from uavrt.planning.search import Found, Search
from uavrt.planning.situation import Decision

RADIUS50_OF_95 = 0.481
"""Ratio of 50 % radius to 95 % radius of a circular normal distribution: sqrt(ln 2 / ln 20)."""
ROUNDED_M = 0.5
"""Rounding error of the radius with which another drone reports a found tag [m]."""
_POINTS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


class SearchDecisions:
    """Makes the decisions of one search. `held` are the tags that this drone searches for."""

    def __init__(self, task: SearchTask, search: Search) -> None:
        self._task, self._search = task, search
        self.held: tuple[int, ...] = ()

    def judge(self, time_s: float, others: Sequence[Neighbour]) -> list[int]:
        """Mark tags that this or another drone has found; return the newly found ones.

        A false report could end this search. So another drone's result counts only if it meets
        the accuracy of this search, is within the area, and that drone is still searching.
        """
        new = []
        for one in others:
            course = one.course
            if course is None or not course.searching or one.age_s > SAFETY.missing_s:
                continue
            for tag in course.found:
                found = self._found_by(one.vehicle, tag, time_s)
                if found is not None:
                    self._search.found[tag.tag_id] = found
                    new.append(tag.tag_id)
        return [*new, *self._search.judge(time_s)]

    def _found_by(self, vehicle: int, tag: FoundTag, time_s: float) -> Found | None:
        belief = self._search.beliefs.get(tag.tag_id)
        if belief is None or tag.tag_id in self._search.found:
            return None
        east, north = self._task.local_m(*tag.place)
        box, accuracy_m = belief.prior.area, self._task.order.accuracy_m
        inside = (
            box.west_m - accuracy_m <= east <= box.east_m + accuracy_m
            and box.south_m - accuracy_m <= north <= box.north_m + accuracy_m
        )
        if not inside or tag.radius95_m > accuracy_m + ROUNDED_M:
            return None
        return Found(
            time_s=time_s,
            estimate=TrackEstimate(
                east_m=east,
                north_m=north,
                radius50_m=RADIUS50_OF_95 * tag.radius95_m,
                radius95_m=tag.radius95_m,
                level_db=belief.estimate().level_db,
            ),
            reason=f"vehicle {vehicle} found it, 95 % within {tag.radius95_m:.0f} m",
        )

    def decide(
        self, state: VehicleState, now: VehicleNow, others: Sequence[Neighbour]
    ) -> Decision:
        """Next action; it is a hover if its path would meet an excluded area
        or another drone.
        """
        task, search = self._task, self._search
        drones = None
        if others:
            drones, self.held = other_drones_of(
                others,
                state,
                task.plane,
                search.beliefs,
                search.found,
                self.held,
                speed_m_s=task.limits.speed_m_s,
            )
        if state.time_s >= task.order.duration_s and not search.finished:
            return Decision(action=Return(), reason="the search time is over")
        windy = too_windy(now, task.limits)
        if windy is not None:
            return Decision(action=Return(), reason=windy)
        if now.energy is not None:
            search.set_energy(now.energy)
        decision = search.decide(state, wind=now.wind, battery=task.battery(now), others=drones)
        reason = self._entered(decision.action, state, now)
        if reason is None and drones is not None:
            reason = _meets(decision.action, state, drones)
        if reason is None:
            return decision
        return Decision(
            action=Hold(duration_s=SEARCH_RULES.cycle_s), reason=f"holding: {reason}"
        )

    def _entered(self, action: Action, state: VehicleState, now: VehicleNow) -> str | None:
        """Return a text on an excluded area that an action's path crosses; else None.

        The path may begin at the present position or at the point where the drone stops.
        """
        goal = goal_of(action)
        if goal is None:
            return None
        here, stand = self._task.here_m(now), (state.east_m, state.north_m)
        for begins in ([here], [here, stand]):
            reason = self._search.settings.area.entered_area(*np.array([*begins, goal]).T)
            if reason is not None:
                return reason
        return None

    def text(self, action: Action, now: VehicleNow) -> str:
        """Return an action as text for the operator: ``fly 40 m NW``."""
        goal = goal_of(action)
        if goal is None:
            return str(action)
        here = self._task.here_m(now)
        east, north = goal[0] - here[0], goal[1] - here[1]
        point = _POINTS[round(degrees(atan2(east, north)) / 45.0) % 8]
        return f"fly {hypot(east, north):.0f} m {point}"


def _meets(action: Action, state: VehicleState, drones: OtherDrones) -> str | None:
    """Return a text if an action's path is too close to another drone's path; else None."""
    goal = goal_of(action)
    if goal is None:
        return None
    near = nearest_m(drones, [(state.east_m, state.north_m), goal])
    if near >= SEPARATION.distance_m:
        return None
    return f"the path comes within {near:.0f} m of another drone's path"


def goal_of(action: Action) -> tuple[float, float] | None:
    """Return where an action flies to, as (east, north) [m]; None if it does not fly."""
    return (action.east_m, action.north_m) if isinstance(action, FlyTo) else None
