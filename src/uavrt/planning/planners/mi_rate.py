"""Our planner: the path with the most information per second on all tags still wanted.

Ways of several lengths in sixteen directions, to each tag, past it on both sides, and a turn
in place are weighed. What a tag is worth is held at what it still needs until it is found: ways
that give more information on a tag than is wished for gain nothing by it.
"""

import numpy as np
from numpy.typing import NDArray

from uavrt.planning.actions import Action, Hold, Rotate
from uavrt.planning.beliefs import TagBelief
from uavrt.planning.information import information_nats
from uavrt.planning.planners.tangents import tangents
from uavrt.planning.planners.ways import (
    Ways,
    checked,
    headings,
    here,
    sampled,
    some_of,
    stacked,
    turning,
)
from uavrt.planning.situation import Candidate, Decision, Situation, summary
from uavrt.planning.vehicle import Legs

_Floats = NDArray[np.float64]
_SAMPLES = 8
"""Of each way; each stands for the pulses around it."""
_TURN_S = 2.0
"""Before a way of the round, roughly."""
_FINISHED = 0.1
"""Share of what a tag needs below which the round passes it."""
_DIRECTIONS = 16
"""Number of evenly spread directions of paths that lead to no tag."""
_HORIZONS = (1.0, 3.0)
"""Lengths of the paths that lead to no tag [cycles]."""
_HYPOTHESES = 48
"""Number of hypotheses of each tag by which a path is rated."""
_CONVEX, _LINEAR = 8.0, 0.002
"""Value of a path: this power of the share of the needed information that it gives, plus this
factor times the share. Finishing one tag then counts for more than beginning two; the
second term decides while no tag is nearly found."""
_STAY_S = 4.0
"""Time spent at the end of a path to a tag [s]."""
_EXPLORE_NATS = 2.5
"""All directions and a turn are rated while every tag needs more information than this."""
_CONSTANCY = 0.15
"""Share by which another tag must give a higher rate than the present one before the drone
changes to it, while it keeps away from animals or drones; each refused path changes rates."""
_LISTENS_NATS = 1.5
"""Least information on an animal that may be near for which alone a turn is made."""
_NEAR = 0.25
"""Lowest probability of a near animal at which the drone leaves instead of turning."""
_VAGUE = 1.5
"""Factor on the distance to keep: a turn locates only tags whose clouds are wider."""


