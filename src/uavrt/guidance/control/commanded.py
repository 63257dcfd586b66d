"""Check that the drone follows the last command and nothing else; no I/O."""

from dataclasses import InitVar, dataclass, field
from math import cos, hypot, nan, radians, sin

from uavrt.core.messages import FlyThere, GoHome, Manoeuvre, TakeMode, TakeOff, TurnInPlace
from uavrt.core.units import wrap_degrees_180
from uavrt.guidance.autopilot_behaviour import Behaviour
from uavrt.guidance.control.observed import PositionReport, TargetReport, between_m, same_place
from uavrt.guidance.control.step_progress import Progress, Remaining
from uavrt.guidance.control.yaw import YawWatch
from uavrt.guidance.safety import SAFETY, stops_within_m

OTHERS_TARGET, OTHERS_HEIGHT = (
    "another program has set a target",
    "another program changes the height",
)


@dataclass(slots=True, kw_only=True)
class Commanded:
    """The last command, and the checks whether the vehicle's reports agree with it."""

    manoeuvre: Manoeuvre
    behaviour: Behaviour
    sent_s: float
    first: bool
    """True for the first command of an order, which may change the mode."""
    before: TargetReport | None
    """Target that the autopilot reported before this command; None if it reported none."""
    start: PositionReport
    """Position of the drone when the command was sent."""
    turning_deg_s: InitVar[float]
    """Turn rate of the drone when the command was sent [°/s]."""
    previous: InitVar["Commanded | None"]
    """Previous command of the same order; None for the first command."""
    left_m: float = field(init=False)
    """Smallest distance from the target since the command was sent [m]."""
    slack_m: float = field(init=False)
    lowest_m: float = field(init=False)
    highest_m: float = field(init=False)
    yaw: YawWatch | None = field(init=False, default=None)
    target_yaw: YawWatch | None = field(init=False, default=None)
    progress: Progress = field(init=False, default_factory=Progress)
    top_m: float = field(init=False)
    """Highest altitude above sea level since the command was sent [m]; used for a take-off."""
    obeyed: bool = field(init=False, default=False)
    settled: bool = field(init=False, default=False)
    """True once the drone has been within `Behaviour.settles_m` of its target."""
    not_settled_yet: bool = field(init=False, default=False)
    """True while the drone is near its target, but has not yet been within
    `Behaviour.settles_m` of it. A pilot's pause there would look like an arrival."""

    def __post_init__(self, turning_deg_s: float, previous: "Commanded | None") -> None:
        manoeuvre, start = self.manoeuvre, self.start
        turns = manoeuvre if isinstance(manoeuvre, TurnInPlace) else None
        self.top_m = start.altitude_amsl_m
        self.left_m = between_m(start, manoeuvre) if isinstance(manoeuvre, FlyThere) else 0.0
        self.slack_m = SAFETY.astray_m + stops_within_m(start.speed_m_s)
        heights = [start.altitude_amsl_m]
        if isinstance(manoeuvre, FlyThere | TakeOff):
            heights.append(manoeuvre.altitude_amsl_m)
        elif turns is not None and previous is not None:
            heights += [previous.lowest_m, previous.highest_m]
            self.left_m = previous.left_m
        self.lowest_m, self.highest_m = min(heights), max(heights)
        if start.yaw_deg is not None and not isinstance(manoeuvre, GoHome):
            self.yaw = YawWatch(
                start_s=self.sent_s,
                yaw_deg=start.yaw_deg,
                tolerance_deg=SAFETY.yaw_deg,
                wanted_deg=self._wanted_yaw_deg,
                turn_deg=None if turns is None else turns.turn_deg,
                rate_deg_s=0.0 if turns is None else turns.rate_deg_s,
                turning_deg_s=turning_deg_s,
            )

    @property
    def _wanted_yaw_deg(self) -> float | None:
        """Commanded heading [°]; None without one, or if DO_REPOSITION cannot set it."""
        if isinstance(self.manoeuvre, FlyThere) and self.behaviour.yaw_in_reposition:
            return self.manoeuvre.yaw_deg
        return None

    @property
    def takes_off(self) -> bool:
        """True for commands of a take-off, when the autopilot may report no target."""
        return isinstance(self.manoeuvre, TakeMode | TakeOff)

    @property
    def turned_deg(self) -> float:
        """Angle by which a turn in place has turned so far [°]."""
        return 0.0 if self.yaw is None else self.yaw.turned_deg

    def overdue(self, now_s: float, target_age_s: float) -> str | None:
        """Return which reaction, progress or report is overdue; None if none is."""
        rises = isinstance(self.manoeuvre, TakeOff)
        longest_s = SAFETY.takeoff_begins_within_s if rises else SAFETY.obeyed_within_s
        if not self.obeyed:
            if self.target_yaw is not None:
                longest_s += self.target_yaw.turns_on_s
            late = now_s - self.sent_s > longest_s
            return (
                "the autopilot has not reported that it follows the command" if late else None
            )
        if self.progress.stopped(now_s):
            return "the drone has stopped before its target"
        lost = not self.takes_off and target_age_s > self.behaviour.target_lost_s
        return "the target is no longer reported" if lost else None

    def in_own_mode(self) -> None:
        """Note that the vehicle is in the mode for commands. This completes a `TakeMode`."""
        self.obeyed |= isinstance(self.manoeuvre, TakeMode)

    def observe_target(
        self, seen: TargetReport, position: PositionReport | None, turning_deg_s: float
    ) -> str | None:
        """Return why a reported target contradicts the command; None if it agrees.

        `turning_deg_s` is the turn rate of the reported target heading [°/s].
        """
        match self.manoeuvre:
            case GoHome():
                return None  # the mode shows it
            case TakeMode() | TakeOff():
                return self._observe_target_of_takeoff(seen)
            case TurnInPlace():
                if self.before is not None and not self._same(seen, self.before):
                    return OTHERS_TARGET
                self.obeyed |= self.turned_deg >= 10.0
                return None
        if self._same(seen, self.manoeuvre):
            fault = self.observe_target_yaw(seen, position, turning_deg_s)
            # A turn keeps the place: there only the heading shows that it was obeyed. After a
            # new place a setpoint may first complete an earlier turn to the other side.
            watch = self.target_yaw or self.yaw
            moved = self.before is not None and not self._same(self.before, self.manoeuvre)
            self.obeyed |= moved or watch is None or watch.begun
            return fault
        return None if self._may_be_before(seen, position) else OTHERS_TARGET

    def observe_target_yaw(
        self, seen: TargetReport, position: PositionReport | None, turning_deg_s: float
    ) -> str | None:
        """Return how a reported target heading contradicts the command; else None."""
        if seen.yaw_deg is None or not self.behaviour.yaw_in_reposition:
            return None
        if not isinstance(self.manoeuvre, FlyThere):
            return None
        if self.target_yaw is None:
            self.target_yaw = YawWatch(
                start_s=self.sent_s,
                yaw_deg=seen.yaw_deg,
                tolerance_deg=SAFETY.target_yaw_deg,
                wanted_deg=self._wanted_yaw_deg,
                turning_deg_s=turning_deg_s,
                exact=True,
            )
        here = (None, 0.0) if position is None else position.way_to(self.manoeuvre)
        return self.target_yaw.fault(self._made_s(seen), seen.yaw_deg, *here)

    def _observe_target_of_takeoff(self, seen: TargetReport) -> str | None:
        """Return why a target contradicts a take-off; None if it is valid for one."""
        height = seen.altitude_amsl_m
        if seen.latitude_deg is None or height is None:
            return None
        waits = isinstance(self.manoeuvre, TakeMode) or self._waits(seen)
        before = waits and abs(height - self.start.altitude_amsl_m) < SAFETY.height_error_m
        rises = isinstance(self.manoeuvre, TakeOff)
        wanted = rises and abs(height - self.highest_m) <= self.behaviour.target_m
        here = between_m(self.start, seen) < SAFETY.astray_m
        return None if here and (before or wanted) else OTHERS_TARGET

    def _same(self, one: TargetReport, other: TargetReport | FlyThere) -> bool:
        return same_place(one, other, self.behaviour.target_m)

    def _made_s(self, seen: TargetReport | PositionReport) -> float:
        """Return when the autopilot made a report [s, monotonic], even if it was read late."""
        by_its_clock_s = self.start.time_s + seen.boot_s - self.start.boot_s
        return max(min(seen.time_s, by_its_clock_s), seen.time_s - SAFETY.stall_s)

    def _waits(self, seen: TargetReport) -> bool:
        """True if a report may be from before the autopilot's reaction to the command."""
        return not self.obeyed and self._made_s(seen) - self.sent_s < SAFETY.target_changes_s

    def _may_be_before(self, seen: TargetReport, position: PositionReport | None) -> bool:
        """True if a target may be older than the command, or be set by its mode change."""
        if not self._waits(seen):
            return False
        if self.before is not None and self._same(seen, self.before):
            return True
        if not self.first or position is None:
            return False
        return between_m(seen, position) < SAFETY.astray_m + stops_within_m(position.speed_m_s)

    def observe_position(self, seen: PositionReport, turning_deg_s: float) -> str | None:
        """Return how a position or heading contradicts the command; None if both agree."""
        manoeuvre = self.manoeuvre
        if isinstance(manoeuvre, GoHome):
            return None
        if isinstance(manoeuvre, TakeMode | TakeOff):
            return self._observe_climb(seen)
        place = manoeuvre if isinstance(manoeuvre, FlyThere) else self.before
        left = 0.0 if place is None else between_m(seen, place)
        self.left_m = min(self.left_m, left)
        off = SAFETY.height_error_m
        if left > self.left_m + self.slack_m:
            return "the drone does not fly to the commanded target"
        if not self.lowest_m - off <= seen.altitude_amsl_m <= self.highest_m + off:
            return OTHERS_HEIGHT
        free = isinstance(manoeuvre, FlyThere) and (
            left > stops_within_m(seen.speed_m_s) or seen.speed_m_s < SAFETY.leg_speed_m_s
        )
        fault = self._observe_yaw(seen)
        self.progress.observe(seen.time_s, *self._left(seen, turning_deg_s), free=free)
        return fault

    def _observe_yaw(self, seen: PositionReport) -> str | None:
        if self.yaw is None or seen.yaw_deg is None:
            return None
        manoeuvre = self.manoeuvre
        made_s = self._made_s(seen)
        if not isinstance(manoeuvre, FlyThere):
            return self.yaw.fault(made_s, seen.yaw_deg)
        bearing_deg, away_m = seen.way_to(manoeuvre)
        least_m_s = SAFETY.course_m_s if away_m > SAFETY.frozen_m else SAFETY.near_course_m_s
        follows = self.behaviour.follows_course and seen.speed_m_s > least_m_s
        course_deg = seen.course_deg if follows else None
        return self.yaw.fault(made_s, seen.yaw_deg, bearing_deg, away_m, course_deg)

    def _observe_climb(self, seen: PositionReport) -> str | None:
        """Return how a position contradicts a vertical take-off; None if it does not."""
        altitude, rises = seen.altitude_amsl_m, isinstance(self.manoeuvre, TakeOff)
        done_m = SAFETY.takeoff_done_m
        self.top_m = max(self.top_m, altitude)
        self.obeyed |= rises and altitude > self.start.altitude_amsl_m + SAFETY.takeoff_rise_m
        if self.obeyed and rises:
            left = abs(self.highest_m - altitude)
            part = Remaining(now=left, soon=left, least=SAFETY.higher_m, tolerance=done_m)
            self.progress.observe(seen.time_s, part)
        off = SAFETY.height_error_m if rises else SAFETY.takeoff_rise_m
        if between_m(seen, self.start) > SAFETY.astray_m:
            return "the drone does not climb straight up"
        if not self.top_m - done_m <= altitude <= self.highest_m + off:
            return OTHERS_HEIGHT
        return self._observe_yaw(seen)

    def _left(self, seen: PositionReport, turning_deg_s: float) -> tuple[Remaining, ...]:
        """Return the remaining distance, height and angle of a flight, or angle of a turn."""
        manoeuvre, yaw = self.manoeuvre, self.yaw
        if not isinstance(manoeuvre, FlyThere):
            return _left_of_turn(yaw)
        bearing, left = seen.way_to(manoeuvre)
        height = abs(seen.altitude_amsl_m - manoeuvre.altitude_amsl_m)
        twice = 2.0 * SAFETY.braking_m_s2
        stops = [one * seen.speed_m_s / twice for one in seen.velocity_m_s[:2]]
        along = radians(bearing)
        soon = hypot(left * cos(along) - stops[0], left * sin(along) - stops[1])
        self.settled |= left <= self.behaviour.settles_m
        self.not_settled_yet = not self.settled and left <= SAFETY.arrived_m
        near = SAFETY.arrived_m if self.settled else self.behaviour.settles_m
        place = Remaining(now=left, soon=soon, least=SAFETY.nearer_m, tolerance=near)
        up = Remaining(
            now=height, soon=height, least=SAFETY.higher_m, tolerance=SAFETY.at_height_m
        )
        if seen.yaw_deg is None:
            return place, up
        ahead = bearing if left > SAFETY.frozen_m else nan
        asked = None if yaw is None else yaw.wanted_deg
        return place, up, _left_of_heading(seen.yaw_deg, ahead, asked, turning_deg_s)


