"""LAVAPilot's planner: straight to the best-known tag, or past the circles around animals."""

import numpy as np

from uavrt.planning.drone_model.planner_actions import Hold
from uavrt.planning.planners.ways import checked, headings, tangents
from uavrt.planning.situation import Candidate, Decision, Situation


class LavaPilot:
    """Fly to the tag with the smallest cloud first, on the path of three that disturbs least.

    `circle_m`: radius around the target if no distance to keep is given [m].
    """

    def __init__(self, circle_m: float = 0.0) -> None:
        self._circle_m = circle_m

    def decide(self, situation: Situation) -> Decision:
        """Choose the path towards the best-known tag that disturbs animals least."""
        spreads = {one.tag_id: one.spread() for one in situation.wanted}
        if not spreads:
            return Decision(action=Hold(duration_s=situation.cycle_s), reason="all found")
        tag_id, place = min(spreads.items(), key=lambda one: one[1].major_sigma_m)
        rule = situation.keep_away
        radius = self._circle_m if rule is None else rule.radius_m
        state = situation.state
        here = (state.east_m, state.north_m)
        ways = checked(situation, *tangents(here, (place.east_m, place.north_m), radius))
        reason = f"tag {tag_id} has the smallest cloud, {place.major_sigma_m:.0f} m"
        best = int(np.argmax(np.where(ways.allowed, ways.kept, -1.0)))
        if ways.refused[best] is None:
            return Decision(
                action=ways.action(best),
                reason=f"{reason}; kept away with {ways.kept[best]:.2f}",
                candidates=tuple(
                    Candidate(action=ways.action(n), duration_s=0.0, refused=why)
                    for n, why in enumerate(ways.refused)
                ),
            )
        step = situation.vehicle.speed_m_s * situation.cycle_s
        others = checked(situation, *headings(situation, 12, step))
        if others.allowed.any():
            off = np.hypot(others.east_m - place.east_m, others.north_m - place.north_m)
            best = int(np.argmin(np.where(others.allowed, off, np.inf)))
            return Decision(action=others.action(best), reason=f"{reason}; a way round it")
        best = int(np.argmax(others.kept))
        return Decision(action=others.action(best), reason=f"{reason}; away from the animals")
