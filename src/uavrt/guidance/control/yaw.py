"""Check that the drone's heading turns only as commanded; no I/O."""

from collections import deque
from dataclasses import dataclass, field
from math import atan, copysign, degrees

from uavrt.core.units import wrap_degrees_180
from uavrt.guidance.safety import SAFETY

FOREIGN_TURN = "another program turns the drone"


@dataclass(slots=True, kw_only=True)
class YawWatch:
    """Monitors the heading after a command; `fault` returns how the heading contradicts it.

    The heading may stay as it was or approach its aim. The aim is the requested heading or,
    without one, the bearing of a target that is not near. Away from the aim, the heading may
    turn only towards the drone's recent course.

    `start_s` is the time of the command [s], `yaw_deg` the heading at that time [°], and
    `turning_deg_s` the turn rate at that time [°/s]. `tolerance_deg` allows for gusts and
    overshoot [°]. `wanted_deg` is the requested heading [°]. For a turn in place, `turn_deg` is
    its angle, positive clockwise [°], and `rate_deg_s` its rate [°/s]. `exact` means that the
    heading is a setpoint, which gusts do not move.
    """

    start_s: float
    yaw_deg: float
    tolerance_deg: float
    wanted_deg: float | None = None
    turn_deg: float | None = None
    rate_deg_s: float = 0.0
    turning_deg_s: float = 0.0
    exact: bool = False
    turned_deg: float = 0.0
    """Angle that a turn in place has turned so far, positive in its requested direction [°]."""
    _aim_deg: float | None = None
    _first_deg: float = 0.0
    _best_deg: float = 0.0
    _near: bool = False
    _aligned_since_s: float | None = None
    _aligned: bool = False
    """True once the heading has been close to its aim for `SAFETY.aligned_s`."""
    _moved_s: float = 0.0
    _turns: bool = False
    _settles: bool = False
    _swept: "_Swept | None" = None
    """Bearings of a target since the drone came near; None while it is farther away."""
    _on_deg: float = 0.0
    """Angle by which the heading setpoint continued an earlier turn, since `_turn_s` [°]."""
    _ended: bool = False
    _side_deg: float = 0.0
    """Angle from the heading to its aim at the last report, positive clockwise [°]."""
    _step_deg: float = 0.0
    """Change of the heading between the last two reports [°]."""
    _courses: deque[tuple[float, float, float]] = field(default_factory=deque)
    """(time [s], heading [°], course over ground [°]) of each report in the last
    `SAFETY.course_follow_s`."""
    _turn_s: float = field(init=False)
    """Time from which an earlier turn may still continue [s]: that of the command, or the last
    at which the heading setpoint passed its aim."""
    _seen_s: float = field(init=False)
    """Time of the last report with a heading [s]."""
    _stood_s: float = 0.0
    """Time without motion since the drone last moved [s], up to `SAFETY.course_follow_s`."""

    def __post_init__(self) -> None:
        self._turn_s = self._seen_s = self.start_s
        if self.wanted_deg is not None:
            self._first_deg = self._best_deg = abs(
                wrap_degrees_180(self.wanted_deg - self.yaw_deg)
            )

    @property
    def begun(self) -> bool:
        """True if the heading has reached the requested one or has turned towards it."""
        if self.wanted_deg is None:
            return True
        return self._best_deg < max(
            SAFETY.turn_done_deg, self._first_deg - SAFETY.turn_begun_deg
        )

    def fault(
        self,
        time_s: float,
        yaw_deg: float,
        bearing_deg: float | None = None,
        away_m: float = 0.0,
        course_deg: float | None = None,
    ) -> str | None:
        """Add a heading; return a text if it contradicts the command, else None."""
        before_deg, self.yaw_deg = self.yaw_deg, yaw_deg
        step = wrap_degrees_180(yaw_deg - before_deg)
        if self.turn_deg is not None:
            return self._turning(time_s, step)
        aim, slack = self._aim(step, bearing_deg, away_m)
        aimed = aim if self._aim_deg is None else self._aim_deg
        moved = abs(wrap_degrees_180(aim - aimed))
        from_aim = abs(wrap_degrees_180(aimed - before_deg))
        receded = max(0.0, abs(wrap_degrees_180(aim - before_deg)) - from_aim)
        off = abs(wrap_degrees_180(aim - yaw_deg))
        if self._aim_deg is None and self.wanted_deg is None:
            self._first_deg = self._best_deg = off
        self._aim_deg = aim
        self._pass_aim(time_s, wrap_degrees_180(aim - yaw_deg), step)
        # Also where the aim moves away from the heading that is not another's turn.
        self._align(time_s, off)
        most = self._best_deg + receded + slack + self._tolerance_deg
        if off < self._best_deg + receded - 1.0 or moved > 1.0 or not self._moved_s:
            self._moved_s = time_s
        self._best_deg = min(self._best_deg + receded, off)
        frozen = self.wanted_deg is None and away_m < SAFETY.frozen_m
        there = off <= slack + self._tolerance_deg or frozen
        self._turns |= not there and off < self._first_deg - SAFETY.turn_begun_deg
        if time_s - self._turn_s < SAFETY.turn_made_up_s:
            most += self._turned_on_deg(time_s, step, off)
        follows = self._follows_course(time_s, yaw_deg, course_deg)
        stands = time_s - self._moved_s > SAFETY.stopped_s
        if self.exact and self._turns and not there and stands and not self._turns_on:
            return FOREIGN_TURN  # a setpoint that began to turn continues to its aim
        return FOREIGN_TURN if off > most and not follows else None

    @property
    def turns_on_s(self) -> float:
        """Time that a setpoint needs to stop a turn from before the command [s]."""
        return abs(self.turning_deg_s) / SAFETY.setpoint_braking_deg_s2 if self.exact else 0.0

    @property
    def _tolerance_deg(self) -> float:
        return (
            min(SAFETY.aligned_deg, self.tolerance_deg) if self._aligned else self.tolerance_deg
        )

    def _follows_course(self, time_s: float, yaw_deg: float, course_deg: float | None) -> bool:
        """True if the heading turns from its previous direction towards a recent course.

        A drone that reverses its course hovers for a moment; this time does not count.
        """
        if self._courses and course_deg is None:
            stood_s = self._stood_s + time_s - self._seen_s
            self._stood_s = min(stood_s, SAFETY.course_follow_s)
        self._seen_s = time_s
        moved_s = time_s - self._stood_s
        while self._courses and self._courses[0][0] < moved_s - SAFETY.course_follow_s:
            self._courses.popleft()
        follows = any(
            _turns_to(course, yaw_deg, before_deg, self._tolerance_deg)
            for _, before_deg, course in self._courses
        )
        if course_deg is not None:
            self._courses.append((moved_s, yaw_deg, course_deg))
        return follows

    def _align(self, time_s: float, off_deg: float) -> None:
        """Update whether the heading has been aligned with its aim for long enough."""
        if self.exact or self._near or self._aligned:
            return
        if off_deg > SAFETY.turn_done_deg:
            self._aligned_since_s = None
        elif self._aligned_since_s is None:
            self._aligned_since_s = time_s
        else:
            self._aligned = time_s - self._aligned_since_s >= SAFETY.aligned_s

    def _pass_aim(self, time_s: float, side_deg: float, step_deg: float) -> None:
        """Let a setpoint that overtook its moving aim turn as far beyond it as it must to stop.

        A setpoint that begins to turn exactly at its aim does not count as overtaking.
        """
        before_deg, self._side_deg = self._side_deg, side_deg
        turned_deg, self._step_deg = self._step_deg, step_deg
        gap_s = time_s - self._seen_s
        passes = before_deg * side_deg <= 0.0 and side_deg * step_deg < 0.0
        if (
            self.exact
            and self.wanted_deg is None  # a commanded heading comes to meet nothing
            and passes
            and gap_s > 0.0
            and abs(turned_deg) > SAFETY.settled_deg
            and turned_deg * step_deg > 0.0
        ):
            self._may_stop(time_s, max(turned_deg, step_deg, key=abs) / gap_s)

    def _may_stop(self, time_s: float, turning_deg_s: float) -> None:
        """Allow a setpoint that turns at this rate [°/s] to turn as far as it needs to stop."""
        self.turning_deg_s = turning_deg_s
        self._turn_s, self._on_deg, self._ended = time_s, 0.0, False

    @property
    def _turns_on(self) -> bool:
        """True while a setpoint may still complete an earlier turn away from its aim."""
        longest = _setpoint_turns_on_deg(self.turning_deg_s)
        return bool(longest) and not self._ended

    def _turned_on_deg(self, time_s: float, step_deg: float, off_deg: float) -> float:
        """Return how far an earlier turn may still lead away from the aim [°].

        A setpoint first completes a turn that began before the command or near the target.
        """
        if not self.exact:
            return _turns_on_deg(self.turning_deg_s)
        if not self._turns_on:
            return 0.0
        longest = _setpoint_turns_on_deg(self.turning_deg_s)
        self._on_deg += abs(step_deg)
        on_deg = copysign(step_deg, step_deg * self.turning_deg_s)
        stands = on_deg < SAFETY.settled_deg and time_s - self._turn_s > SAFETY.report_delay_s
        self._ended = on_deg < 0.0 or stands or self._on_deg > longest
        if self._ended:
            self._turns, self._moved_s = True, time_s
            self._best_deg = max(self._best_deg, min(off_deg, self._best_deg + longest))
            self._first_deg = max(self._first_deg, self._best_deg)
        return longest

    def _aim(
        self, step_deg: float, bearing_deg: float | None, away_m: float
    ) -> tuple[float, float]:
        """Return the aim (requested heading, bearing or old heading) and its error [°]."""
        yaw_deg = self.yaw_deg
        if self.wanted_deg is not None:
            return self.wanted_deg, 0.0
        was_near = self._near
        self._near = bearing_deg is None or away_m < SAFETY.heading_stays_m
        if not self._near and bearing_deg is not None:
            slack = degrees(atan(SAFETY.bearing_place_error_m / away_m))
            if not (self.exact and away_m < SAFETY.frozen_m):
                self._swept = None
                return bearing_deg, slack
            self._swept = self._swept or _Swept(bearing_deg)
            self._swept.add(bearing_deg)
            return self._swept.nearest_deg(yaw_deg), slack
        if self._swept is not None:
            return self._swept.rests(yaw_deg, step_deg), 0.0
        # A turn that is not over yet comes to its end first.
        settles = not was_near or (self._settles and abs(step_deg) > SAFETY.settled_deg)
        self._settles = settles and not self._aligned
        if not was_near and self._aligned:
            return yaw_deg, 0.0
        if self._aim_deg is None or self._settles:
            return yaw_deg, 0.0
        return self._aim_deg, 0.0

    def _turning(self, time_s: float, step_deg: float) -> str | None:
        """Return a text if a turn in place goes backwards or too fast; else None."""
        assert self.turn_deg is not None
        self.turned_deg += step_deg if self.turn_deg >= 0.0 else -step_deg
        self._best_deg = max(self._best_deg, self.turned_deg)
        passed = self.rate_deg_s * (time_s - self.start_s)
        soonest = min(abs(self.turn_deg), passed) + self.tolerance_deg
        least = self._best_deg - self.tolerance_deg
        return None if least <= self.turned_deg <= soonest else FOREIGN_TURN


