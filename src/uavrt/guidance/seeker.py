"""Searches for tags: hears, believes, decides, and says why. Pure.

Between what the drone hears and `uavrt.planning`, which thinks, and between that and the steps
that `uavrt.guidance.pilot` flies.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import atan2, cos, degrees, hypot, pi, sin
from typing import Literal

import numpy as np

from uavrt.errors import PlanError
from uavrt.guidance.heights import check_height
from uavrt.guidance.lessons import energy_of
from uavrt.guidance.listening import Antenna, Ears, Evidence
from uavrt.guidance.manners import Manners
from uavrt.guidance.neighbours import MISSING_S, SEPARATION, beside_of, nearest_m
from uavrt.guidance.orders import Limits, Order, Place, VehicleNow
from uavrt.guidance.pilot import standing_place
from uavrt.guidance.plans import (
    Go,
    Home,
    Plan,
    Step,
    area_of,
    check_battery,
    check_ground,
    check_keep_out,
    check_map,
    multirotor_of,
    reserve_wh,
    rotation,
    too_windy,
)
from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.position.trackers import TagPrior, TrackEstimate
from uavrt.messages import (
    FoundTag,
    Neighbour,
    PulsePose,
    SearchNote,
    SearchReport,
    SoughtTag,
    Tag,
)
from uavrt.planning.actions import Action, FlyTo, Hold, Return, Rotate
from uavrt.planning.area import Polygon, SearchArea
from uavrt.planning.beliefs import Beliefs, TagBelief
from uavrt.planning.beside import Beside
from uavrt.planning.energy import Battery
from uavrt.planning.keep_away import KeepAway
from uavrt.planning.planners.mi_rate import MiRate
from uavrt.planning.planners.registry import planner_named
from uavrt.planning.search import Found, Search
from uavrt.planning.situation import Decision, Planner, SearchSettings
from uavrt.planning.stopping import HonestStop
from uavrt.planning.vehicle import VehicleState
from uavrt.tangent_plane import TangentPlane
from uavrt.terrain.hill_losses import HillLosses
from uavrt.units import s_from_ns, wrap_degrees_360

CYCLE_S = 5.0
"""Between two decisions under way."""
SAME_GOAL_M = 10.0
"""A goal that moved by less is the same: it is flown to the end."""
KEPT_AWAY = 0.99
"""Probability, for each way and tag, that the animals are kept away from."""
AWAY_MARGIN = 1.4
"""Of the distance that ways are planned with: a walking animal turns, and each of a thousand
decisions may be the one in a hundred that was wrong."""
APPROACHED = 2.0
"""Times as probable that an animal is near as when a stay began: it is thought over."""
TAG_HEIGHT_M = 0.5
FEW_TAGS = 5
PARTICLES, FEWER_PARTICLES = 10_000, 4_000
"""Of each tag, up to `FEW_TAGS` and beyond."""
TURN_STEP_S = 2.7
"""From one heading to the next, by steps."""
RADIUS50_OF_95 = 0.481
"""Of a circle around a normal distribution: sqrt(ln 2 / ln 20)."""
ROUNDED_M = 0.5
"""What a radius loses or gains on the wire."""
CELLS = 8
"""Along each side of the area, where a tag was not found."""
MOST_CELLS = 6
_CORNERS = 16
_POINTS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


@dataclass(frozen=True, slots=True, kw_only=True)
class Equipment:
    """What the drone searches with."""

    pattern: AntennaPattern | None
    """None: an upright monopole."""
    yaw_offset_deg: float = 0.0
    """Of the boresight, clockwise from the nose."""
    k: int = 0
    """Pulses of a group; 0: as each tag says."""
    planner: str = "mi_rate"
    seed: int = 1
    hills: HillLosses | None = None
    """The ground around home: it weakens pulses, and explains silence. None is level."""
    known: Mapping[int, TagPrior] = field(default_factory=dict)
    """Known strength and motion of some tags, by number; the others have the usual prior."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What came of thinking."""

    steps: tuple[Step, ...] | None
    """To fly from now on; None: on as it is."""
    said: str
    """For the operator, in a line."""
    notes: tuple[SearchNote, ...]
    way: tuple[Place, Place] | None = None
    """Where the steps begin and end; the same where it stays."""
    returning: bool = False
    held: tuple[int, ...] = ()
    """Tags that it is after, where others search, too."""
    found: tuple[FoundTag, ...] = ()


