"""ConservationBots' planner: move, or move and turn, for the largest gain on the nearest tag.

Measurements are those of the mean hypothesis without noise (predicted ideal measurements).
"""

import numpy as np
from numpy.typing import NDArray

from uavrt.core.columns import joined_rows
from uavrt.planning.drone_model.drone_motion import Legs, VehicleState
from uavrt.planning.drone_model.planner_actions import Hold, Rotate
from uavrt.planning.planners.ways import checked, headings, turning
from uavrt.planning.situation import Candidate, Decision, Situation
from uavrt_experiments.search.baselines.renyi import pulses_along, renyi_nats

_Floats = NDArray[np.float64]


class ConservationBots:
    """Choose among eight headings; each moves for a whole cycle, or for a third and then turns.

    `cycle_s`: duration of a joint action [s]: 10 s, and 20 s of turning.
    `measurements`: number drawn for each reward.
    """

    def __init__(self, *, cycle_s: float = 30.0, measurements: int = 20) -> None:
        self._cycle_s, self._measurements = cycle_s, measurements
        self._turn_next = False

    def decide(self, situation: Situation) -> Decision:
        """Choose the move, or move and turn, with the largest gain on the nearest tag."""
        if not situation.wanted:
            return Decision(action=Hold(duration_s=situation.cycle_s), reason="all found")
        if self._turn_next:
            self._turn_next = False
            return Decision(
                action=Rotate(duration_s=2.0 * self._cycle_s / 3.0),
                reason="the turn of the joint action",
            )
        state, speed = situation.state, situation.vehicle.speed_m_s
        near = min(
            situation.wanted,
            key=lambda one: np.hypot(
                one.spread().east_m - state.east_m, one.spread().north_m - state.north_m
            ),
        )
        long = headings(situation, 8, speed * self._cycle_s)
        short = headings(situation, 8, speed * self._cycle_s / 3.0)
        ways = checked(
            situation, np.concatenate([long[0], short[0]]), np.concatenate([long[1], short[1]])
        )
        allowed = ways.allowed
        if not allowed.any():
            return Decision(
                action=ways.action(int(np.argmax(ways.kept))), reason="away: no way is allowed"
            )
        legs = self._rollout(situation, ways.east_m, ways.north_m)
        reward = renyi_nats(
            [near],
            legs,
            situation.listener,
            situation.rng,
            measurements=self._measurements,
            hypotheses=200,
        )[0]
        best = int(np.argmax(np.where(allowed, reward, -np.inf)))
        self._turn_next = best >= 8 and situation.vehicle.hovers
        how = "move, then turn" if self._turn_next else "move and listen"
        return Decision(
            action=ways.action(best),
            reason=f"{how}: {reward[best]:.2f} nats of tag {near.tag_id}, the nearest",
            candidates=tuple(
                Candidate(
                    action=ways.action(n),
                    duration_s=self._cycle_s,
                    nats_per_s=float(reward[n]) / self._cycle_s,
                    refused=ways.refused[n],
                )
                for n in range(len(reward))
            ),
        )

    def _rollout(self, situation: Situation, east_m: _Floats, north_m: _Floats) -> Legs:
        """Pulses of each action: along the long paths, and during the turns at the ends of the
        short ones.
        """
        long = pulses_along(situation, east_m[:8], north_m[:8], self._cycle_s)
        samples = long.time_s.shape[1]
        turns = [
            turning(
                VehicleState(
                    time_s=0.0,
                    east_m=float(east_m[n]),
                    north_m=float(north_m[n]),
                    height_m=situation.state.height_m,
                ),
                360.0,
                self._cycle_s,
                samples,
            )
            for n in range(8, 16)
        ]
        return joined_rows([long, *turns])