class MiRate:
    """Most information per second.

    If no path to a tag keeps the distance to animals, all directions are rated. If none of
    these keeps it, the drone waits, or turns to locate the animals, before it flies one that
    does not.

    `rotation_s`: duration of a turn in place, which is rated if the antenna is directional.
    """

    def __init__(self, *, rotation_s: float = 12.0) -> None:
        self._rotation_s = rotation_s
        self._goal: int | None = None

    def decide(self, situation: Situation) -> Decision:
        """See `Planner`."""
        if not situation.wanted:
            return Decision(action=Hold(duration_s=situation.cycle_s), reason="all found")
        exploring = self._explores(situation)
        ways, spans, legs, goals = self._ways(situation, exploring=exploring)
        if not exploring and (
            not ways.allowed.any() or any(map(_by_animals_only, ways.refused))
        ):
            # Round an animal, or away from it; past another drone that stays at the tag.
            ways, spans, legs, goals = self._ways(situation, exploring=True)
        return self._best(situation, ways, spans, legs, goals)

    def _best(
        self,
        situation: Situation,
        ways: Ways,
        spans: _Floats,
        legs: Legs,
        goals: list[int | None],
    ) -> Decision:
        """Choose among the ways that are allowed, and the turn that comes last."""
        wanted = situation.wanted
        count = len(ways.east_m)
        turns = len(spans) > count
        allowed = np.append(ways.allowed, self._may_stay(situation)) if turns else ways.allowed
        if not allowed.any():
            return self._away(situation, ways)
        rate = np.full(len(spans), np.nan)
        weighed = np.flatnonzero(allowed)
        legs, spans_s = some_of(legs, weighed), spans[weighed]
        nats = self._nats(situation, legs)
        gives = _worth(situation, nats, spans_s)
        chance = np.array([one.existence_probability for one in wanted])
        rate[weighed] = chance @ gives / spans_s
        if len(wanted) > 1:
            rate[weighed] = _with_round(situation, legs, chance, gives, spans_s)
        goes_on = np.array([self._goal is not None and one == self._goal for one in goals])
        alone = situation.keep_away is None and situation.others is None
        more = 0.0 if alone else _CONSTANCY
        kept = rate * np.where(goes_on, 1.0 + more, 1.0)
        best = int(np.argmax(np.where(allowed, kept, -np.inf)))
        self._goal = goals[best]
        of_best = int(np.searchsorted(weighed, best))
        turn = Rotate(duration_s=self._rotation_s)
        actions: list[Action] = [ways.action(n) for n in range(count)]
        actions += [turn] if turns else []
        refused = [*ways.refused, None if allowed[-1] else "too near to an animal to stay"]
        candidates = tuple(
            Candidate(
                action=action,
                duration_s=float(span),
                nats_per_s=float(value) if why is None else None,
                refused=why,
            )
            for action, span, value, why in zip(actions, spans, rate, refused, strict=False)
        )
        most = int(np.argmax(chance * gives[:, of_best]))
        return Decision(
            action=actions[best],
            reason=(
                f"{nats[most, of_best]:.1f} nats about tag {wanted[most].tag_id} in "
                f"{spans[best]:.0f} s; in all {rate[best]:.3f}/s; " + summary(candidates)
            ),
            candidates=candidates,
        )

    def _ways(
        self, situation: Situation, *, exploring: bool
    ) -> tuple[Ways, _Floats, Legs, list[int | None]]:
        """Candidates, their times, samples, and tags they go to; a turn in place comes last."""
        state, vehicle = situation.state, situation.vehicle
        reach = vehicle.speed_m_s * situation.cycle_s
        horizons = _HORIZONS if exploring else ()
        ends = [headings(situation, _DIRECTIONS, reach * n) for n in horizons]
        goals: list[int | None] = [None] * (_DIRECTIONS * len(horizons))
        for belief in situation.wanted:
            towards = self._towards(situation, belief)
            ends += towards
            goals += [belief.tag_id] * sum(len(east) for east, _ in towards)
        east, north = (np.concatenate([one[axis] for one in ends]) for axis in (0, 1))
        far = np.hypot(east - state.east_m, north - state.north_m)
        useful = far > 0.2 * reach
        if not exploring and not useful.any():
            # At the only tag: on, in whatever direction.
            more = headings(situation, _DIRECTIONS, reach)
            east, north = np.append(east, more[0]), np.append(north, more[1])
            goals += [None] * len(more[0])
            useful = np.append(useful, np.ones(len(more[0]), bool))
        east, north = east[useful], north[useful]
        ways = checked(situation, east, north)
        spans = vehicle.durations(state, east, north, situation.wind)
        strong = ~np.isfinite(spans)
        for number in np.flatnonzero(strong):
            ways.refused[number] = "against too strong a wind"
        # At a tag it stays for some pulses: the last metres give most.
        fixed = _DIRECTIONS * len(horizons)
        staying = np.where(np.flatnonzero(useful) >= fixed, _STAY_S, 0.0)
        spans = np.where(strong, 1.0, np.maximum(spans + staying, situation.pulse_s))
        legs = sampled(situation, east, north, spans, _SAMPLES)
        if exploring and self._turns(situation):
            legs = stacked(legs, turning(state, 360.0, self._rotation_s, _SAMPLES))
            spans = np.append(spans, self._rotation_s)
        goals = [one for one, fits in zip(goals, useful, strict=True) if fits]
        return ways, spans, legs, goals + [None] * (len(spans) - len(goals))

    def _towards(
        self, situation: Situation, belief: TagBelief
    ) -> list[tuple[_Floats, _Floats]]:
        """Ends of ways to a tag and past it on both sides; round a wide cloud, too."""
        state, rule, place = situation.state, situation.keep_away, belief.spread()
        start, middle = (state.east_m, state.north_m), (place.east_m, place.north_m)
        if rule is None:
            reach = situation.vehicle.speed_m_s * situation.cycle_s
            return [
                tangents(start, middle, 0.3 * reach),
                (np.array([place.east_m]), np.array([place.north_m])),
            ]
        radius = 1.05 * rule.margin * rule.radius_m
        wide = radius + 2.0 * place.major_sigma_m
        return [tangents(start, middle, radius), tangents(start, middle, wide)]

    def _explores(self, situation: Situation) -> bool:
        """Whether no tag is near its end: then ways in all directions are weighed.

        Else ways to the tags alone are: a way past many tags promises a little of each, time
        and again, while they walk and none is ever finished.
        """
        needed = min(situation.stop.needed_nats(one) for one in situation.wanted)
        return needed > _EXPLORE_NATS

    def _may_stay(self, situation: Situation) -> bool:
        return here(situation).refused[0] is None

    def _away(self, situation: Situation, ways: Ways) -> Decision:
        """No way is allowed: the one that disturbs least, if the area allows any."""
        stays = self._stays(situation, len(ways.kept))
        if stays is not None:
            return stays
        inside = np.array([_by_animals(one) for one in ways.refused])
        if not inside.any():
            return Decision(
                action=Hold(duration_s=situation.cycle_s), reason="no way is allowed at all"
            )
        best = int(np.argmax(np.where(inside, ways.kept, -1.0)))
        return Decision(
            action=ways.action(best),
            reason=(
                "an animal may be near on every way; on this one least: probability "
                f"{1.0 - ways.kept[best]:.2f}, {len(ways.kept)} candidates"
            ),
        )

    def _stays(self, situation: Situation, count: int) -> Decision | None:
        """Wait where it may stay; turn where an animal may be near but hardly is.

        Where little is known of an animal every way leads as probably to it as away from it,
        and a turn shows which: later there is no time, it may walk to the drone.
        """
        stay = here(situation)
        if stay.refused[0] is None:
            return Decision(
                action=Hold(duration_s=situation.cycle_s),
                reason=f"none of {count} ways keeps the distance: waiting",
            )
        near = 1.0 - float(stay.kept[0])
        if not _by_animals(stay.refused[0]) or near > _NEAR or not self._turns(situation):
            return None
        rule = situation.keep_away
        assert rule is not None
        turn = turning(situation.state, 360.0, self._rotation_s, _SAMPLES)
        clouds = np.array([one.spread().rms_m for one in situation.wanted])
        vague = clouds > _VAGUE * rule.margin * rule.radius_m
        nats = np.where(vague, self._nats(situation, turn)[:, 0], 0.0)
        most = int(np.argmax(nats))
        if nats[most] < _LISTENS_NATS:
            return None
        return Decision(
            action=Rotate(duration_s=self._rotation_s),
            reason=(
                f"none of {count} ways keeps the distance, an animal may be near with "
                f"{near:.2f}: listening first, {nats[most]:.1f} nats about tag "
                f"{situation.wanted[most].tag_id}"
            ),
        )

    def _turns(self, situation: Situation) -> bool:
        """Whether a turn in place gives information, and can be made."""
        directional = any(one.prior.pattern is not None for one in situation.wanted)
        return situation.vehicle.hovers and directional and self._rotation_s > 0.0

    def _nats(self, situation: Situation, legs: Legs) -> _Floats:
        """(tags, ways) information on each tag that is wanted, beyond what others will hear."""
        drones = situation.others
        others = None if drones is None else drones.legs(situation.state.time_s)
        return information_nats(
            situation.wanted, legs, situation.listener, hypotheses=_HYPOTHESES, others=others
        )