class Seeker:
    """One search.

    `listed`: what the detectors look for.
    `manners`: of the autopilot.
    Raises `PlanError`: it cannot be flown; the text says why and what to do.
    """

    def __init__(
        self,
        order: Order,
        listed: Sequence[Tag],
        now: VehicleNow,
        limits: Limits,
        manners: Manners,
        equipment: Equipment,
    ) -> None:
        self._order, self._limits, self._manners = order, limits, manners
        self._equipment = equipment
        self.tags = _wanted(order, listed)
        self._height_m = now.altitude_relative_m if order.height_m is None else order.height_m
        self._plane = TangentPlane(latitude_deg=now.home[0], longitude_deg=now.home[1])
        self._outline = order.places or _circle(order, now, self._plane)
        check_height(self._height_m, lowest_m=limits.lowest_m, highest_m=limits.highest_m)
        area = area_of(order, self._outline, now, limits)
        check_battery(now, limits, 0.0, self._here_m(now), self._height_m)
        if not (1.0 <= order.wish_m <= 1000.0 and 10.0 <= order.duration_s <= 36_000.0):
            raise PlanError(
                f"a search to {order.wish_m:g} m in {order.duration_s:g} s",
                remedy="Give 1 to 1000 m, and 10 s to 10 hours",
            )
        away = limits.keep_away_m
        self._search = Search(
            SearchSettings(
                vehicle=multirotor_of(limits),
                area=area,
                stop=HonestStop(radius95_m=order.wish_m),
                keep_away=KeepAway(radius_m=away, probability=KEPT_AWAY, margin=AWAY_MARGIN)
                if away > 0.0
                else None,
                energy=energy_of(limits.hover_w),
                worst_wind_m_s=limits.wind_m_s,
                return_height_m=limits.return_height_m,
                cycle_s=CYCLE_S,
                pulse_s=float(np.mean([max(tag.pulse_intervals_s) for tag in self.tags])),
                threshold_db=10.0,
                tag_height_m=TAG_HEIGHT_M,
            ),
            self._beliefs(area.search),
            self._planner(),
            np.random.default_rng((equipment.seed, 1)),
        )
        self.check(now)
        self._ears = Ears(
            *(self.tags, self._plane),
            tag_height_m=TAG_HEIGHT_M,
            k=equipment.k,
            codes=sum(tag.coded for tag in listed),
        )
        self._begun_ns: int | None = None
        self._goal_m: tuple[float, float] | None = None
        self._way_m: tuple[float, float] | None = None
        """Likewise, of the decision before."""
        self._said = "searching"
        self._over = False
        self._latest_s: dict[int, float] = {}
        self._near = 0.0
        """Probability that an animal was too near when the last decision was made."""
        self._held: tuple[int, ...] = ()
        self._before = self._mind

    # ------------------------------------------------------------------ the beginning

    def check(self, now: VehicleNow) -> None:
        """Refuse a search that cannot begin where the drone is; raises `PlanError`."""
        here = ((now.latitude_deg, now.longitude_deg),)
        check_keep_out(self._order, self._limits, self._plane, here)
        check_map(now, self._limits)
        check_ground(here, now, self._limits, self._height_m)
        self._know_energy(now)
        self._search.check(self._state(0.0, now, idle=True), self._battery(now))

    def _know_energy(self, now: VehicleNow) -> None:
        if now.energy is not None:
            self._search.know_energy(now.energy)

    def _beliefs(self, area: Polygon) -> Beliefs:
        few = len(self.tags) <= FEW_TAGS
        hills, box = self._equipment.hills, area.box
        if hills is not None:
            hills = hills.at(float(np.median([tag.frequency_hz for tag in self.tags])))
            hills = hills.in_plane(self._plane)
            hills.cover([box.west_m, box.east_m], [box.south_m, box.north_m])
        pattern, known = self._equipment.pattern, self._equipment.known
        usual = TagPrior(area=box)
        return Beliefs(
            *(
                TagBelief(
                    tag.tag_id,
                    replace(
                        known.get(tag.tag_id, usual), area=box, pattern=pattern, hills=hills
                    ),
                    np.random.default_rng((self._equipment.seed, 2, tag.tag_id)),
                    particles=PARTICLES if few else FEWER_PARTICLES,
                )
                for tag in self.tags
            )
        )

    def _planner(self) -> Planner:
        """The planner of the settings; ours knows how long a turn takes here."""
        if self._equipment.planner != "mi_rate":
            return planner_named(self._equipment.planner)
        turning = self._turn_s
        if self._manners.yaw_in_reposition:
            turning += TURN_STEP_S * self._limits.headings
        return MiRate(rotation_s=turning)

    @property
    def _turn_s(self) -> float:
        """A pulse of each tag at each heading."""
        interval = max(max(tag.pulse_intervals_s) for tag in self.tags)
        return max(12.0, self._limits.headings * interval)

    @property
    def area(self) -> SearchArea:
        """Where it may fly, and where not."""
        return self._search.settings.area

    @property
    def plan(self) -> Plan:
        """How it begins, and what the operator is asked to confirm."""
        order, count = self._order, len(self.tags)
        hectares = self.area.search.area_m2 / 1e4
        tags = f"tag {self.tags[0].tag_id}" if count == 1 else f"{count} tags"
        return Plan(
            steps=(),
            summary=(
                f"search {tags} in {hectares:.1f} ha at {self._height_m:.0f} m to "
                f"{order.wish_m:.0f} m, {order.duration_s / 60.0:.0f} min, then return"
            ),
            duration_s=order.duration_s,
        )

    def begin(self, time_ns: int, now: VehicleNow) -> Choice:
        """Begin; the first step stays where it is, at the height of the search."""
        self._begun_ns = time_ns
        note = self._note("begun", time_ns, now, self.plan.summary, self._equipment.planner)
        stay = Go(place=(now.latitude_deg, now.longitude_deg), height_m=self._height_m)
        return Choice(
            steps=(stay,),
            said=self._said,
            notes=(replace(note, area=self._outline),),
            way=(stay.place, stay.place),
        )

    # ------------------------------------------------------------------ what it hears

    def place(self, time_ns: int, now: VehicleNow) -> None:
        """Take where the drone is."""
        if self._begun_ns is None:
            return
        east, north = self._here_m(now)
        yaw = None
        if now.yaw_deg is not None:
            yaw = wrap_degrees_360(now.yaw_deg + self._equipment.yaw_offset_deg)
        time_s = self._elapsed_s(time_ns)
        self._ears.place(
            Antenna(
                time_s=time_s,
                east_m=east,
                north_m=north,
                height_m=now.altitude_relative_m,
                yaw_deg=yaw,
            )
        )

    def pulse(self, pulse_pose: PulsePose) -> None:
        """Add a pulse."""
        if self._begun_ns is None:
            return
        pulse = pulse_pose.pulse
        time_s = self._elapsed_s((pulse.start_time_ns + pulse.end_time_ns) // 2)
        if time_s < 0.0:
            return
        evidence = self._ears.pulse(pulse_pose, time_s)
        if evidence is not None:
            self._listen(evidence)

    def searched(self, report: SearchReport) -> None:
        """Take what a detector has searched."""
        if self._begun_ns is not None:
            time_s = self._elapsed_s(report.time_ns)
            if time_s >= 0.0:
                self._ears.searched(report, time_s)

    def _listen(self, evidence: Evidence) -> None:
        """Take evidence; beliefs go forwards in time only, but what is late counts, too."""
        tag_id = evidence.tag_id
        self._latest_s[tag_id] = max(self._latest_s.get(tag_id, 0.0), evidence.time_s)
        self._search.listen(tag_id, self._latest_s[tag_id], evidence.listening)

    # ------------------------------------------------------------------ what it decides

    def think(
        self, time_ns: int, now: VehicleNow, *, idle: bool, others: Sequence[Neighbour] = ()
    ) -> Choice:
        """Judge which tags are found, and decide where to fly.

        `idle`: what was decided last is done; else it is still being flown.
        `others`: drones of the same search.
        """
        for evidence in self._ears.missed():
            self._listen(evidence)
        time_s = self._elapsed_s(time_ns)
        new = [*self._found_by(others, time_s), *self._search.judge(time_s)]
        notes = [self._found_note(tag_id, time_ns, now) for tag_id in new]
        if self._over:
            return Choice(steps=None, said=self._said, notes=tuple(notes))
        staying = self._goal_m is None and not idle
        must = bool(notes) or self._search.finished or time_s >= self._order.duration_s
        state = self._state(time_s, now, idle=idle)
        if staying and not must and not self._approached(state):
            return Choice(steps=None, said=self._said, notes=tuple(notes))
        decision = self._decide(state, now, others)
        goal = _goal_of(decision.action)
        goes_on = goal is not None and self._is_goal(goal)
        ends = isinstance(decision.action, Return)
        stays_on = staying and not must and goal is None and not ends
        if not idle and (goes_on or stays_on):
            return Choice(steps=None, said=self._said, notes=tuple(notes))
        self._before = self._mind
        self._near = self._search.near(state)
        self._way_m, self._goal_m = self._goal_m, goal
        self._over = ends
        short = self._words(decision.action, now)
        self._said = (
            f"{len(self._search.found)} of {len(self.tags)} found; {short}: {decision.reason}"
        )
        notes.append(self._note("decision", time_ns, now, short, decision.reason, goal=goal))
        stand = self._stand(now)
        return Choice(
            steps=self._steps(decision.action, now),
            said=self._said,
            notes=tuple(notes),
            way=(stand, stand if goal is None else self._place(*goal)),
            returning=self._over,
            held=self._held,
            found=self._all_found(),
        )

    @property
    def _mind(self) -> "_Mind":
        return (self._near, self._way_m, self._goal_m, self._over, self._said)

    def withdraw(self) -> None:
        """What was decided last is not flown: it goes on as before."""
        self._near, self._way_m, self._goal_m, self._over, self._said = self._before

    def _found_by(self, others: Sequence[Neighbour], time_s: float) -> list[int]:
        """Take tags as found that another drone has found; which are new.

        Only as well as was wished here, within the area, and of one that is heard searching:
        its word may be false or of another search, and ends this one when no tag is left.
        """
        new = []
        for one in others:
            course = one.course
            if course is None or not course.searching or one.age_s > MISSING_S:
                continue
            for told in course.found:
                belief = self._search.beliefs.get(told.tag_id)
                if belief is None or told.tag_id in self._search.found:
                    continue
                east, north = self._plane.to_local(*told.place)
                box, wish = belief.prior.area, self._order.wish_m
                inside = (
                    box.west_m - wish <= east <= box.east_m + wish
                    and box.south_m - wish <= north <= box.north_m + wish
                )
                if not inside or told.radius95_m > wish + ROUNDED_M:
                    continue
                self._search.found[told.tag_id] = Found(
                    time_s=time_s,
                    estimate=TrackEstimate(
                        east_m=float(east),
                        north_m=float(north),
                        radius50_m=RADIUS50_OF_95 * told.radius95_m,
                        radius95_m=told.radius95_m,
                        level_db=belief.estimate().level_db,
                    ),
                    reason=f"vehicle {one.vehicle} found it, 95 % within "
                    f"{told.radius95_m:.0f} m",
                )
                new.append(told.tag_id)
        return new

    def _all_found(self) -> tuple[FoundTag, ...]:
        return tuple(
            FoundTag(
                tag_id=tag_id,
                place=self._place(one.estimate.east_m, one.estimate.north_m),
                radius95_m=one.estimate.radius95_m,
            )
            for tag_id, one in self._search.found.items()
        )

    def end(self, time_ns: int, now: VehicleNow, reason: str) -> SearchNote:
        """Sum up, whoever has ended it."""
        found = len(self._search.found)
        text = f"{found} of {len(self.tags)} found"
        return self._note("ended", time_ns, now, text, reason, likely=True)

    def _approached(self, state: VehicleState) -> bool:
        """Whether an animal has probably come nearer than when it began to stay."""
        near = self._search.near(state)
        return near > 1.0 - KEPT_AWAY and near > APPROACHED * self._near

    def _decide(
        self, state: VehicleState, now: VehicleNow, others: Sequence[Neighbour]
    ) -> Decision:
        beside = None
        if others:
            beside, self._held = beside_of(
                others,
                state,
                self._plane,
                self._search.beliefs,
                self._search.found,
                self._held,
                speed_m_s=self._limits.speed_m_s,
            )
        if state.time_s >= self._order.duration_s and not self._search.finished:
            return Decision(action=Return(), reason="the time is over")
        windy = too_windy(now, self._limits)
        if windy is not None:
            return Decision(action=Return(), reason=windy)
        self._know_energy(now)
        decision = self._search.decide(
            state, wind=now.wind, battery=self._battery(now), beside=beside
        )
        reason = self._entered(decision.action, state, now)
        if reason is None and beside is not None:
            reason = self._meets(decision.action, state, beside)
        if reason is None:
            return decision
        return Decision(action=Hold(duration_s=CYCLE_S), reason=f"{decision.action} {reason}")

    def _meets(self, action: Action, state: VehicleState, beside: Beside) -> str | None:
        """How an action leads too near to another drone's way, whoever has planned it."""
        if not isinstance(action, FlyTo):
            return None
        places = [(state.east_m, state.north_m), (action.east_m, action.north_m)]
        near = nearest_m(beside, places)
        if near >= SEPARATION.distance_m:
            return None
        return f"comes within {near:.0f} m of another drone's way"

    def _entered(self, action: Action, state: VehicleState, now: VehicleNow) -> str | None:
        """How an action leads over people or buildings, whoever has planned it.

        From where the drone is and from where it comes to a stand: it may do either first.
        """
        goal = _goal_of(action)
        if goal is None:
            return None
        here, stand = self._here_m(now), (state.east_m, state.north_m)
        for begins in ([here], [here, stand]):
            reason = self.area.entered(*np.array([*begins, goal]).T)
            if reason is not None:
                return reason
        return None

    def _is_goal(self, goal: tuple[float, float]) -> bool:
        before = self._goal_m
        return (
            before is not None and hypot(goal[0] - before[0], goal[1] - before[1]) < SAME_GOAL_M
        )

    def _steps(self, action: Action, now: VehicleNow) -> tuple[Step, ...]:
        """What the pilot is to fly for an action."""
        height, stand = self._height_m, self._stand(now)
        match action:
            case FlyTo():
                return (Go(place=self._place(action.east_m, action.north_m), height_m=height),)
            case Rotate():
                # By steps, a good part of what the planner counts is the way between them.
                turn = replace(self._order, action="rotate", duration_s=self._turn_s)
                there = replace(now, latitude_deg=stand[0], longitude_deg=stand[1])
                return rotation(turn, there, self._limits, self._manners, height).steps
            case Hold():
                return (Go(place=stand, height_m=height, stay_s=action.duration_s),)
            case Return():
                return (Home(),)

    def _stand(self, now: VehicleNow) -> tuple[float, float]:
        """Where it is, or comes to a stand on the way that it was on."""
        if self._way_m is None:
            return (now.latitude_deg, now.longitude_deg)
        return standing_place(now, self._place(*self._way_m))

    # ------------------------------------------------------------------ places and states

    def _place(self, east_m: float, north_m: float) -> tuple[float, float]:
        latitude, longitude = self._plane.to_geodetic(east_m, north_m)
        return float(latitude), float(longitude)

    def _here_m(self, now: VehicleNow) -> tuple[float, float]:
        east, north = self._plane.to_local(now.latitude_deg, now.longitude_deg)
        return float(east), float(north)

    def _elapsed_s(self, time_ns: int) -> float:
        return 0.0 if self._begun_ns is None else s_from_ns(time_ns - self._begun_ns)

    def _state(self, time_s: float, now: VehicleNow, *, idle: bool) -> VehicleState:
        """Where it can turn to something else: on its way it comes to a stand first."""
        east, north = self._here_m(now)
        if not idle and self._goal_m is not None:
            stand = standing_place(now, self._place(*self._goal_m))
            local = self._plane.to_local(*stand)
            east, north = float(local[0]), float(local[1])
        return VehicleState(
            time_s=time_s,
            east_m=east,
            north_m=north,
            height_m=self._height_m,
            yaw_deg=now.yaw_deg or 0.0,
        )

    def _battery(self, now: VehicleNow) -> Battery | None:
        size, percent = self._limits.battery_wh, now.battery_percent
        if size is None or percent is None:
            return None
        return Battery(remaining_wh=size * percent / 100.0, reserve_wh=reserve_wh(self._limits))

    # ------------------------------------------------------------------ words and notes

    def _words(self, action: Action, now: VehicleNow) -> str:
        if not isinstance(action, FlyTo):
            return str(action)
        here = self._here_m(now)
        east, north = action.east_m - here[0], action.north_m - here[1]
        point = _POINTS[round(degrees(atan2(east, north)) / 45.0) % 8]
        return f"fly {hypot(east, north):.0f} m {point}"

    def _found_note(self, tag_id: int, time_ns: int, now: VehicleNow) -> SearchNote:
        text = f"tag {tag_id} found"
        reason = self._search.found[tag_id].reason
        return replace(self._note("found", time_ns, now, text, reason), tag_id=tag_id)

    def _note(
        self,
        event: Literal["begun", "decision", "found", "ended"],
        time_ns: int,
        now: VehicleNow,
        text: str,
        reason: str,
        *,
        goal: tuple[float, float] | None = None,
        likely: bool = False,
    ) -> SearchNote:
        return SearchNote(
            time_ns=time_ns,
            order_id=self._order.order_id,
            event=event,
            text=text,
            reason=reason,
            elapsed_s=self._elapsed_s(time_ns),
            latitude_deg=now.latitude_deg,
            longitude_deg=now.longitude_deg,
            height_m=now.altitude_relative_m,
            battery_percent=now.battery_percent,
            tags=tuple(self._sought(tag.tag_id, likely=likely) for tag in self.tags),
            goal=None if goal is None else self._place(*goal),
        )

    def _sought(self, tag_id: int, *, likely: bool) -> SoughtTag:
        belief = self._search.beliefs[tag_id]
        found = self._search.found.get(tag_id)
        estimate = belief.estimate() if found is None else found.estimate
        latitude, longitude = self._place(estimate.east_m, estimate.north_m)
        pulses, missed = self._ears.counts(tag_id)
        return SoughtTag(
            tag_id=tag_id,
            latitude_deg=latitude,
            longitude_deg=longitude,
            radius95_m=estimate.radius95_m,
            existence=belief.existence_probability,
            found_s=None if found is None else found.time_s,
            pulses=pulses,
            missed=missed,
            likely=self._likely(belief) if likely and found is None else (),
        )

    def _likely(self, belief: TagBelief) -> tuple[tuple[float, float, float], ...]:
        """Squares of the area where a tag most probably is, if it is there."""
        box = belief.prior.area
        some = belief.hypotheses(4000)
        share, east, north = np.histogram2d(
            some.east_m,
            some.north_m,
            bins=CELLS,
            range=((box.west_m, box.east_m), (box.south_m, box.north_m)),
        )
        share /= len(some.east_m)
        best = np.argsort(share, axis=None)[::-1][:MOST_CELLS]
        squares = []
        for column, row in zip(*np.unravel_index(best, share.shape), strict=True):
            middle = (
                0.5 * (east[column] + east[column + 1]),
                0.5 * (north[row] + north[row + 1]),
            )
            if share[column, row] > 0.0:
                squares.append((*self._place(*middle), float(share[column, row])))
        return tuple(squares)


_Goal = tuple[float, float] | None
_Mind = tuple[float, _Goal, _Goal, bool, str]
"""What is undone by `Seeker.withdraw`."""


def _wanted(order: Order, listed: Sequence[Tag]) -> tuple[Tag, ...]:
    """The tags to search for."""
    if not listed:
        raise PlanError(
            "no tag is being listened for", remedy="Send the tags and start detection first"
        )
    known = {tag.tag_id: tag for tag in listed}
    unknown = sorted(set(order.tags) - set(known))
    if unknown:
        raise PlanError(
            f"tag {unknown[0]} is not being listened for",
            remedy=f"Choose from {', '.join(map(str, known))}",
        )
    return tuple(known[tag_id] for tag_id in (order.tags or known))


def _circle(order: Order, now: VehicleNow, plane: TangentPlane) -> tuple[Place, ...]:
    """Outline around the drone."""
    radius = order.radius_m
    if radius is None or not 10.0 <= radius <= 10_000.0:
        raise PlanError(
            "the search has no area", remedy="Give an outline, or a radius of 10 m or more"
        )
    east, north = plane.to_local(now.latitude_deg, now.longitude_deg)
    angles = [2.0 * pi * n / _CORNERS for n in range(_CORNERS)]
    latitude, longitude = plane.to_geodetic(
        [float(east) + radius * sin(a) for a in angles],
        [float(north) + radius * cos(a) for a in angles],
    )
    return tuple((float(a), float(b)) for a, b in zip(latitude, longitude, strict=True))


def _goal_of(action: Action) -> tuple[float, float] | None:
    """Where an action flies to, east and north; None where it stays."""
    return (action.east_m, action.north_m) if isinstance(action, FlyTo) else None
