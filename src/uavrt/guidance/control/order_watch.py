"""Monitor a confirmed order for changes that no command caused, and check its commands; no I/O.

Until the first command, the vehicle must stay as it was at the confirmation, or continue to the
target of the previous order. Afterwards it must follow the commands (`Commanded`).
"""

from dataclasses import dataclass, field

from uavrt.core.errors import CommandRefused
from uavrt.core.messages import FlyThere, GoHome, Manoeuvre, TakeMode, TakeOff, TurnInPlace
from uavrt.core.units import wrap_degrees_180
from uavrt.guidance.control.commanded import OTHERS_TARGET, Commanded
from uavrt.guidance.control.observed import (
    HomeReport,
    LandedReport,
    ModeReport,
    Observation,
    PositionReport,
    SticksReport,
    TargetReport,
    between_m,
    same_place,
)
from uavrt.guidance.control.observed_vehicle import ObservedVehicle
from uavrt.guidance.control.offers import Offer, is_elsewhere
from uavrt.guidance.control.rc_watch import RcWatch
from uavrt.guidance.control.yaw import FOREIGN_TURN
from uavrt.guidance.safety import SAFETY


@dataclass(slots=True)
class JumpWatch:
    """Detects jumps of position or altitude. Corrections of home's altitude are allowed."""

    before: PositionReport
    jumped_m: float = 0.0
    """Sum of changes of altitude without an equal change of the height above home [m]."""

    def observe(self, seen: PositionReport) -> str | None:
        """Return a text if position or altitude jumped since the previous report; else None."""
        before, self.before = self.before, seen
        gap_s = max(0.0, seen.boot_s - before.boot_s)
        rise = seen.altitude_amsl_m - before.altitude_amsl_m
        if abs(rise) > SAFETY.height_jump_m * max(1.0, gap_s):
            return f"the height jumped by {rise:+.0f} m"
        above = seen.altitude_relative_m - before.altitude_relative_m
        climb = seen.velocity_m_s[2] * gap_s
        if abs(rise - climb) > abs(above - climb):
            self.jumped_m += rise - above
        if abs(self.jumped_m) > SAFETY.home_moved_m:
            return f"the altitude jumped by {self.jumped_m:+.0f} m"
        moved = between_m(seen, before)
        far = moved > SAFETY.place_jump_m + seen.speed_m_s * gap_s
        return f"the position jumped by {moved:.0f} m" if far else None


