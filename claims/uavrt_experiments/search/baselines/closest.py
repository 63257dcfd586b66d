"""Planner that flies to the nearest tag that is not found yet."""

import numpy as np

from uavrt.planning.drone_model.planner_actions import FlyTo, Hold
from uavrt.planning.planners.ways import checked, headings
from uavrt.planning.situation import Decision, Situation


class Closest:
    """Fly to the nearest mean position of the tags not yet found (TrackerBots' simplest
    baseline).
    """

    def decide(self, situation: Situation) -> Decision:
        """Choose the flight to the nearest tag not found yet."""
        state = situation.state
        spreads = {one.tag_id: one.spread() for one in situation.wanted}
        if not spreads:
            return Decision(
                action=Hold(duration_s=situation.cycle_s), reason="every tag is found"
            )
        tag_id, place = min(
            spreads.items(),
            key=lambda one: np.hypot(
                one[1].east_m - state.east_m, one[1].north_m - state.north_m
            ),
        )
        distance = np.hypot(place.east_m - state.east_m, place.north_m - state.north_m)
        reason = f"tag {tag_id} is nearest, {distance:.0f} m away"
        # Over the tag itself every way of a cycle is as good: on in the same direction.
        step = situation.vehicle.speed_m_s * situation.cycle_s
        if distance < 1.0:
            east, north = headings(situation, 1, step, first_deg=state.yaw_deg)
            return Decision(action=FlyTo(east_m=east[0], north_m=north[0]), reason=reason)
        ways = checked(situation, np.array([place.east_m]), np.array([place.north_m]))
        if ways.refused[0] is None:
            return Decision(action=ways.action(0), reason=reason)
        others = checked(situation, *headings(situation, 12, step))
        off = np.hypot(others.east_m - place.east_m, others.north_m - place.north_m)
        best = int(np.argmin(np.where(others.allowed, off, np.inf)))
        if not others.allowed.any():
            best = int(np.argmax(others.kept))
        return Decision(
            action=others.action(best), reason=f"{reason}, round about: {ways.refused[0]}"
        )
