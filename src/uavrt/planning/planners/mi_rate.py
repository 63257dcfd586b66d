"""Default planner, which chooses the path that gives the most information per second on all
tags not yet found.

It rates paths of several lengths in sixteen directions, paths to each tag and past it on both
sides, and a turn in place. Information on a tag counts only up to the amount still needed to
find it, so paths that give more gain nothing.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.columns import chosen_rows, joined_rows
from uavrt.planning.beliefs import TagBelief
from uavrt.planning.drone_model.drone_motion import Legs
from uavrt.planning.drone_model.planner_actions import Action, Hold, Rotate
from uavrt.planning.information import information_nats
from uavrt.planning.planners.ways import (
    CandidatePaths,
    checked,
    headings,
    here,
    sampled,
    tangents,
    turning,
)
from uavrt.planning.situation import Candidate, Decision, Situation

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class _PathRating:
    """Constants by which candidate paths are generated and rated."""

    samples: int = 8
    """Number of points at which a candidate path is sampled; each represents the pulses around
    it."""
    directions: int = 16
    """Number of exploratory paths, in evenly spread directions without regard to tags."""
    horizons_cycles: tuple[float, ...] = (1.0, 3.0)
    """Lengths of exploratory paths, which do not head for a tag [planner cycles]."""
    hypotheses: int = 48
    """Number of position hypotheses of each tag used to rate a candidate path."""
    turn_s: float = 2.0
    """Time assumed for the turn before each path in a round of the remaining tags [s]."""
    stay_s: float = 4.0
    """Time that the drone stays at the end of a path to a tag [s]."""
    finished_share: float = 0.1
    """Share of a tag's needed information; if less is still missing, a round over the tags
    skips this tag."""
    # Value of a path: a power of the share of the needed information that it gives, plus a
    # factor times the share. Finishing one tag then counts for more than beginning two; the
    # second term decides while no tag is nearly found.
    value_power: float = 8.0
    value_linear: float = 0.002
    explore_nats: float = 2.5
    """Missing position information above which all directions are explored, if it is exceeded
    for every tag [nats]."""
    change_gain: float = 0.15
    """Relative gain required to change the target tag while the drone keeps away from animals
    or other drones."""
    turn_nats: float = 1.5
    """Minimum information on an animal that may be near at which a turn in place is worthwhile
    [nats]."""
    near_probability: float = 0.25
    """Probability that an animal is near above which the drone leaves instead of turning in
    place."""
    vague_factor: float = 1.5
    """Minimum ratio of an animal's position spread to the distance to keep at which a turn in
    place helps."""


_RATING = _PathRating()


class MiRate:
    """Planner that maximises the information per second.

    If no path to a tag keeps the distance from animals, paths in all directions are rated. If
    none of these keeps it either, the drone waits, or turns in place to locate the animals.
    Only after that does it fly a path closer to them. `rotation_s` is the duration of a turn in
    place, which is rated if the antenna is directional.
    """

    def __init__(self, *, rotation_s: float = 12.0) -> None:
        self._rotation_s = rotation_s
        self._goal: int | None = None

    def decide(self, situation: Situation) -> Decision:
        """Choose the next action; return it with its reason and the rated candidates."""
        if not situation.wanted:
            return Decision(action=Hold(duration_s=situation.cycle_s), reason="all found")
        exploring = self._explores(situation)
        ways, spans, legs, goals = self._ways(situation, exploring=exploring)
        if not exploring and (not ways.allowed.any() or ways.disturbs.any()):
            # Round an animal, or away from it; past another drone that stays at the tag.
            ways, spans, legs, goals = self._ways(situation, exploring=True)
        return self._best(situation, ways, spans, legs, goals)

    def _best(
        self,
        situation: Situation,
        ways: CandidatePaths,
        spans: _Floats,
        legs: Legs,
        goals: list[int | None],
    ) -> Decision:
        """Choose the best of the allowed paths and the turn in place, which is the last
        candidate if present.
        """
        wanted = situation.wanted
        count = len(ways.east_m)
        turns = len(spans) > count
        allowed = np.append(ways.allowed, self._may_stay(situation)) if turns else ways.allowed
        if not allowed.any():
            return self._least_disturbing(situation, ways)
        rate = np.full(len(spans), np.nan)
        weighed = np.flatnonzero(allowed)
        legs, spans_s = chosen_rows(legs, weighed), spans[weighed]
        nats = self._information(situation, legs)
        gives = _worth(situation, nats, spans_s)
        chance = np.array([one.existence_probability for one in wanted])
        rate[weighed] = chance @ gives / spans_s
        if len(wanted) > 1:
            rate[weighed] = _with_round(situation, legs, chance, gives, spans_s)
        goes_on = np.array([self._goal is not None and one == self._goal for one in goals])
        alone = situation.keep_away is None and situation.others is None
        more = 0.0 if alone else _RATING.change_gain
        kept = rate * np.where(goes_on, 1.0 + more, 1.0)
        best = int(np.argmax(np.where(allowed, kept, -np.inf)))
        self._goal = goals[best]
        of_best = int(np.searchsorted(weighed, best))
        turn = Rotate(duration_s=self._rotation_s)
        actions: list[Action] = [ways.action(n) for n in range(count)]
        actions += [turn] if turns else []
        refused = [*ways.refused, None if allowed[-1] else "an animal is too near to stay here"]
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
        against = "; ".join(sorted({why for why in refused if why is not None}))
        return Decision(
            action=actions[best],
            reason=f"to learn more about tag {wanted[most].tag_id}"
            + (f"; other paths were refused: {against}" if against else ""),
            candidates=candidates,
        )

    def _ways(
        self, situation: Situation, *, exploring: bool
    ) -> tuple[CandidatePaths, _Floats, Legs, list[int | None]]:
        """Return candidate paths, their durations, samples and target tags; a turn in place is
        the last sampled candidate.
        """
        state, vehicle = situation.state, situation.vehicle
        reach = vehicle.speed_m_s * situation.cycle_s
        horizons = _RATING.horizons_cycles if exploring else ()
        ends = [headings(situation, _RATING.directions, reach * n) for n in horizons]
        goals: list[int | None] = [None] * (_RATING.directions * len(horizons))
        for belief in situation.wanted:
            towards = self._towards(situation, belief)
            ends += towards
            goals += [belief.tag_id] * sum(len(east) for east, _ in towards)
        east, north = (np.concatenate([one[axis] for one in ends]) for axis in (0, 1))
        far = np.hypot(east - state.east_m, north - state.north_m)
        useful = far > 0.2 * reach
        if not exploring and not useful.any():
            # At the only tag: on, in whatever direction.
            more = headings(situation, _RATING.directions, reach)
            east, north = np.append(east, more[0]), np.append(north, more[1])
            goals += [None] * len(more[0])
            useful = np.append(useful, np.ones(len(more[0]), bool))
        east, north = east[useful], north[useful]
        ways = checked(situation, east, north)
        spans = vehicle.durations(state, east, north, situation.wind)
        strong = ~np.isfinite(spans)
        for number in np.flatnonzero(strong):
            ways.refused[number] = "the wind on the path is too strong"
        ways.disturbs[strong] = False
        # At a tag it stays for some pulses: the last metres give most.
        fixed = _RATING.directions * len(horizons)
        staying = np.where(np.flatnonzero(useful) >= fixed, _RATING.stay_s, 0.0)
        spans = np.where(strong, 1.0, np.maximum(spans + staying, situation.pulse_s))
        legs = sampled(situation, east, north, spans, _RATING.samples)
        if exploring and self._can_turn(situation):
            legs = joined_rows([legs, turning(state, 360.0, self._rotation_s, _RATING.samples)])
            spans = np.append(spans, self._rotation_s)
        goals = [one for one, fits in zip(goals, useful, strict=True) if fits]
        return ways, spans, legs, goals + [None] * (len(spans) - len(goals))

    def _towards(
        self, situation: Situation, belief: TagBelief
    ) -> list[tuple[_Floats, _Floats]]:
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
        """True while every tag is far from its target accuracy; candidate paths then cover all
        directions.

        Otherwise only paths to the tags are rated. A path past many walking tags would give a
        little information on each again and again, and never find one.
        """
        needed = min(situation.stop.needed_nats(one) for one in situation.wanted)
        return needed > _RATING.explore_nats

    def _may_stay(self, situation: Situation) -> bool:
        return here(situation).refused[0] is None

    def _least_disturbing(self, situation: Situation, ways: CandidatePaths) -> Decision:
        """Action that disturbs animals least when no allowed path keeps the distance."""
        stays = self._wait_or_turn(situation)
        if stays is not None:
            return stays
        inside = ways.allowed | ways.disturbs
        if not inside.any():
            return Decision(
                action=Hold(duration_s=situation.cycle_s), reason="no path is allowed"
            )
        best = int(np.argmax(np.where(inside, ways.kept, -1.0)))
        return Decision(
            action=ways.action(best),
            reason="an animal may be near on every path: this is the safest",
        )

    def _wait_or_turn(self, situation: Situation) -> Decision | None:
        """Return a wait, or a turn that locates an animal which may be near; None if neither
        helps.
        """
        stay = here(situation)
        if stay.refused[0] is None:
            return Decision(
                action=Hold(duration_s=situation.cycle_s),
                reason="every path leads too close to an animal",
            )
        near = 1.0 - float(stay.kept[0])
        if (
            not stay.disturbs[0]
            or near > _RATING.near_probability
            or not self._can_turn(situation)
        ):
            return None
        rule = situation.keep_away
        assert rule is not None
        turn = turning(situation.state, 360.0, self._rotation_s, _RATING.samples)
        clouds = np.array([one.spread().rms_m for one in situation.wanted])
        vague = clouds > _RATING.vague_factor * rule.margin * rule.radius_m
        nats = np.where(vague, self._information(situation, turn)[:, 0], 0.0)
        most = int(np.argmax(nats))
        if nats[most] < _RATING.turn_nats:
            return None
        return Decision(
            action=Rotate(duration_s=self._rotation_s),
            reason=f"to locate tag {situation.wanted[most].tag_id}, which may be near, first",
        )

    def _can_turn(self, situation: Situation) -> bool:
        directional = any(one.prior.pattern is not None for one in situation.wanted)
        return situation.vehicle.hovers and directional and self._rotation_s > 0.0

    def _information(self, situation: Situation, legs: Legs) -> _Floats:
        drones = situation.others
        others = None if drones is None else drones.legs(situation.state.time_s)
        return information_nats(
            situation.wanted,
            legs,
            situation.listener,
            hypotheses=_RATING.hypotheses,
            others=others,
        )


def _worth(situation: Situation, nats: _Floats, spans_s: _Floats) -> _Floats:
    """Share of each tag's needed information that each path gives, shape (tags, paths)."""
    out = np.empty_like(nats)
    for number, belief in enumerate(situation.wanted):
        needed = situation.stop.needed_nats(belief)
        cloud = belief.spread()
        grown = belief.prior.walking_m_per_root_s**2 * belief.prior.motion[1] * spans_s
        # A long thin cloud loses more by the walk than a round one of its size.
        after = (cloud.east_m2 + grown) * (cloud.north_m2 + grown) - cloud.product_m2**2
        lost = 0.5 * np.log(after / max(cloud.determinant_m4, 1.0))
        share = np.clip((nats[number] - lost) / needed, -1.0, 1.0)
        out[number] = (
            np.maximum(share, 0.0) ** _RATING.value_power + _RATING.value_linear * share
        )
    return out


