"""Decide whether we command the vehicle: only until anyone or anything objects. Pure.

Three states. *Out*: nothing is sent. *Confirmed*: the operator has confirmed an order; it must
begin within 10 s. *In command*: the first command was sent. Whatever is seen that is not of our
making ends it at once and for good: nothing is repeated, nothing waits, and only a confirmation
of a new order, with a nonce that was never used, begins again. What the autopilot answers to a
command counts for nothing: PX4 refuses commands that it flies, and accepts some that it does
not. A command is obeyed when its target is seen to be the vehicle's.

It stands where commands leave the drone side, and hears the autopilot before anybody else: what
was on its way from a planner when a pilot took over is refused here.
"""

from collections import Counter
from dataclasses import dataclass
from enum import StrEnum
from math import inf

from uavrt.errors import CommandRefused
from uavrt.guidance.commanded import (
    ASTRAY_M,
    AT_TOP_M,
    HEIGHT_OFF_M,
    OTHERS_TARGET,
    TARGET_YAW_DEG,
    YAW_DEG,
    Commanded,
)
from uavrt.guidance.hands import SwitchWatch, sticks_moved, switched
from uavrt.guidance.lateness import Lateness
from uavrt.guidance.observed import (
    Boot,
    BootTimeSeen,
    FailsafeSeen,
    HomeSeen,
    LandedSeen,
    ModeSeen,
    Observation,
    PositionLost,
    PositionSeen,
    SticksSeen,
    TargetSeen,
    between_m,
    same_place,
)
from uavrt.guidance.orders import OFFER_HOLDS_S
from uavrt.guidance.progress import SLOW_S
from uavrt.guidance.stopping import stops_within_m
from uavrt.guidance.wishes import CommandWriter, VehicleCommand
from uavrt.guidance.yaw import OTHERS_TURN, RestingYaw
from uavrt.messages import FlyThere, GoHome, TakeMode, TakeOff, VehicleSeen, Wish
from uavrt.units import wrap_degrees_180

BEGINS_WITHIN_S = 10.0
"""From the confirmation to the first command."""
MODE_AGE_S, POSITION_AGE_S = 1.0, 0.5
"""Older, and no command is sent."""
CHANGE_MODE_AGE_S = 0.2
"""The same for a command that changes the mode: a pilot's own change crosses with it."""
STICKS_AGE_S = 0.3
"""The same for sticks that are to be seen: they are told at 5 Hz or more."""
MODE_LOST_S, POSITION_LOST_S, STICKS_LOST_S = 3.0, 2.0, 1.5
HEARTBEAT_LOST_S = 5.0
"""Older, and the order has ended. Only the heartbeat tells of disarming and failsafes."""
TARGET_AGE_S = 0.3
"""Older, and no further command is sent: another's target would not have been seen."""
PLANNER_LOST_S = 2.0
MODE_CHANGES_WITHIN_S = 1.5
"""Until then the mode before a command is right; PX4 reports it at 2 Hz."""
HEIGHT_JUMP_M = 5.0
PLACE_JUMP_M = 30.0
HOME_MOVED_M = 2.0
"""From where it was at the confirmation; the same for jumps of the altitude, in all."""
FLYING_M = 2.0
"""Above home: lower than this it stands on the ground, where the autopilot does not tell."""
LANDED_AGE_S = 3.0
WHEN_YOURS = "A pilot flies it; ask again once it is yours"


class Standing(StrEnum):
    """See the module's text."""

    OUT = "out"
    CONFIRMED = "confirmed"
    IN_COMMAND = "in command"


@dataclass(slots=True, kw_only=True)
class Offer:
    """An order that waits for the operator."""

    order_id: int
    nonce: int
    made_s: float
    mode: int
    """What the vehicle was in when the operator was asked."""
    target: TargetSeen | None
    """Where it flew to then, if that was nobody's order but could be another's now."""
    rests: bool
    """Whether it was nobody's order, in our own mode."""
    place: PositionSeen
    """Where it was."""
    home: HomeSeen
    sticks: SticksSeen | None
    """As they were, if they were seen."""
    switches: SwitchWatch | None
    """Since then, likewise."""
    yaw: RestingYaw | None
    target_yaw: RestingYaw | None
    """Headings of a vehicle that rests: its own, and the one that it reports as its target."""
    takeoff: bool = False

    def turned(self, seen: PositionSeen | TargetSeen) -> bool:
        """Whether another has turned the vehicle since, or has asked it to turn."""
        watch = self.yaw if isinstance(seen, PositionSeen) else self.target_yaw
        if watch is None or seen.yaw_deg is None:
            return False
        return watch.turned(seen.time_s, seen.yaw_deg)


