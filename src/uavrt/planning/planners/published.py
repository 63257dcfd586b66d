"""Planners that were published, as they were published: Cliff, TrackerBots."""

import numpy as np
from numpy.typing import NDArray

from uavrt.planning.actions import FlyTo, Hold, Rotate
from uavrt.planning.information import Listener, renyi_nats
from uavrt.planning.planners.ways import Ways, checked, headings, pulses_along, turning
from uavrt.planning.situation import Candidate, Decision, Situation

_Floats = NDArray[np.float64]


def _listener(situation: Situation) -> Listener:
    return Listener(
        above_tags_m=situation.above_tags_m,
        pulse_s=situation.pulse_s,
        threshold_db=situation.threshold_db,
    )


class Renyi:
    """TrackerBots: the most Rényi information at the end of a cycle.

    Of the headings that it can fly those four are weighed whose antenna gain towards the tags
    is greatest; for each, measurements are drawn and their divergences averaged.

    Parameters
    ----------
    alpha : float
        Order of the divergence.
    actions : int
        Headings.
    kept : int
        Of them, those with the greatest gain.
    cycles : int
        How far ahead it looks.
    """

    def __init__(
        self, *, alpha: float = 0.1, actions: int = 12, kept: int = 4, cycles: int = 1
    ) -> None:
        self._alpha, self._actions, self._kept = alpha, actions, kept
        self._cycles = cycles

    def decide(self, situation: Situation) -> Decision:
        """See `Planner`."""
        if not situation.wanted:
            return Decision(action=Hold(duration_s=situation.cycle_s), reason="all found")
        span = situation.cycle_s * self._cycles
        step = situation.vehicle.speed_m_s * span
        ways = checked(situation, *headings(situation, self._actions, step))
        chosen = self._facing(situation, ways)
        if not len(chosen):
            best = int(np.argmax(ways.kept))
            return Decision(action=ways.action(best), reason="away: no way is allowed")
        legs = pulses_along(situation, ways.east_m[chosen], ways.north_m[chosen], span)
        reward = renyi_nats(
            situation.wanted, legs, _listener(situation), situation.rng, alpha=self._alpha
        ).sum(axis=0)
        best = int(np.argmax(reward))
        candidates = tuple(
            Candidate(action=ways.action(int(n)), duration_s=span, nats_per_s=float(r) / span)
            for n, r in zip(chosen, reward, strict=True)
        )
        return Decision(
            action=ways.action(int(chosen[best])),
            reason=f"most Rényi information: {reward[best]:.2f} of {len(chosen)} ways",
            candidates=candidates,
        )

    def _facing(self, situation: Situation, ways: Ways) -> NDArray[np.intp]:
        """Those allowed ways along which the antenna looks at the tags best."""
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
    """Cliff: the grid point next door with the greatest expected fall of entropy.

    Where the drone can hover it turns at each point, as Cliff's did for each bearing.

    Parameters
    ----------
    spacing_m : float, optional
        Between grid points; None: as far as a cycle flies.
    rotation_s : float
        Of each turn; 0: single pulses on the way instead.
    """

    def __init__(self, *, spacing_m: float | None = None, rotation_s: float = 0.0) -> None:
        self._spacing_m, self._rotation_s = spacing_m, rotation_s
        self._at_point = True

    def decide(self, situation: Situation) -> Decision:
        """See `Planner`."""
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
        self, situation: Situation, ways: Ways, allowed: NDArray[np.intp], span: float
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
            from uavrt.planning.planners.ways import stacked

            legs = stacked(*turns)
        reward = renyi_nats(
            situation.wanted, legs, _listener(situation), situation.rng, alpha=1.0
        )
        return np.asarray(reward.sum(axis=0))