def _worth(situation: Situation, nats: _Floats, spans_s: _Floats) -> _Floats:
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
        out[number] = np.maximum(share, 0.0) ** _CONVEX + _LINEAR * share
    return out


def _with_round(
    situation: Situation,
    legs: Legs,
    chance: _Floats,
    worth: _Floats,
    spans_s: _Floats,
) -> _Floats:
    """(ways,) worth per second over each way and a round of all tags from its end.

    The round goes to the nearest tag each time, past those that the way itself finishes.
    """
    places = [one.spread() for one in situation.wanted]
    tags_x = np.array([one.east_m for one in places])
    tags_y = np.array([one.north_m for one in places])
    rule, speed = situation.keep_away, situation.vehicle.speed_m_s
    nearer = 0.0 if rule is None else rule.margin * rule.radius_m
    left = chance[:, None] * (1.0 - np.clip(worth, 0.0, 1.0))
    seen = left < _FINISHED
    x, y = legs.east_m[:, -1], legs.north_m[:, -1]
    gained, time = chance @ worth, spans_s
    ways = np.arange(len(spans_s))
    for _ in places:
        off = np.hypot(tags_x[:, None] - x, tags_y[:, None] - y)
        off = np.where(seen, np.inf, off)
        near = np.argmin(off, axis=0)
        goes = ~seen[near, ways]
        there = np.maximum(np.where(goes, off[near, ways], 0.0) - nearer, 0.0) / speed
        time = time + np.where(goes, there + _STAY_S + _TURN_S, 0.0)
        gained = gained + np.where(goes, left[near, ways], 0.0)
        x, y = np.where(goes, tags_x[near], x), np.where(goes, tags_y[near], y)
        seen[near, ways] = True
    return np.asarray(gained / time)


def _by_animals(refused: str | None) -> bool:
    """Whether only an animal speaks against a way, if anything does."""
    return refused is None or "animal" in refused


def _by_animals_only(refused: str | None) -> bool:
    """Whether a way is refused, and by an animal."""
    return refused is not None and "animal" in refused