@dataclass(slots=True, kw_only=True)
class _Order:
    """What was confirmed, and how the vehicle was then."""

    order_id: int
    takeoff: bool
    confirmed_s: float
    planner_s: float
    mode: int
    place: PositionSeen
    home: HomeSeen
    sticks_us: tuple[int, ...] | None
    switches: SwitchWatch | None
    """Since the confirmation, where a remote control was seen."""
    sticks_unseen: bool
    """The operator knows that no hand would be seen in time."""
    rest: Offer | None
    """What was confirmed, if the vehicle stood in our own mode by nobody's order then."""
    still_ours: bool
    """Whether the vehicle flies to the target of the order before this one."""
    flown: Commanded | None
    """Of that order, which the vehicle flies until the first command of this one."""
    motion: Commanded | None = None
    own_mode_seen: bool = False
    jumped_m: float = 0.0
    """By how much the altitude has jumped, against the height above home."""

    @property
    def datum_m(self) -> float:
        """Altitude from which the heights of the order count, whatever home becomes."""
        return self.place.altitude_amsl_m - self.place.altitude_relative_m


class Authority:
    """The last word on commands to one vehicle.

    It confirms a take-off only with `may_take_off`, and ignores `unwatched_channels` of the
    remote control, which no hand moves.
    """

    def __init__(
        self,
        writer: CommandWriter,
        *,
        may_take_off: bool = False,
        unwatched_channels: frozenset[int] = frozenset(),
    ) -> None:
        self._writer, self.manners = writer, writer.manners
        self._may_take_off, self._unwatched = may_take_off, unwatched_channels
        self.reason = "nothing was confirmed"
        """Why it is out."""
        self.out_s = 0.0
        self.nearest_m: float | None = None
        """Least distance to its target that the leg before reached; None: it was no leg."""
        self.counters: Counter[str] = Counter()
        self._order: _Order | None = None
        self._offer: Offer | None = None
        self._withdrawn: tuple[int, str] | None = None
        """Nonce of an offer that a pilot's hand ended, and how."""
        self._used: set[int] = set()
        self._mode: ModeSeen | None = None
        self._armed = False
        self._heartbeat_s = 0.0
        self._position: PositionSeen | None = None
        self._target: TargetSeen | None = None
        self._turning_deg_s = self._target_turning_deg_s = 0.0
        """How fast heading and reported heading changed when seen last."""
        self._landed: LandedSeen | None = None
        self._sticks: SticksSeen | None = None
        self._home: HomeSeen | None = None
        self._boot_s = 0.0
        self._lateness = Lateness()
        self._failsafe: FailsafeSeen | None = None

    @property
    def standing(self) -> Standing:
        """Which of the three states it is in."""
        if self._order is None:
            return Standing.OUT
        begun = self._order.motion is not None
        return Standing.IN_COMMAND if begun else Standing.CONFIRMED

    @property
    def order_id(self) -> int | None:
        """Order that is confirmed or in command."""
        return None if self._order is None else self._order.order_id

    @property
    def _motion(self) -> Commanded | None:
        return None if self._order is None else self._order.motion

    # --------------------------------------------------------------- the operator

    def offer(self, order_id: int, nonce: int, now_s: float, *, takeoff: bool = False) -> None:
        """Handle an order that the operator is asked to confirm; the one before is forgotten.

        Raises `CommandRefused`: the vehicle is not in a state to be flown; or the nonce was
        used.
        """
        if nonce in self._used:
            raise CommandRefused(
                "this nonce was used before", remedy="Ask for the motion again"
            )
        self._check_vehicle(now_s, takeoff=takeoff)
        assert self._mode is not None
        assert self._position is not None
        assert self._home is not None
        self._used.add(nonce)
        self._withdrawn = None
        sticks = self._fresh_sticks(now_s, STICKS_LOST_S)
        rests = self._order is None and self._mode.mode == self.manners.own_mode
        position, target = self._position, self._target if rests else None
        self._offer = Offer(
            order_id=order_id,
            nonce=nonce,
            made_s=now_s,
            mode=self._mode.mode,
            target=target,
            rests=rests,
            place=position,
            home=self._home,
            sticks=sticks,
            switches=self._switch_watch(sticks),
            yaw=_resting(position if rests else None, now_s, self._turning_deg_s, YAW_DEG),
            target_yaw=_resting(target, now_s, self._target_turning_deg_s, TARGET_YAW_DEG),
            takeoff=takeoff,
        )

    def confirm(
        self, order_id: int, nonce: int, now_s: float, *, sticks_unseen: bool = False
    ) -> None:
        """Accept the operator's confirmation of the offered order.

        With `sticks_unseen` the operator knows that no hand on the sticks would be seen.

        Raises `CommandRefused`: it is not what was offered, too late, or something has changed
        meanwhile.
        """
        offer, self._offer = self._offer, None
        if offer is None and self._withdrawn is not None and self._withdrawn[0] == nonce:
            raise CommandRefused(self._withdrawn[1], remedy=WHEN_YOURS)
        if offer is None or (offer.order_id, offer.nonce) != (order_id, nonce):
            raise CommandRefused(
                "this order is not on offer", remedy="Ask for the motion again, then confirm"
            )
        if now_s - offer.made_s > OFFER_HOLDS_S:
            raise CommandRefused(
                f"the order was asked for {now_s - offer.made_s:.0f} s ago",
                remedy=f"Ask for the motion again, then confirm within {OFFER_HOLDS_S:.0f} s",
            )
        self._check_vehicle(now_s, takeoff=offer.takeoff)
        assert self._mode is not None
        self._check_unchanged(offer, self._mode)
        if not sticks_unseen:
            self._check_sticks(now_s)
        sticks = self._fresh_sticks(now_s, STICKS_LOST_S)
        still_ours = self.flies_ours and self._mode.mode == self.manners.own_mode
        before = self._order
        flown = None if before is None or not still_ours else before.motion or before.flown
        self._end("another order was confirmed", now_s)
        assert self._position is not None
        assert self._home is not None
        self._order = _Order(
            order_id=order_id,
            takeoff=offer.takeoff,
            confirmed_s=now_s,
            planner_s=now_s,
            mode=self._mode.mode,
            place=self._position,
            home=self._home,
            sticks_us=None if sticks is None else sticks.channels_us,
            switches=self._switch_watch(sticks),
            sticks_unseen=sticks_unseen,
            rest=offer if offer.rests else None,
            still_ours=still_ours,
            flown=flown,
        )
        self.reason = ""
        self.counters["orders_confirmed"] += 1

    def _check_unchanged(self, offer: Offer, mode: ModeSeen) -> None:
        """Raise `CommandRefused` where another has the vehicle since the operator was asked."""
        then, now, within_m = offer.target, self._target, self.manners.target_m
        given = then is not None and now is not None and not same_place(then, now, within_m)
        if mode.mode != offer.mode:
            what = f"the mode has changed to {self.manners.mode_name(mode.mode)}"
        elif given or (offer.rests and then is None and _is_elsewhere(now, offer.place)):
            what = "another has given a target since you were asked"
        elif offer.switches is not None and offer.switches.unsure:
            what = "a switch of the remote control was moved just now"
        else:
            return
        raise CommandRefused(what, remedy=WHEN_YOURS)

    def _check_sticks(self, now_s: float) -> None:
        """Raise `CommandRefused` unless a hand on the sticks would be seen in time."""
        if self._fresh_sticks(now_s, STICKS_AGE_S) is not None:
            return
        what = "the sticks are not seen: nobody could take over"
        if self._fresh_sticks(now_s, STICKS_LOST_S) is not None:
            what = f"the sticks are told too seldom: not within {STICKS_AGE_S} s"
        raise CommandRefused(
            what, remedy="Switch the remote on, or confirm that sticks are not seen"
        )

    def _check_vehicle(self, now_s: float, *, takeoff: bool) -> None:
        """Raise `CommandRefused` unless the vehicle can be flown by us."""
        fault = self.fault(now_s, takeoff=takeoff)
        if fault is not None:
            raise CommandRefused(*fault[:1], remedy=fault[1])

    def fault(self, now_s: float, *, takeoff: bool = False) -> tuple[str, str] | None:
        """Why no order, or no take-off, can be confirmed now, and the remedy; else None."""
        if takeoff and not self._may_take_off:
            remedy = "Take off by hand, or set guidance.may_take_off = true on the drone"
            return "this drone does not take off by order", remedy
        if self._mode is None or now_s - self._mode.time_s > MODE_AGE_S:
            return "the autopilot's mode is not known", "Check the link to the autopilot"
        if now_s - self._heartbeat_s > HEARTBEAT_LOST_S:
            return "no heartbeat of the autopilot", "Check the link to the autopilot"
        if self._position is None or now_s - self._position.time_s > POSITION_AGE_S:
            return "the vehicle has no position", "Wait for its satellites"
        if self._home is None:
            return "the vehicle has no home", "Wait for its position, or set home in the GCS"
        if self.late is not None:
            return self.late, "Let it stream less, or give it a faster link"
        if not self._armed:
            what = "Let the pilot arm, and ask again" if takeoff else "Take off by hand"
            return "the vehicle is not armed", f"{what}; uavrt never arms"
        if self.on_ground(now_s) and not takeoff:
            return "the vehicle is on the ground", "Take off by hand first"
        if takeoff and not self.on_ground(now_s):
            return "the vehicle is in the air already", "Ask for another motion"
        if (
            not takeoff
            and self._mode.mode == self.manners.takeoff_mode != self.manners.own_mode
        ):
            return "the vehicle still takes off", "Ask again once it hovers"
        if self._failsafe is not None:
            what = self._failsafe.what
            return f"the autopilot tells of a failsafe: {what}", "Land, and see to it"
        return None

    @property
    def late(self) -> str | None:
        """Says that what the vehicle tells is too old to command anything; else None."""
        return self._lateness.fault

    def on_ground(self, now_s: float) -> bool:
        """Whether it stands on the ground, by its own word or else by its height above home."""
        landed, position = self._landed, self._position
        told = landed is not None and now_s - landed.time_s <= LANDED_AGE_S
        if told and landed is not None and landed.on_ground is not None:
            return landed.on_ground
        return position is not None and position.altitude_relative_m < FLYING_M

    def stop(self, now_s: float, reason: str = "stopped by the operator") -> None:
        """End it from our side."""
        self._end(reason, now_s)

    def planner_alive(self, now_s: float) -> None:
        """Note a sign of life of the process that sends the wishes."""
        if self._order is not None:
            self._order.planner_s = now_s

    # ---------------------------------------------------------------- the commands

    def command(
        self, order_id: int, wish: Wish, now_s: float, *, stops: bool = False
    ) -> VehicleCommand:
        """Turn a wish into the command to be sent now, once.

        One that `stops` the drone, in the mode it is in, may be the first command of an order
        while the one before is still flown, and never changes the mode.

        Raises `CommandRefused`: nothing may be sent; the wish is gone.
        """
        self.tick(now_s)
        order = self._order
        if order is None or order_id != order.order_id:
            raise CommandRefused(f"not in command: {self.reason or 'another order is'}")
        first, motion = order.motion is None and not stops, order.motion
        position = self._seen_lately(order, now_s)
        assert self._mode is not None
        if order.takeoff != isinstance(wish, TakeMode | TakeOff):
            raise CommandRefused("this is not what was confirmed")
        changes_mode = first or isinstance(wish, GoHome)
        if changes_mode and now_s - self._mode.time_s > CHANGE_MODE_AGE_S:
            raise CommandRefused("the mode was not seen just now")
        if not first and self._mode.mode != self.manners.own_mode:
            raise CommandRefused("the first command is not yet seen to be obeyed")
        if motion is not None and not motion.obeyed:
            raise CommandRefused("the command before is not yet seen to be obeyed")
        if motion is not None and not stops:
            brakes = motion.not_settled_yet or motion.progress.brakes(now_s)
            brakes &= not isinstance(wish, GoHome)
            if brakes or motion.progress.stands(now_s, SLOW_S):
                raise CommandRefused("the drone comes no nearer to its target")
        if not first and not order.takeoff and self._target_age_s(now_s) > TARGET_AGE_S:
            raise CommandRefused(f"the target is older than {TARGET_AGE_S} s")
        if order.takeoff and not self.on_ground(now_s):
            raise CommandRefused("the vehicle is in the air already")
        command = self._writer.command(
            wish, first=first, datum_m=order.datum_m, home=self._home
        )
        self._note_nearest(order)
        order.motion = Commanded(
            wish=wish,
            manners=self.manners,
            sent_s=now_s,
            first=first,
            before=self._target,
            start=position,
            turning_deg_s=self._turning_deg_s,
            previous=motion,
        )
        order.flown, order.still_ours = None, False
        self.counters["commands_sent"] += 1
        return command

    def _seen_lately(self, order: _Order, now_s: float) -> PositionSeen:
        """Where it is; raises `CommandRefused` where a takeover would not have been seen."""
        position = self._position
        if self._mode is None or now_s - self._mode.time_s > MODE_AGE_S:
            raise CommandRefused("the mode is older than 1 s")
        if position is None or now_s - position.time_s > POSITION_AGE_S:
            raise CommandRefused("the position is older than 0.5 s")
        if self.late is not None:
            raise CommandRefused(self.late)
        seen = self._fresh_sticks(now_s, STICKS_AGE_S) is not None
        if order.sticks_us is not None and not seen and not order.sticks_unseen:
            raise CommandRefused(f"the sticks are older than {STICKS_AGE_S} s")
        if order.switches is not None and order.switches.unsure:
            raise CommandRefused("a switch of the remote control was moved just now")
        return position

    @property
    def mode_now(self) -> str:
        """The vehicle's mode by name; empty before any was seen."""
        return "" if self._mode is None else self.manners.mode_name(self._mode.mode)

    @property
    def taking_off(self) -> bool:
        """Whether an order to take off is in command: nothing makes the drone stand in it."""
        order = self._order
        return order is not None and order.takeoff and order.motion is not None

    @property
    def climbs(self) -> bool:
        """Whether the take-off itself was commanded: it goes on to its height."""
        motion = self._motion
        return self.taking_off and motion is not None and isinstance(motion.wish, TakeOff)

    @property
    def flies_ours(self) -> bool:
        """Whether the vehicle flies what we commanded: this order's, or the last one's yet."""
        order = self._order
        return order is not None and (order.motion is not None or order.still_ours)

    def vehicle_seen(
        self,
        *,
        battery_percent: float | None = None,
        wishes_sent: int = 0,
        wishes_refused: int = 0,
        ground_silent_s: float = 0.0,
    ) -> VehicleSeen | None:
        """What a pilot needs to know; None without a position or a home."""
        position, home, motion = self._position, self._home, self._motion
        if position is None or home is None:
            return None
        above = position.altitude_relative_m
        if self._order is not None:
            above = position.altitude_amsl_m - self._order.datum_m
        return VehicleSeen(
            latitude_deg=position.latitude_deg,
            longitude_deg=position.longitude_deg,
            altitude_amsl_m=position.altitude_amsl_m,
            altitude_relative_m=above,
            speed_m_s=position.speed_m_s,
            yaw_deg=position.yaw_deg,
            home=(home.latitude_deg, home.longitude_deg),
            battery_percent=battery_percent,
            obeyed=self.obeyed,
            wishes_sent=wishes_sent,
            wishes_refused=wishes_refused,
            turned_deg=0.0 if motion is None else motion.turned_deg,
            ground_silent_s=ground_silent_s,
        )

    @property
    def obeyed(self) -> bool:
        """Whether the last command is seen to be obeyed and another may follow now."""
        motion = self._motion
        return motion is not None and motion.obeyed and not motion.not_settled_yet

    # --------------------------------------------------------------- what is seen

    def see(self, seen: Observation) -> None:
        """Handle what the vehicle reports; anything that we did not cause ends the order."""
        match seen:
            case PositionSeen():
                self._see_position(seen)
            case ModeSeen():
                self._see_mode(seen)
            case TargetSeen():
                self._see_target(seen)
            case SticksSeen():
                self._see_sticks(seen)
            case HomeSeen():
                self._see_home(seen)
            case LandedSeen():
                self._see_landed(seen)
            case FailsafeSeen():
                self._failsafe = seen
                self._end(f"failsafe: {seen.what}", seen.time_s)
            case PositionLost():
                self._position = None
                self._end("the position is lost", seen.time_s)
            case BootTimeSeen():
                self._see_boot_time(seen)
            case Boot():
                self._restarted("another autopilot", seen.time_s)

    def tick(self, now_s: float) -> None:
        """End what has become too old."""
        failsafe = self._failsafe
        if failsafe is not None and now_s - failsafe.time_s > MODE_LOST_S:
            self._failsafe = None
        order = self._order
        if order is None:
            return
        if now_s - order.planner_s > PLANNER_LOST_S:
            self._end("the guide is silent", now_s)
        elif self._mode is None or now_s - self._mode.time_s > MODE_LOST_S:
            self._end("the mode is no longer reported", now_s)
        elif now_s - self._heartbeat_s > HEARTBEAT_LOST_S:
            self._end("no heartbeat of the autopilot", now_s)
        elif self._position is None or now_s - self._position.time_s > POSITION_LOST_S:
            self._end("the position is lost", now_s)
        elif order.sticks_us is not None and self._fresh_sticks(now_s, STICKS_LOST_S) is None:
            self._end("the sticks are not seen any more", now_s)
        elif order.switches is not None and order.switches.sure(now_s) is not None:
            self._end(switched(order.switches.sure(now_s) or 0), now_s)
        elif order.motion is not None:
            self._end_if(order.motion.overdue(now_s, self._target_age_s(now_s)), now_s)
        elif now_s - order.confirmed_s > BEGINS_WITHIN_S:
            late = "" if self.late is None else f": {self.late}"
            self._end(f"the order was not begun within 10 s{late}", now_s)

    def _target_age_s(self, now_s: float) -> float:
        return inf if self._target is None else now_s - self._target.time_s

    def _see_boot_time(self, seen: BootTimeSeen) -> None:
        if seen.boot_s + 1.0 < self._boot_s:
            self._restarted("the autopilot has restarted", seen.time_s)
        self._boot_s = max(seen.boot_s, self._boot_s)
        self._lateness.see(seen)

    def _restarted(self, reason: str, time_s: float) -> None:
        self._end(reason, time_s)
        self._boot_s, self._lateness = 0.0, Lateness()
        self._offer = None
        self._mode = self._position = self._target = self._home = self._sticks = None
        self._landed = None

    def _see_mode(self, seen: ModeSeen) -> None:
        self._mode = seen
        if self._offer is not None and seen.mode != self._offer.mode:
            # Also if it comes back: somebody flew meanwhile.
            mode = self.manners.mode_name(seen.mode)
            self._withdraw(f"the mode has changed to {mode}")
        if seen.armed is not None:
            self._armed, self._heartbeat_s = seen.armed, seen.time_s
            if not seen.armed:
                self._end("the vehicle is disarmed", seen.time_s)
        if seen.failsafe:
            self._failsafe = FailsafeSeen(seen.time_s, "critical state")
            self._end("the autopilot is in a failsafe", seen.time_s)
        order = self._order
        if order is not None and order.motion is not None:
            self._see_mode_in_command(order, order.motion, seen)
        elif order is not None and seen.mode != order.mode:
            self._end(self._mode_words(seen.mode), seen.time_s)

    def _see_mode_in_command(self, order: _Order, motion: Commanded, seen: ModeSeen) -> None:
        own = self.manners.own_mode
        if isinstance(motion.wish, GoHome) and seen.mode in self.manners.return_modes:
            self._end("returning: the autopilot flies home", seen.time_s)
            return
        if isinstance(motion.wish, TakeOff) and not self.manners.own_mode_first:
            if seen.mode == self.manners.takeoff_mode:
                order.own_mode_seen = True
                return
            if seen.mode == own and motion.top_m >= motion.highest_m - AT_TOP_M:
                return  # it has arrived, and hovers
        elif seen.mode == own:
            order.own_mode_seen = True
            motion.obeyed |= isinstance(motion.wish, TakeMode)
            return
        waits = seen.time_s - motion.sent_s < MODE_CHANGES_WITHIN_S
        if not order.own_mode_seen and seen.mode == order.mode and waits:
            return
        self._end(self._mode_words(seen.mode), seen.time_s)

    def _mode_words(self, mode: int) -> str:
        return f"the mode is {self.manners.mode_name(mode)}"

    def _see_target(self, seen: TargetSeen) -> None:
        before = self._target
        if before is not None and seen.boot_s < before.boot_s:
            return  # overtaken on its way
        if before is not None:
            self._target_turning_deg_s = _turning_deg_s(
                before, seen, self._target_turning_deg_s
            )
        self._target = seen
        self._see_turned(seen)
        order = self._order
        if order is None:
            return
        watched = seen, self._position, self._target_turning_deg_s
        if order.motion is not None:
            self._end_if(order.motion.see_target(*watched), seen.time_s)
            return
        if order.flown is not None:
            self._end_if(order.flown.see_target_yaw(*watched), seen.time_s)
        # A vehicle in another mode follows the sticks with its target, or a mission.
        if order.mode == self.manners.own_mode:
            within_m = self.manners.target_m
            changed = before is not None and not same_place(seen, before, within_m)
            if changed or (before is None and _is_elsewhere(seen, order.place)):
                self._end(OTHERS_TARGET, seen.time_s)

    def _see_position(self, seen: PositionSeen) -> None:
        before = self._position
        if before is not None and seen.boot_s < before.boot_s:
            return  # overtaken on its way
        if before is not None:
            self._turning_deg_s = _turning_deg_s(before, seen, self._turning_deg_s)
        self._position = seen
        self._see_turned(seen)
        order = self._order
        if order is None:
            return
        if before is not None:
            self._see_jump(order, before, seen)
        motion = order.motion or order.flown
        if motion is not None:
            self._end_if(motion.see_position(seen, self._turning_deg_s), seen.time_s)

    def _see_jump(self, order: _Order, before: PositionSeen, seen: PositionSeen) -> None:
        """The place must not jump, nor the altitude; the altitude of home may be corrected."""
        gap_s = max(0.0, seen.boot_s - before.boot_s)
        rise = seen.altitude_amsl_m - before.altitude_amsl_m
        if abs(rise) > HEIGHT_JUMP_M * max(1.0, gap_s):
            self._end(f"the height jumped by {rise:+.0f} m", seen.time_s)
        above = seen.altitude_relative_m - before.altitude_relative_m
        climb = seen.velocity_m_s[2] * gap_s
        if abs(rise - climb) > abs(above - climb):
            order.jumped_m += rise - above
        if abs(order.jumped_m) > HOME_MOVED_M:
            self._end(f"the altitude jumped by {order.jumped_m:+.0f} m", seen.time_s)
        moved = between_m(seen, before)
        if moved > PLACE_JUMP_M + seen.speed_m_s * gap_s:
            self._end(f"the position jumped by {moved:.0f} m", seen.time_s)

    def _see_turned(self, seen: PositionSeen | TargetSeen) -> None:
        """Who turns it where it stands in our own mode is another, before our first command."""
        offer, order = self._offer, self._order
        if offer is not None and offer.turned(seen):
            self._withdraw(f"{OTHERS_TURN} since you were asked")
        rest = None if order is None or order.motion is not None else order.rest
        if rest is not None and rest.turned(seen):
            self._end(OTHERS_TURN, seen.time_s)

    def _see_landed(self, seen: LandedSeen) -> None:
        self._landed = seen
        order = self._order
        if order is None or seen.on_ground is None:
            return
        if order.takeoff and order.motion is None:
            if not seen.on_ground:
                self._end("the vehicle is in the air already", seen.time_s)
        elif seen.on_ground and not (order.takeoff and not self._rising):
            self._end("the vehicle has landed", seen.time_s)

    @property
    def _rising(self) -> bool:
        """Whether a take-off has left the ground."""
        motion = self._motion
        return motion is not None and isinstance(motion.wish, TakeOff) and motion.obeyed

    def _see_sticks(self, seen: SticksSeen) -> None:
        self._sticks = seen
        if self._offer is not None:
            self._see_sticks_of_offer(self._offer, seen)
        order = self._order
        if order is None:
            return
        if order.sticks_us is None:
            if seen.channels_us:
                self._end("a remote control was switched on", seen.time_s)
        elif len(seen.channels_us) != len(order.sticks_us):
            self._end("the sticks are not seen any more", seen.time_s)
        elif sticks_moved(seen, order.sticks_us):
            self._end("the sticks were moved", seen.time_s)
        elif order.switches is not None:
            channel = order.switches.see(seen)
            if channel is not None:
                self._end(switched(channel), seen.time_s)

    def _see_sticks_of_offer(self, offer: Offer, seen: SticksSeen) -> None:
        if offer.sticks is None or offer.switches is None or not seen.channels_us:
            return
        channel = offer.switches.see(seen)
        if sticks_moved(seen, offer.sticks.channels_us):
            self._withdraw("the sticks were moved since you were asked")
        elif channel is not None:
            self._withdraw(switched(channel))

    def _switch_watch(self, sticks: SticksSeen | None) -> SwitchWatch | None:
        return None if sticks is None else SwitchWatch(sticks.switches_us, self._unwatched)

    def _fresh_sticks(self, now_s: float, within_s: float) -> SticksSeen | None:
        """Those of a remote control that is seen, if they were told so lately."""
        sticks = self._sticks
        if sticks is None or not sticks.channels_us or now_s - sticks.time_s > within_s:
            return None
        return sticks

    def _see_home(self, seen: HomeSeen) -> None:
        """Compare its place with that of the confirmation, so that it cannot creep away either.

        PX4 corrects its altitude in flight; heights hold to that of the confirmation.
        """
        before, self._home = self._home, seen
        if self._order is not None:
            before = self._order.home
        elif self._offer is not None:
            before = self._offer.home
        if before is None:
            return
        if between_m(seen, before) > HOME_MOVED_M:
            self._end("home was moved", seen.time_s)

    def _withdraw(self, why: str) -> None:
        """Offer it no more: a confirmation of it is refused with the reason."""
        assert self._offer is not None
        self._withdrawn, self._offer = (self._offer.nonce, why), None

    def _note_nearest(self, order: _Order) -> None:
        """Keep how near the leg that is over came to its target."""
        leg = order.motion or order.flown
        flies = leg is not None and isinstance(leg.wish, FlyThere)
        self.nearest_m = round(leg.left_m, 2) if leg is not None and flies else None

    def _end_if(self, fault: str | None, time_s: float) -> None:
        if fault is not None:
            self._end(fault, time_s)

    def _end(self, reason: str, time_s: float) -> None:
        """Be out, with nothing on offer; the first reason counts."""
        self._offer = None
        if self._order is None:
            return
        self._note_nearest(self._order)
        self._order, self.reason, self.out_s = None, reason, time_s
        self.counters["orders_ended"] += 1


