"""Published planners in their published form: Cliff, TrackerBots."""

import numpy as np
from numpy.typing import NDArray

from uavrt.core.columns import joined_rows
from uavrt.planning.drone_model.drone_motion import Legs
from uavrt.planning.drone_model.planner_actions import FlyTo, Hold, Rotate
from uavrt.planning.planners.ways import CandidatePaths, checked, headings, turning
from uavrt.planning.situation import Candidate, Decision, Situation
from uavrt_experiments.search.baselines.renyi import pulses_along, renyi_nats

_Floats = NDArray[np.float64]


class Renyi:
    """TrackerBots' planner: the most Rényi information at the ends of the next steps.

    An action is a turn and then a step straight on. Of the allowed headings, the four with the
    greatest antenna gain towards the tags are evaluated. For each, measurements at the ends of
    its steps are drawn and their divergences averaged. At least half of a step is flown before
    the next decision; otherwise a drone that turns for longer than a cycle would turn back and
    forth forever.

    `alpha`: order of the divergence.
    `actions`: number of headings.
    `kept`: number of headings with the greatest gain that are evaluated.
    `steps`: number of steps ahead; each is as long as a cycle of flight.
    """

    def __init__(
        self, *, alpha: float = 0.1, actions: int = 12, kept: int = 4, steps: int = 1
    ) -> None:
        self._alpha, self._actions, self._kept = alpha, actions, kept
        self._steps = steps
        self._begun: FlyTo | None = None

    def decide(self, situation: Situation) -> Decision:
        """Choose the turn and step with the most expected Rényi information."""
        if not situation.wanted:
            return Decision(action=Hold(duration_s=situation.cycle_s), reason="all found")
        step = situation.vehicle.speed_m_s * situation.cycle_s
        if self._begun is not None and self._goes_on(situation, self._begun, step):
            return Decision(action=self._begun, reason="on with the step begun")
        ways = checked(situation, *headings(situation, self._actions, step))
        chosen = self._facing(situation, ways)
        if not len(chosen):
            self._begun = None
            best = int(np.argmax(ways.kept))
            return Decision(action=ways.action(best), reason="away: no way is allowed")
        legs = self._ends(situation, ways.east_m[chosen], ways.north_m[chosen])
        reward = renyi_nats(
            situation.wanted, legs, situation.listener, situation.rng, alpha=self._alpha
        ).sum(axis=0)
        best = int(np.argmax(reward))
        candidates = tuple(
            Candidate(action=ways.action(int(n)), duration_s=span, nats_per_s=float(r) / span)
            for n, r, span in zip(chosen, reward, legs.duration_s.tolist(), strict=True)
        )
        self._begun = ways.action(int(chosen[best]))
        return Decision(
            action=self._begun,
            reason=f"most Rényi information: {reward[best]:.2f} of {len(chosen)} ways",
            candidates=candidates,
        )

    def _goes_on(self, situation: Situation, begun: FlyTo, step_m: float) -> bool:
        """True if less than half of a step is flown, and the rest is allowed."""
        state = situation.state
        left = np.hypot(begun.east_m - state.east_m, begun.north_m - state.north_m)
        ahead = checked(situation, np.array([begun.east_m]), np.array([begun.north_m]))
        return bool(left > 0.5 * step_m and ahead.allowed[0])

    def _ends(self, situation: Situation, east_m: _Floats, north_m: _Floats) -> Legs:
        """State of the drone at the end of each step straight on."""
        state, vehicle = situation.state, situation.vehicle
        east = state.east_m + self._steps * (east_m - state.east_m)
        north = state.north_m + self._steps * (north_m - state.north_m)
        last = vehicle.durations(state, east, north, situation.wind)
        last = np.where(np.isfinite(last), last, self._steps * situation.cycle_s)
        before = situation.cycle_s * np.arange(self._steps - 1, -1, -1)
        times = np.maximum(last[:, None] - before, situation.pulse_s)
        return vehicle.along(state, east, north, situation.wind, times)

    def _facing(self, situation: Situation, ways: CandidatePaths) -> NDArray[np.intp]:
        """Allowed paths with the greatest antenna gain towards the tags."""
        allowed = np.flatnonzero(ways.allowed)
        state = situation.state
        gain = np.zeros(len(ways.east_m))
        for belief in situation.wanted:
            pattern = belief.prior.pattern
            if pattern is None:
                return allowed
            place = belief.spread()
            towards = np.degrees(
                np.arctan2(place.east_m - state.east_m, place.north_m - state.north_m)
            )
            course = np.degrees(
                np.arctan2(ways.east_m - state.east_m, ways.north_m - state.north_m)
            )
            gain += pattern.gain_db(towards - course)
        best = allowed[np.argsort(-gain[allowed], kind="stable")]
        return best[: self._kept]


class Shannon:
    """Cliff's planner: the neighbouring grid point with the greatest expected fall of entropy.

    If the drone can hover it turns at each point, as Cliff's did for each bearing.

    `spacing_m`: distance between grid points [m]; None: the distance flown in a cycle.
    `rotation_s`: duration of each turn [s]; 0: single pulses along the path instead.
    """

    def __init__(self, *, spacing_m: float | None = None, rotation_s: float = 0.0) -> None:
        self._spacing_m, self._rotation_s = spacing_m, rotation_s
        self._at_point = True

    def decide(self, situation: Situation) -> Decision:
        """Choose the neighbouring grid point with the greatest expected fall of entropy."""
        if not situation.wanted:
            return Decision(action=Hold(duration_s=situation.cycle_s), reason="all found")
        if self._rotation_s > 0.0 and self._at_point and situation.vehicle.hovers:
            self._at_point = False
            return Decision(action=Rotate(duration_s=self._rotation_s), reason="turn here")
        self._at_point = True
        span = situation.cycle_s
        step = self._spacing_m or situation.vehicle.speed_m_s * span
        ways = checked(situation, *headings(situation, 8, step))
        inside = situation.area.search.contains(ways.east_m, ways.north_m)
        allowed = np.flatnonzero(ways.allowed & inside)
        if not len(allowed):
            allowed = np.flatnonzero(ways.allowed)
        if not len(allowed):
            return Decision(
                action=ways.action(int(np.argmax(ways.kept))), reason="away: no way is allowed"
            )
        reward = self._rewards(situation, ways, allowed, span)
        best = int(np.argmax(reward))
        return Decision(
            action=FlyTo(
                east_m=float(ways.east_m[allowed[best]]),
                north_m=float(ways.north_m[allowed[best]]),
            ),
            reason=f"entropy falls by {reward[best]:.2f} nats, most of {len(allowed)} points",
        )

    def _rewards(
        self, situation: Situation, ways: CandidatePaths, allowed: NDArray[np.intp], span: float
    ) -> _Floats:
        legs = pulses_along(situation, ways.east_m[allowed], ways.north_m[allowed], span)
        if self._rotation_s > 0.0:
            from dataclasses import replace

            turns = [
                turning(
                    replace(
                        situation.state,
                        east_m=float(ways.east_m[n]),
                        north_m=float(ways.north_m[n]),
                    ),
                    360.0,
                    self._rotation_s,
                    max(4, round(self._rotation_s / situation.pulse_s / 2)),
                )
                for n in allowed
            ]

            legs = joined_rows(turns)
        reward = renyi_nats(
            situation.wanted, legs, situation.listener, situation.rng, alpha=1.0
        )
        return np.asarray(reward.sum(axis=0))
