"""Ours: the way with the most information per second on all tags that are still wanted.

Ways of several lengths in sixteen directions, to each tag, past it on both sides, and a turn
in place are weighed. What a tag is worth is held at what it still needs until it is found: ways
that tell more of a tag than is wished for gain nothing by it.
"""

import numpy as np
from numpy.typing import NDArray

from uavrt.planning.actions import Action, Hold, Rotate
from uavrt.planning.information import Listener, information_nats
from uavrt.planning.planners.tangents import tangents
from uavrt.planning.planners.ways import Ways, checked, headings, sampled, stacked, turning
from uavrt.planning.situation import Candidate, Decision, Situation, summary
from uavrt.planning.vehicle import Legs

_Floats = NDArray[np.float64]
_SAMPLES = 8
_TURN_S = 2.0
"""Of each way; each stands for the pulses around it."""


class MiRate:
    """Most information per second.

    Parameters
    ----------
    directions : int
        Evenly spread.
    horizons : tuple of float
        Lengths of ways, in cycles.
    hypotheses : int
        Of each tag.
    convex : float
        Power of the share of what a tag needs: above 1, to finish one counts for more than to
        begin two.
    linear : float
        Weight of the share itself beside its power: leads where nothing is near its end.
    stay_s : float
        At the end of ways to a tag.
    looks_on : bool
        Count the tag that is best gone on to from each way's end.
    explore_nats : float
        All directions and a turn are weighed as long as every tag needs more than this.
    rotation_s : float
        Of a turn in place, which is weighed where the antenna is directional.
    """

    def __init__(
        self,
        *,
        directions: int = 16,
        horizons: tuple[float, ...] = (1.0, 3.0),
        hypotheses: int = 48,
        convex: float = 8.0,
        linear: float = 0.002,
        stay_s: float = 4.0,
        rotation_s: float = 12.0,
        looks_on: bool = True,
        explore_nats: float = 2.5,
    ) -> None:
        self._directions, self._horizons = directions, horizons
        self._hypotheses, self._convex, self._linear = hypotheses, convex, linear
        self._stay_s, self._looks_on = stay_s, looks_on
        self._explore_nats = explore_nats
        self._rotation_s = rotation_s

    def decide(self, situation: Situation) -> Decision:
        """See `Planner`."""
        wanted = situation.wanted
        if not wanted:
            return Decision(action=Hold(duration_s=situation.cycle_s), reason="all found")
        ways, spans, legs = self._ways(situation)
        listener = Listener(
            above_tags_m=situation.above_tags_m,
            pulse_s=situation.pulse_s,
            threshold_db=situation.threshold_db,
        )
        nats = information_nats(wanted, legs, listener, hypotheses=self._hypotheses)
        worth = self._worth(situation, nats, spans)
        chance = np.array([one.existence_probability for one in wanted])
        rate = chance @ worth / spans
        if self._looks_on and len(wanted) > 1:
            rate = np.maximum(rate, self._with_next(situation, legs, chance, worth, spans))
        count = len(ways.east_m)
        turns = len(spans) > count
        allowed = np.append(ways.allowed, True) if turns else ways.allowed
        if turns and not self._may_stay(situation):
            allowed[-1] = False
        if not allowed.any():
            return self._away(situation, ways)
        best = int(np.argmax(np.where(allowed, rate, -np.inf)))
        turn = Rotate(duration_s=self._rotation_s)
        actions: list[Action] = [ways.action(n) for n in range(count)]
        actions += [turn] if turns else []
        refused = [*ways.refused, None if allowed[-1] else "too near to an animal to stay"]
        candidates = tuple(
            Candidate(
                action=action, duration_s=float(span), nats_per_s=float(value), refused=why
            )
            for action, span, value, why in zip(actions, spans, rate, refused, strict=False)
        )
        most = int(np.argmax(chance * worth[:, best]))
        return Decision(
            action=actions[best],
            reason=(
                f"{rate[best]:.3f} nats/s over {spans[best]:.0f} s, most of it "
                f"({worth[most, best]:.1f} nats) of tag {wanted[most].tag_id}; "
                + summary(candidates)
            ),
            candidates=candidates,
        )

    def _worth(self, situation: Situation, nats: _Floats, spans_s: _Floats) -> _Floats:
        """(tags, ways) share of what each tag still needs that each way gives."""
        out = np.empty_like(nats)
        for number, belief in enumerate(situation.wanted):
            needed = situation.stop.needed_nats(belief)
            cloud = belief.spread()
            grown = belief.prior.walking_m_per_root_s**2 * belief.prior.motion[1] * spans_s
            # A long thin cloud loses more by the walk than a round one of its size.
            after = (cloud.east_m2 + grown) * (cloud.north_m2 + grown) - cloud.product_m2**2
            lost = 0.5 * np.log(after / max(cloud.determinant_m4, 1.0))
            share = np.clip((nats[number] - lost) / needed, -1.0, 1.0)
            out[number] = np.maximum(share, 0.0) ** self._convex + self._linear * share
        return out

    def _with_next(
        self,
        situation: Situation,
        legs: Legs,
        chance: _Floats,
        worth: _Floats,
        spans_s: _Floats,
    ) -> _Floats:
        """(ways,) the same with the best tag to go on to from each way's end."""
        places = [one.spread() for one in situation.wanted]
        east, north = legs.east_m[:, -1], legs.north_m[:, -1]
        best = np.zeros(len(spans_s))
        gained = chance @ worth
        rule = situation.keep_away
        nearer = 0.0 if rule is None else rule.margin * rule.radius_m
        for number, place in enumerate(places):
            off = np.hypot(place.east_m - east, place.north_m - north)
            speed = situation.vehicle.speed_m_s
            more = np.maximum(off - nearer, 0.0) / speed + self._stay_s + _TURN_S
            left = chance[number] * (1.0 - np.clip(worth[number], 0.0, 1.0))
            best = np.maximum(best, (gained + left) / (spans_s + more))
        return best

    def _ways(self, situation: Situation) -> tuple[Ways, _Floats, Legs]:
        """Candidates, their times and their samples; a turn in place comes last."""
        state, vehicle = situation.state, situation.vehicle
        here = (state.east_m, state.north_m)
        reach = vehicle.speed_m_s * situation.cycle_s
        exploring = self._explores(situation)
        horizons = self._horizons if exploring else ()
        ends = [headings(situation, self._directions, reach * n) for n in horizons]
        rule = situation.keep_away
        radius = 0.3 * reach if rule is None else 1.05 * rule.margin * rule.radius_m
        for belief in situation.wanted:
            place = belief.spread()
            ends.append(tangents(here, (place.east_m, place.north_m), radius))
            if rule is None:
                ends.append((np.array([place.east_m]), np.array([place.north_m])))
        east, north = (np.concatenate([one[axis] for one in ends]) for axis in (0, 1))
        far = np.hypot(east - state.east_m, north - state.north_m)
        useful = far > 0.2 * reach
        if not exploring and not useful.any():
            # At the only tag: on, in whatever direction.
            more = headings(situation, self._directions, reach)
            east, north = np.append(east, more[0]), np.append(north, more[1])
            useful = np.append(useful, np.ones(len(more[0]), bool))
        east, north = east[useful], north[useful]
        ways = checked(situation, east, north)
        spans = vehicle.durations(state, east, north, situation.wind)
        strong = ~np.isfinite(spans)
        for number in np.flatnonzero(strong):
            ways.refused[number] = "against too strong a wind"
        # At a tag it stays for some pulses: the last metres tell most.
        fixed = self._directions * len(horizons)
        staying = np.where(np.flatnonzero(useful) >= fixed, self._stay_s, 0.0)
        spans = np.where(strong, 1.0, np.maximum(spans + staying, situation.pulse_s))
        legs = sampled(situation, east, north, spans, _SAMPLES)
        directional = any(one.prior.pattern is not None for one in situation.wanted)
        if exploring and vehicle.hovers and directional and self._rotation_s > 0.0:
            legs = stacked(legs, turning(state, 360.0, self._rotation_s, _SAMPLES))
            spans = np.append(spans, self._rotation_s)
        return ways, spans, legs

    def _explores(self, situation: Situation) -> bool:
        """Whether no tag is near its end: then ways in all directions are weighed.

        Else ways to the tags alone are: a way past many tags promises a little of each, time
        and again, while they walk and none is ever finished.
        """
        needed = min(situation.stop.needed_nats(one) for one in situation.wanted)
        return needed > self._explore_nats

    def _may_stay(self, situation: Situation) -> bool:
        state = situation.state
        here = checked(situation, np.array([state.east_m]), np.array([state.north_m]))
        return here.refused[0] is None

    def _away(self, situation: Situation, ways: Ways) -> Decision:
        """No way is allowed: the one that disturbs least, if the area allows any."""
        inside = np.array([one is None or "animal" in one for one in ways.refused])
        if not inside.any():
            return Decision(
                action=Hold(duration_s=situation.cycle_s), reason="no way is allowed at all"
            )
        best = int(np.argmax(np.where(inside, ways.kept, -1.0)))
        return Decision(
            action=ways.action(best),
            reason=(
                "no way keeps the distance; this one does with "
                f"{ways.kept[best]:.2f}, most of {len(ways.kept)} candidates"
            ),
        )