def _left_of_heading(
    yaw_deg: float, ahead_deg: float, asked_deg: float | None, turning_deg_s: float
) -> Remaining:
    """Return the remaining angle to the commanded heading, else to the target's bearing.

    The bearing `ahead_deg` is NaN if the target is too near.
    """
    off = wrap_degrees_180((ahead_deg if asked_deg is None else asked_deg) - yaw_deg)
    stops_deg = turning_deg_s * abs(turning_deg_s) / (2.0 * SAFETY.turn_braking_deg_s2)
    return Remaining(
        now=abs(off),
        soon=abs(off - stops_deg),
        least=SAFETY.turned_deg,
        tolerance=SAFETY.gust_heading_deg if asked_deg is None else SAFETY.at_yaw_deg,
        needed=asked_deg is not None,
    )


def _left_of_turn(yaw: YawWatch | None) -> tuple[Remaining, ...]:
    """Return the remaining angle of a turn in place; empty if no heading is reported."""
    if yaw is None or yaw.turn_deg is None:
        return ()
    left = abs(yaw.turn_deg) - yaw.turned_deg
    least = min(SAFETY.turned_deg, 1.5 * yaw.rate_deg_s)
    return (Remaining(now=left, soon=left, least=least, tolerance=SAFETY.at_yaw_deg),)