def _resting(
    seen: PositionSeen | TargetSeen | None, now_s: float, turning: float, tolerance: float
) -> RestingYaw | None:
    """Watch the heading of a vehicle that rests, if it reports one."""
    if seen is None or seen.yaw_deg is None:
        return None
    return RestingYaw(
        start_s=now_s, yaw_deg=seen.yaw_deg, turning_deg_s=turning, tolerance_deg=tolerance
    )


def _turning_deg_s(
    before: PositionSeen | TargetSeen, seen: PositionSeen | TargetSeen, known: float
) -> float:
    """How fast a heading turns, by two reports; as it was known by two of the same instant."""
    gap_s = seen.boot_s - before.boot_s
    if gap_s <= 0.0:
        return known
    if before.yaw_deg is None or seen.yaw_deg is None or gap_s > POSITION_AGE_S:
        return 0.0
    return wrap_degrees_180(seen.yaw_deg - before.yaw_deg) / gap_s


def _is_elsewhere(target: TargetSeen | None, place: PositionSeen | None) -> bool:
    """Whether a target that is the first one seen is not where the vehicle holds.

    In Guided ArduPilot tells no target before it has one; where it holds, or comes to rest, is
    nobody's order.
    """
    if target is None or target.latitude_deg is None or place is None:
        return False
    height = target.altitude_amsl_m
    climbs = height is not None and abs(height - place.altitude_amsl_m) > HEIGHT_OFF_M
    return climbs or between_m(place, target) > ASTRAY_M + stops_within_m(place.speed_m_s)