def _with_round(
    situation: Situation,
    legs: Legs,
    chance: _Floats,
    worth: _Floats,
    spans_s: _Floats,
) -> _Floats:
    """Value per second of each path followed by a round to the remaining tags, shape
    (paths,).
    """
    places = [one.spread() for one in situation.wanted]
    tags_x = np.array([one.east_m for one in places])
    tags_y = np.array([one.north_m for one in places])
    rule, speed = situation.keep_away, situation.vehicle.speed_m_s
    nearer = 0.0 if rule is None else rule.margin * rule.radius_m
    left = chance[:, None] * (1.0 - np.clip(worth, 0.0, 1.0))
    seen = left < _RATING.finished_share
    x, y = legs.east_m[:, -1], legs.north_m[:, -1]
    gained, time = chance @ worth, spans_s
    ways = np.arange(len(spans_s))
    for _ in places:
        off = np.hypot(tags_x[:, None] - x, tags_y[:, None] - y)
        off = np.where(seen, np.inf, off)
        near = np.argmin(off, axis=0)
        goes = ~seen[near, ways]
        there = np.maximum(np.where(goes, off[near, ways], 0.0) - nearer, 0.0) / speed
        time = time + np.where(goes, there + _RATING.stay_s + _RATING.turn_s, 0.0)
        gained = gained + np.where(goes, left[near, ways], 0.0)
        x, y = np.where(goes, tags_x[near], x), np.where(goes, tags_y[near], y)
        seen[near, ways] = True
    return np.asarray(gained / time)