@dataclass(slots=True)
class _Swept:
    """Range of a near target's bearings; PX4's heading setpoint may stop at any of them."""

    first_deg: float
    least_deg: float = 0.0
    most_deg: float = 0.0
    """Largest change of the bearing since the first one, clockwise [°]. `least_deg` is the
    largest counterclockwise change, as a negative number."""

    def add(self, bearing_deg: float) -> None:
        """Extend the range to include a bearing."""
        change = wrap_degrees_180(bearing_deg - self.first_deg)
        self.least_deg = min(self.least_deg, change)
        self.most_deg = max(self.most_deg, change)

    def nearest_deg(self, yaw_deg: float) -> float:
        """Return the bearing in the range that is nearest to a heading [°]."""
        change = wrap_degrees_180(yaw_deg - self.first_deg)
        return self.first_deg + max(self.least_deg, min(self.most_deg, change))

    def rests(self, yaw_deg: float, step_deg: float) -> float:
        """Return the nearest bearing in the range [°].

        If the heading rests there, reduce the range to it.
        """
        aim = self.nearest_deg(yaw_deg)
        off = abs(wrap_degrees_180(aim - yaw_deg))
        if abs(step_deg) < SAFETY.settled_deg and off < SAFETY.target_yaw_deg:
            self.first_deg, self.least_deg, self.most_deg = aim, 0.0, 0.0
        return aim