@dataclass(slots=True, kw_only=True)
class OrderWatch:
    """Monitors one order from its confirmation to its end."""

    offer: Offer
    """The proposal that was confirmed, with the vehicle's state at that time."""
    confirmed_s: float
    planner_s: float
    """Time of the guide process's last heartbeat [s, monotonic]."""
    place: PositionReport
    home: HomeReport
    """Home position when the order was confirmed."""
    target: TargetReport | None
    """Newest target reported since the confirmation; None if none was reported."""
    rc: RcWatch | None
    """Monitor of the remote control since the confirmation; None without a remote control."""
    sticks_unseen: bool
    """True if the operator has accepted that the RC sticks are not monitored."""
    flown: Commanded | None
    """Command of the previous order that is flown until the first one of this order; None
    without one."""
    motion: Commanded | None = None
    own_mode_seen: bool = False
    in_air_s: float | None = None
    """Time since which a vehicle that has not taken off is reported in the air [s]; None if it
    is not."""
    jumps: JumpWatch = field(init=False)

    def __post_init__(self) -> None:
        self.jumps = JumpWatch(self.place)

    @property
    def datum_m(self) -> float:
        """Altitude of home at the confirmation [m]; the order's heights are relative to it."""
        return self.place.altitude_amsl_m - self.place.altitude_relative_m

    @property
    def leg(self) -> Commanded | None:
        """Command that is flown now, of this order or the previous one; None without one."""
        return self.motion or self.flown

    @property
    def nearest_m(self) -> float | None:
        """Smallest distance from the present target so far [m]; None without a target."""
        leg = self.leg
        flies = leg is not None and isinstance(leg.manoeuvre, FlyThere)
        return round(leg.left_m, 2) if leg is not None and flies else None

    def planner_alive(self, now_s: float) -> None:
        """Note that the guide process is alive."""
        self.planner_s = now_s

    def check(
        self,
        manoeuvre: Manoeuvre,
        vehicle: ObservedVehicle,
        now_s: float,
        *,
        first: bool,
        stops: bool,
    ) -> None:
        """Raise `CommandRefused` if the requested motion must not be commanded now."""
        self._check_seen(vehicle, now_s)
        mode, _, _ = vehicle.known
        if self.offer.takeoff != isinstance(manoeuvre, TakeMode | TakeOff):
            raise CommandRefused("another order was confirmed")
        changes_mode = first or isinstance(manoeuvre, GoHome)
        if changes_mode and now_s - mode.time_s > SAFETY.mode_change_age_s:
            raise CommandRefused("the autopilot's mode was not reported recently")
        if not first and mode.mode != vehicle.behaviour.own_mode:
            raise CommandRefused(
                "the vehicle has not yet reported that it follows the first command"
            )
        motion = self.motion
        if motion is not None and not motion.obeyed:
            raise CommandRefused(
                "the vehicle has not yet reported that it follows the previous command"
            )
        if motion is not None and not stops:
            brakes = motion.not_settled_yet or motion.progress.brakes(now_s)
            brakes &= not isinstance(manoeuvre, GoHome)
            if brakes or motion.progress.stopped(now_s, SAFETY.slow_progress_s):
                raise CommandRefused("the drone is not approaching its target")
        if (
            not first
            and not self.offer.takeoff
            and vehicle.target_age_s(now_s) > SAFETY.target_age_s
        ):
            raise CommandRefused(
                f"the last target report is older than {SAFETY.target_age_s} s"
            )
        if self.offer.takeoff and not vehicle.on_ground(now_s):
            raise CommandRefused("the vehicle is already in the air")
        turns = motion is not None and _setpoint_turns(motion, vehicle)
        if (turns and not stops) or (
            isinstance(manoeuvre, TurnInPlace) and not vehicle.heading_rests
        ):
            raise CommandRefused("the drone is still moving or turning")

    def _check_seen(self, vehicle: ObservedVehicle, now_s: float) -> None:
        """Raise `CommandRefused` if reports are so old that a takeover could go unnoticed."""
        if vehicle.mode is None or now_s - vehicle.mode.time_s > SAFETY.mode_age_s:
            raise CommandRefused("the last mode report is older than 1 s")
        if vehicle.position is None or now_s - vehicle.position.time_s > SAFETY.position_age_s:
            raise CommandRefused("the last position is older than 0.5 s")
        if vehicle.late is not None:
            raise CommandRefused(vehicle.late)
        if self.rc is None:
            return
        if not self.sticks_unseen and not vehicle.sticks_reported(now_s, SAFETY.sticks_age_s):
            raise CommandRefused(f"the last RC report is older than {SAFETY.sticks_age_s} s")
        if self.rc.unsure:
            raise CommandRefused("an RC switch was moved just now")

    def sent(
        self, manoeuvre: Manoeuvre, vehicle: ObservedVehicle, now_s: float, *, first: bool
    ) -> None:
        """Note a command that is sent now; the vehicle must follow it from now on."""
        self.motion = Commanded(
            manoeuvre=manoeuvre,
            behaviour=vehicle.behaviour,
            sent_s=now_s,
            first=first,
            before=vehicle.target,
            start=vehicle.known[1],
            turning_deg_s=vehicle.turning_deg_s,
            previous=self.motion,
        )
        self.flown = None

    def overdue(self, vehicle: ObservedVehicle, now_s: float) -> str | None:
        """Return what is overdue: a report, the guide, the reaction to a command, or progress.

        None if nothing is.
        """
        if now_s - self.planner_s > SAFETY.planner_lost_s:
            return "the guide process is silent"
        lost = vehicle.lost(now_s)
        if lost is None and self.rc is not None:
            unseen = not vehicle.sticks_reported(now_s, SAFETY.sticks_lost_s)
            lost = "the RC sticks are no longer reported" if unseen else self.rc.sure(now_s)
        if lost is not None:
            return lost
        if self.motion is not None:
            return self.motion.overdue(now_s, vehicle.target_age_s(now_s))
        if now_s - self.confirmed_s > SAFETY.begins_within_s:
            late = "" if vehicle.late is None else f": {vehicle.late}"
            return f"the order did not begin within 10 s{late}"
        return None

    def observe(self, seen: Observation, vehicle: ObservedVehicle) -> str | None:
        """Return how a report shows a change that no command caused; None if it does not."""
        match seen:
            case PositionReport():
                return self._observe_position(seen, vehicle)
            case ModeReport():
                return self._observe_mode(seen, vehicle)
            case TargetReport():
                return self._observe_target(seen, vehicle)
            case SticksReport():
                return self._observe_sticks(seen)
            case LandedReport():
                return self._observe_landed(seen)
            case HomeReport() if between_m(seen, self.home) > SAFETY.home_moved_m:
                return "home was moved"  # compared so, it cannot creep away either
        return None

    def _observe_mode(self, seen: ModeReport, vehicle: ObservedVehicle) -> str | None:
        behaviour, motion = vehicle.behaviour, self.motion
        others = f"the mode is {behaviour.mode_name(seen.mode)}"
        if motion is None:
            return None if seen.mode == self.offer.mode else others
        if isinstance(motion.manoeuvre, GoHome) and seen.mode in behaviour.return_modes:
            return "returning: the autopilot flies home"
        if isinstance(motion.manoeuvre, TakeOff) and not behaviour.own_mode_first:
            if seen.mode == behaviour.takeoff_mode:
                self.own_mode_seen = True
                return None
            if vehicle.in_own_mode and motion.top_m >= motion.highest_m - SAFETY.takeoff_done_m:
                return None  # it has arrived, and hovers
        elif vehicle.in_own_mode:
            self.own_mode_seen = True
            motion.in_own_mode()
            return None
        waits = seen.time_s - motion.sent_s < SAFETY.mode_changes_s
        before = not self.own_mode_seen and seen.mode == self.offer.mode
        return None if before and waits else others

    def _observe_target(self, seen: TargetReport, vehicle: ObservedVehicle) -> str | None:
        before, self.target = self.target, seen
        if self._turned(seen):
            return FOREIGN_TURN
        watched = seen, vehicle.position, vehicle.target_turning_deg_s
        if self.motion is not None:
            return self.motion.observe_target(*watched)
        fault = None if self.flown is None else self.flown.observe_target_yaw(*watched)
        # A vehicle in another mode follows the sticks with its target, or a mission.
        if fault is not None or self.offer.mode != vehicle.behaviour.own_mode:
            return fault
        within_m = vehicle.behaviour.target_m
        changed = before is not None and not same_place(seen, before, within_m)
        others = changed or (before is None and is_elsewhere(seen, self.place))
        return OTHERS_TARGET if others else None

    def _observe_position(self, seen: PositionReport, vehicle: ObservedVehicle) -> str | None:
        if self._turned(seen):
            return FOREIGN_TURN
        jump, leg = self.jumps.observe(seen), self.leg
        if jump is not None or leg is None:
            return jump
        return leg.observe_position(seen, vehicle.turning_deg_s)

    def _turned(self, seen: PositionReport | TargetReport) -> bool:
        """True if a pilot or station turns a hovering vehicle before the first command."""
        return self.motion is None and self.offer.rests and self.offer.turned(seen)

    def _observe_landed(self, seen: LandedReport) -> str | None:
        motion, takes_off = self.motion, self.offer.takeoff
        if takes_off and motion is None:
            return self._observe_in_air(seen)
        rises = motion is not None and isinstance(motion.manoeuvre, TakeOff) and motion.obeyed
        return "the vehicle has landed" if seen.on_ground and (rises or not takes_off) else None

    def _observe_in_air(self, seen: LandedReport) -> str | None:
        """Return a text if the vehicle flies before its take-off command; else None.

        PX4 1.17 reports flight for about a second after arming on the ground. Until it reports
        the ground again, `check` refuses the command.
        """
        if seen.on_ground is not False:
            self.in_air_s = None
            return None
        if self.in_air_s is None:
            self.in_air_s = seen.time_s
        lasts = seen.time_s - self.in_air_s > SAFETY.in_air_unsure_s
        rose_m = self.jumps.before.altitude_amsl_m - self.place.altitude_amsl_m
        flies = lasts or rose_m > SAFETY.takeoff_rise_m
        return "the vehicle is already in the air" if flies else None

    def _observe_sticks(self, seen: SticksReport) -> str | None:
        if self.rc is None:
            return "a remote control was switched on" if seen.channels_us else None
        if not seen.channels_us:
            return "the RC sticks are no longer reported"
        return self.rc.observe(seen)


def _setpoint_turns(motion: Commanded, vehicle: ObservedVehicle) -> bool:
    """True if the heading setpoint turns although the drone has no reason to turn.

    The drone then has the commanded heading, or is so near its target that PX4 keeps the
    heading. Another station may have begun the turn, and a further command would undo it.
    """
    target, seen = vehicle.target, vehicle.position
    if target is None or target.yaw_rate_deg_s is None or motion.yaw is None:
        return False
    if seen is None or seen.yaw_deg is None:
        return False
    wanted_deg = motion.yaw.wanted_deg
    if wanted_deg is not None:
        there = abs(wrap_degrees_180(wanted_deg - seen.yaw_deg)) <= SAFETY.turn_done_deg
    else:
        manoeuvre = motion.manoeuvre
        there = isinstance(manoeuvre, FlyThere) and seen.way_to(manoeuvre)[1] < SAFETY.frozen_m
    return there and abs(target.yaw_rate_deg_s) > SAFETY.setpoint_rests_deg_s
