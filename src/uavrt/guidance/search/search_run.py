"""Search for tags: evaluate pulses, update position estimates, decide where to fly; no I/O."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot

from uavrt.core.messages import FoundTag, Neighbour, PulsePose, SearchNote, SearchReport, Tag
from uavrt.core.units import s_from_ns, wrap_degrees_360
from uavrt.guidance.autopilot_behaviour import Behaviour
from uavrt.guidance.operator_orders import Limits, Order, Place, VehicleNow
from uavrt.guidance.order_execution import stopping_place
from uavrt.guidance.plans import (
    Go,
    Home,
    Plan,
    Step,
    check_ground,
    check_keep_out,
    check_map,
    rotation,
)
from uavrt.guidance.search.pulse_evidence import Antenna, Evidence, PulseEvidence
from uavrt.guidance.search.search_decisions import SearchDecisions, goal_of
from uavrt.guidance.search.search_notes import SearchNotes
from uavrt.guidance.search.search_task import Equipment, SearchTask
from uavrt.guidance.search_rules import SEARCH_RULES
from uavrt.planning.area import SearchArea
from uavrt.planning.drone_model.drone_motion import VehicleState
from uavrt.planning.drone_model.planner_actions import Action, FlyTo, Hold, Return, Rotate


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """Result of a search decision: steps to fly, log entries, and a text for the operator."""

    steps: tuple[Step, ...] | None
    """Steps to fly from now on; None to continue the present ones."""
    status_text: str
    """The decision and its reason as one line for the operator."""
    notes: tuple[SearchNote, ...]
    leg: tuple[Place, Place] | None = None
    """Start and end of the path to fly, equal for a hover; None if the path does not change."""
    returning: bool = False
    held: tuple[int, ...] = ()
    """Tags that this drone searches for, if several drones share the search."""
    found: tuple[FoundTag, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Course:
    """Where the last search decision sends the drone, and the reason."""

    goal_m: tuple[float, float] | None = None
    """Position to fly to, as (east, north) [m]; None if the drone hovers."""
    near: float = 0.0
    """Probability, at the decision, that an animal was nearer than its protected distance."""
    over: bool = False
    status_text: str = "searching"


class SearchRun:
    """Runs one search for tags. Raises `PlanError` if the search cannot be flown."""

    def __init__(
        self,
        order: Order,
        listed: Sequence[Tag],
        now: VehicleNow,
        limits: Limits,
        behaviour: Behaviour,
        equipment: Equipment,
    ) -> None:
        self._task = task = SearchTask(order, listed, now, limits, behaviour, equipment)
        self._search = task.search(now)
        self.check(now)
        self._evidence = PulseEvidence(
            *(task.tags, task.plane),
            tag_height_m=SEARCH_RULES.tag_height_m,
            k=equipment.k,
            codes=sum(tag.coded for tag in listed),
        )
        self._notes = SearchNotes(task, self._search, self._evidence)
        self._decisions = SearchDecisions(task, self._search)
        self._begun_ns: int | None = None
        self._latest_s: dict[int, float] = {}
        self._course = self._course_before = _Course()

    def check(self, now: VehicleNow) -> None:
        """Raise `PlanError` if the search cannot begin at the drone's present position."""
        task, here = self._task, ((now.latitude_deg, now.longitude_deg),)
        check_keep_out(task.order, task.limits, task.plane, here)
        check_map(now, task.limits)
        check_ground(here, now, task.limits, task.height_m)
        if now.energy is not None:
            self._search.set_energy(now.energy)
        self._search.check(self._state(0.0, now, idle=True), task.battery(now))

    @property
    def area(self) -> SearchArea:
        """The area to search, with its excluded parts and flight limits."""
        return self._search.settings.area

    @property
    def plan(self) -> Plan:
        """Description of the search that the operator confirms; it has no steps yet."""
        order, tags = self._task.order, self._task.tags
        hectares = self.area.search.area_m2 / 1e4
        sought = f"tag {tags[0].tag_id}" if len(tags) == 1 else f"{len(tags)} tags"
        return Plan(
            steps=(),
            summary=(
                f"search {sought} in {hectares:.1f} ha at {self._task.height_m:.0f} m to "
                f"{order.accuracy_m:.0f} m, {order.duration_s / 60.0:.0f} min, then return"
            ),
            duration_s=order.duration_s,
        )

    def begin(self, time_ns: int, now: VehicleNow) -> Choice:
        """Start the search with a hover here, at the height of the search."""
        self._begun_ns, task = time_ns, self._task
        planner = task.equipment.planner
        note = self._notes.note("begun", time_ns, 0.0, now, self.plan.summary, planner)
        stay = Go(place=(now.latitude_deg, now.longitude_deg), height_m=task.height_m)
        return Choice(
            steps=(stay,),
            status_text=self._course.status_text,
            notes=(replace(note, area=task.outline),),
            leg=(stay.place, stay.place),
        )

    def place(self, time_ns: int, now: VehicleNow) -> None:
        """Store the antenna's present pose; pulses missed at this time are evaluated with it.

        Ignored before the search begins.
        """
        if self._begun_ns is None:
            return
        east, north = self._task.here_m(now)
        yaw = None
        if now.yaw_deg is not None:
            yaw = wrap_degrees_360(now.yaw_deg + self._task.equipment.yaw_offset_deg)
        self._evidence.place(
            Antenna(
                time_s=self._elapsed_s(time_ns),
                east_m=east,
                north_m=north,
                height_m=now.altitude_relative_m,
                yaw_deg=yaw,
            )
        )

    def pulse(self, pulse_pose: PulsePose) -> None:
        """Update a tag's position estimate with a received pulse."""
        pulse = pulse_pose.pulse
        time_s = self._elapsed_s((pulse.start_time_ns + pulse.end_time_ns) // 2)
        if self._begun_ns is not None and time_s >= 0.0:
            evidence = self._evidence.pulse(pulse_pose, time_s)
            if evidence is not None:
                self._listen(evidence)

    def searched(self, report: SearchReport) -> None:
        """Note a detector's report of a search without detection, for missed pulses."""
        time_s = self._elapsed_s(report.time_ns)
        if self._begun_ns is not None and time_s >= 0.0:
            self._evidence.searched(report, time_s)

    def _listen(self, evidence: Evidence) -> None:
        """Update a tag's position estimate with a received or missed pulse."""
        tag_id = evidence.tag_id
        self._latest_s[tag_id] = max(self._latest_s.get(tag_id, 0.0), evidence.time_s)
        self._search.listen(tag_id, self._latest_s[tag_id], evidence.listening)

    def decide(
        self, time_ns: int, now: VehicleNow, *, idle: bool, others: Sequence[Neighbour] = ()
    ) -> Choice:
        """Mark found tags, and decide where to fly.

        `idle` is True if the last decision was flown to its end.
        """
        for evidence in self._evidence.missed():
            self._listen(evidence)
        time_s, search, course = self._elapsed_s(time_ns), self._search, self._course
        new = self._decisions.judge(time_s, others)
        notes = [self._notes.found(tag_id, time_ns, time_s, now) for tag_id in new]
        unchanged = Choice(steps=None, status_text=course.status_text, notes=tuple(notes))
        if course.over:
            return unchanged
        staying = course.goal_m is None and not idle
        must = bool(notes) or search.finished or time_s >= self._task.order.duration_s
        state = self._state(time_s, now, idle=idle)
        if staying and not must and not self._approached(state):
            return unchanged
        decision = self._decisions.decide(state, now, others)
        goal = goal_of(decision.action)
        ends = isinstance(decision.action, Return)
        stays_on = staying and not must and goal is None and not ends
        if not idle and (_is_same(goal, course.goal_m) or stays_on):
            return unchanged
        short = self._decisions.text(decision.action, now)
        found = f"{len(search.found)} of {len(self._task.tags)} found"
        status_text = f"{found}; {short}: {decision.reason}"
        self._course_before = course
        self._course = _Course(
            goal_m=goal, near=search.near(state), over=ends, status_text=status_text
        )
        notes.append(
            self._notes.note(
                "decision", time_ns, time_s, now, short, decision.reason, goal_m=goal
            )
        )
        stand = self._stopping_point(now, course.goal_m)
        return Choice(
            steps=self._steps(decision.action, now, stand),
            status_text=status_text,
            notes=tuple(notes),
            leg=(stand, stand if goal is None else self._task.place(*goal)),
            returning=ends,
            held=self._decisions.held,
            found=self._notes.all_found(),
        )

    def withdraw(self) -> None:
        """Discard the last decision, because it is not flown."""
        self._course = self._course_before

    def end(self, time_ns: int, now: VehicleNow, reason: str) -> SearchNote:
        """Return the log entry on the end of the search, for any reason."""
        text = f"{len(self._search.found)} of {len(self._task.tags)} found"
        time_s = self._elapsed_s(time_ns)
        return self._notes.note("ended", time_ns, time_s, now, text, reason, likely=True)

    def _approached(self, state: VehicleState) -> bool:
        """True if an animal has probably come too close since the hover began."""
        near = self._search.near(state)
        return (
            near > 1.0 - SEARCH_RULES.kept_away
            and near > SEARCH_RULES.approached * self._course.near
        )

    def _steps(self, action: Action, now: VehicleNow, stand: Place) -> tuple[Step, ...]:
        """Return the steps that fly an action; a hover or turn takes place at `stand`."""
        task, height = self._task, self._task.height_m
        match action:
            case FlyTo():
                return (Go(place=task.place(action.east_m, action.north_m), height_m=height),)
            case Rotate():
                # By steps, a good part of what the planner counts is the way between them.
                turn = replace(task.order, action="rotate", duration_s=task.turn_s)
                there = replace(now, latitude_deg=stand[0], longitude_deg=stand[1])
                return rotation(turn, there, task.limits, task.behaviour, height).steps
            case Hold():
                return (Go(place=stand, height_m=height, stay_s=action.duration_s),)
            case Return():
                return (Home(),)

    def _stopping_point(self, now: VehicleNow, goal_m: tuple[float, float] | None) -> Place:
        """Return where the drone can stop on the way to a goal, or its position without one."""
        if goal_m is None:
            return (now.latitude_deg, now.longitude_deg)
        return stopping_place(now, self._task.place(*goal_m))

    def _elapsed_s(self, time_ns: int) -> float:
        return 0.0 if self._begun_ns is None else s_from_ns(time_ns - self._begun_ns)

    def _state(self, time_s: float, now: VehicleNow, *, idle: bool) -> VehicleState:
        """Return the drone's state when its next action begins; in flight, where it stops."""
        stand = self._stopping_point(now, None if idle else self._course.goal_m)
        east, north = self._task.local_m(*stand)
        return VehicleState(
            time_s=time_s,
            east_m=east,
            north_m=north,
            height_m=self._task.height_m,
            yaw_deg=now.yaw_deg or 0.0,
        )


def _is_same(goal: tuple[float, float] | None, before: tuple[float, float] | None) -> bool:
    if goal is None or before is None:
        return False
    return hypot(goal[0] - before[0], goal[1] - before[1]) < SEARCH_RULES.same_goal_m