def _turns_to(goal_deg: float, yaw_deg: float, before_deg: float, tolerance_deg: float) -> bool:
    """True if a heading has turned towards a goal, and not far beyond it."""
    left = wrap_degrees_180(goal_deg - before_deg)
    turned = wrap_degrees_180(yaw_deg - before_deg)
    towards = turned if left >= 0.0 else -turned
    if abs(left) > SAFETY.either_way_deg:
        towards = abs(turned)
    return SAFETY.course_follow_deg <= towards <= abs(left) + tolerance_deg


def _turns_on_deg(turning_deg_s: float) -> float:
    """Return how far a drone may continue an earlier turn [°]; up to 50° were measured."""
    return 1.5 * abs(turning_deg_s) + 15.0 if abs(turning_deg_s) > SAFETY.turning_deg_s else 0.0


def _setpoint_turns_on_deg(turning_deg_s: float) -> float:
    """Return how far PX4's heading setpoint turns until it stops, with a margin of 3° [°]."""
    if abs(turning_deg_s) <= SAFETY.turning_deg_s:
        return 0.0
    return turning_deg_s**2 / (2.0 * SAFETY.setpoint_braking_deg_s2) + 3.0


@dataclass(slots=True, kw_only=True)
class RestingYaw:
    """Monitors the heading of a drone that hovers without an order.

    A turn in progress may be completed and reversed, as after a command. Times count from the
    autopilot's start, because this process may read reports late after a pause.
    """

    start_boot_s: float
    yaw_deg: float
    """Heading that the drone should keep [°]: that at the start, or that of a turn completed
    since."""
    turning_deg_s: float
    tolerance_deg: float
    _moved_boot_s: float = -1.0

    def turned(self, boot_s: float, yaw_deg: float) -> bool:
        """Add a heading; True if a pilot or another station has turned the drone."""
        step = wrap_degrees_180(yaw_deg - self.yaw_deg)
        if abs(self.turning_deg_s) > SAFETY.turning_deg_s:
            since_s = max(self._moved_boot_s, self.start_boot_s)
            if step * self.turning_deg_s > 0.0 and boot_s - since_s < SAFETY.turned_s:
                self.yaw_deg, self._moved_boot_s, step = yaw_deg, boot_s, 0.0
        turns_on = boot_s - max(self._moved_boot_s, self.start_boot_s) < SAFETY.turn_made_up_s
        most = self.tolerance_deg + turns_on * _turns_on_deg(self.turning_deg_s)
        return abs(step) > most
