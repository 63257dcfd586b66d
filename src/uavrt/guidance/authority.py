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
from math import atan2, cos, degrees, hypot, inf, isfinite, nan, radians, sin

from uavrt.errors import CommandRefused
from uavrt.geodesy import distance_m
from uavrt.guidance.hands import SwitchWatch, sticks_moved, switched
from uavrt.guidance.lateness import Lateness
from uavrt.guidance.manners import Manners
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
)
from uavrt.guidance.orders import OFFER_HOLDS_S
from uavrt.guidance.progress import (
    ARRIVED_M,
    AT_HEIGHT_M,
    HIGHER_M,
    LOOKS_DEG,
    NEARER_M,
    SLOW_S,
    TURNED_DEG,
    Left,
    Progress,
)
from uavrt.guidance.stopping import stops_within_m
from uavrt.guidance.wishes import VehicleCommand
from uavrt.guidance.yaw import OTHERS_TURN, RestingYaw, YawWatch
from uavrt.messages import FlyThere, GoHome, TakeMode, TakeOff, TurnInPlace, VehicleSeen, Wish
from uavrt.units import wrap_degrees_180, wrap_degrees_360

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
OBEYED_WITHIN_S = 3.0
CHANGES_WITHIN_S = 0.5
"""The autopilots show a new target after 0.05 to 0.09 s; until then the one before is right."""
MODE_CHANGES_WITHIN_S = 1.5
"""The same for the mode, which PX4 tells at 2 Hz."""
ASTRAY_M = 6.0
"""Farther from the target than before, besides what it takes to brake."""
HEIGHT_OFF_M = 5.0
HEIGHT_JUMP_M = 5.0
PLACE_JUMP_M = 30.0
HOME_MOVED_M = 2.0
"""From where it was at the confirmation; the same for jumps of the altitude, in all."""
YAW_DEG, TARGET_YAW_DEG = 25.0, 2.0
BRAKES_M_S2, STOPS_TURNING_DEG_S2 = 1.5, 25.0
"""Weakest braking of a flight and of a turn."""
SLOW_M_S = 1.5
"""A drone that is not near its target is not slower, but at the start of a step."""
LOOKS_ABOUT_DEG = 15.0
"""So near to its bearing, a heading that changes shows gusts, and no turn before the flight."""
FLYING_M = 2.0
"""Above home: lower than this it stands on the ground, where the autopilot does not tell."""
LANDED_AGE_S = 3.0
TAKES_OFF_WITHIN_S = 10.0
RISEN_M, AT_TOP_M = 1.0, 3.0
"""Of a take-off: obeyed; as good as there."""


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
class _Motion:
    """What was asked for last, and how it goes."""

    wish: Wish
    sent_s: float
    first: bool
    before: TargetSeen | None
    """Target of the time before the command."""
    left_m: float
    """Least distance to the target so far."""
    slack_m: float
    lowest_m: float
    highest_m: float
    yaw: YawWatch | None
    target_yaw: YawWatch | None = None
    progress: Progress
    start: PositionSeen
    """Where it was."""
    top_m: float
    """Greatest altitude so far, of a take-off."""
    obeyed: bool = False


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
    flown: _Motion | None
    """Of that order, which the vehicle flies until the first command of this one."""
    motion: _Motion | None = None
    own_mode_seen: bool = False
    jumped_m: float = 0.0
    """By how much the altitude has jumped, against the height above home."""

    @property
    def datum_m(self) -> float:
        """Altitude from which the heights of the order count, whatever home becomes."""
        return self.place.altitude_amsl_m - self.place.altitude_relative_m


class Authority:
    """The last word on commands to one vehicle.

    Parameters
    ----------
    manners : Manners
        Of its autopilot.
    lowest_m, highest_m : float
        Heights above home beyond which nothing is commanded.
    farthest_m : float
        Likewise the distance from home.
    may_take_off : bool
        Whether a take-off may be confirmed at all.
    unwatched_channels : frozenset of int
        Channels of the remote control that no hand moves.
    """

    def __init__(
        self,
        manners: Manners,
        *,
        lowest_m: float = 20.0,
        highest_m: float = 120.0,
        farthest_m: float = 1000.0,
        may_take_off: bool = False,
        unwatched_channels: frozenset[int] = frozenset(),
    ) -> None:
        self.manners = manners
        self._lowest_m, self._highest_m, self._farthest_m = lowest_m, highest_m, farthest_m
        self._may_take_off, self._unwatched = may_take_off, unwatched_channels
        self.reason = "nothing was confirmed"
        """Why it is out."""
        self.out_s = 0.0
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
    def _motion(self) -> _Motion | None:
        return None if self._order is None else self._order.motion

    # --------------------------------------------------------------- the operator

    def offer(self, order_id: int, nonce: int, now_s: float, *, takeoff: bool = False) -> None:
        """Handle an order that the operator is asked to confirm; the one before is forgotten.

        Raises
        ------
        CommandRefused
            The vehicle is not in a state to be flown; or the nonce was used.
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

        Parameters
        ----------
        order_id, nonce : int
            Those of the offer.
        now_s : float
        sticks_unseen : bool
            The operator knows that no hand on the sticks would be seen.

        Raises
        ------
        CommandRefused
            It is not what was offered, too late, or something has changed meanwhile.
        """
        offer, self._offer = self._offer, None
        if offer is None and self._withdrawn is not None and self._withdrawn[0] == nonce:
            raise CommandRefused(
                self._withdrawn[1],
                remedy="Ask anew once it is yours again",
            )
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
        if mode.mode != offer.mode:
            raise CommandRefused(
                f"the mode has changed to {self.manners.mode_name(mode.mode)}",
                remedy="Whoever changed it flies; ask anew once it is yours again",
            )
        then, now = offer.target, self._target
        given = then is not None and now is not None and not self._same(then, now)
        if given or (offer.rests and then is None and _is_elsewhere(now, offer.place)):
            raise CommandRefused(
                "another has given a target since you were asked",
                remedy="Whoever gave it flies; ask anew once it is yours again",
            )
        if offer.switches is not None and offer.switches.unsure:
            raise CommandRefused(
                "a switch of the remote control was moved just now",
                remedy="Whoever moved it flies; ask anew once it is yours again",
            )

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

        Parameters
        ----------
        order_id : int
            Whose wish it is.
        wish : Wish
        now_s : float
        stops : bool
            It makes the drone stand, in the mode it is in: it may be the first command of an
            order, while the one before is still flown, and never changes the mode.

        Raises
        ------
        CommandRefused
            Nothing may be sent; the wish is gone.
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
            brakes = not isinstance(wish, GoHome) and motion.progress.brakes(now_s)
            if brakes or motion.progress.stands(now_s, SLOW_S):
                raise CommandRefused("the drone comes no nearer to its target")
        if not first and not order.takeoff and self._target_age_s(now_s) > TARGET_AGE_S:
            raise CommandRefused(f"the target is older than {TARGET_AGE_S} s")
        if order.takeoff and not self.on_ground(now_s):
            raise CommandRefused("the vehicle is in the air already")
        command = self._written(order, wish, first=first)
        order.motion = self._begun(order, wish, position, now_s, first=first)
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

    def _written(self, order: _Order, wish: Wish, *, first: bool) -> VehicleCommand:
        match wish:
            case FlyThere():
                values = (wish.latitude_deg, wish.longitude_deg, wish.altitude_amsl_m)
                on_globe = abs(wish.latitude_deg) <= 90.0 and abs(wish.longitude_deg) <= 180.0
                if not (on_globe and isfinite(wish.altitude_amsl_m)):
                    raise CommandRefused(f"{values} is no place")
                above = wish.altitude_amsl_m - order.datum_m
                if not self._lowest_m - 0.5 <= above <= self._highest_m + 0.5:
                    raise CommandRefused(f"{above:.0f} m above home is too low or too high")
                home = self._home
                if home is None or self._farthest_m < distance_m(
                    wish.latitude_deg, wish.longitude_deg, home.latitude_deg, home.longitude_deg
                ):
                    raise CommandRefused(f"farther than {self._farthest_m:.0f} m from home")
                yaw = nan
                if wish.yaw_deg is not None and self.manners.yaw_in_reposition:
                    yaw = radians(wrap_degrees_360(wish.yaw_deg))
                return VehicleCommand(
                    name="DO_REPOSITION",
                    param1=-1.0,
                    param2=1.0 if first else 0.0,
                    param4=yaw,
                    x=round(wish.latitude_deg * 1e7),
                    y=round(wish.longitude_deg * 1e7),
                    z_m=wish.altitude_amsl_m,
                )
            case TurnInPlace():
                if first or self.manners.yaw_in_reposition:
                    raise CommandRefused("this autopilot cannot turn so")
                if not 0.0 < abs(wish.turn_deg) <= 360.0 or not wish.rate_deg_s > 0.0:
                    raise CommandRefused(f"{wish} is no turn")
                return VehicleCommand(
                    name="CONDITION_YAW",
                    param1=abs(wish.turn_deg),
                    param2=wish.rate_deg_s,
                    param3=1.0 if wish.turn_deg > 0.0 else -1.0,
                    param4=1.0,
                )
            case GoHome():
                return VehicleCommand(name="NAV_RETURN_TO_LAUNCH")
            case TakeMode():
                if not (first and self.manners.own_mode_first):
                    raise CommandRefused("this autopilot takes off out of any mode")
                return VehicleCommand(
                    name="DO_SET_MODE", param1=1.0, param2=float(self.manners.own_mode)
                )
            case TakeOff():
                return self._written_takeoff(order, wish, first=first)

    def _written_takeoff(self, order: _Order, wish: TakeOff, *, first: bool) -> VehicleCommand:
        """PX4 takes an altitude above mean sea level, ArduPilot a height above home."""
        above = wish.altitude_amsl_m - order.datum_m
        if first == self.manners.own_mode_first:
            raise CommandRefused("the mode for a take-off is not taken")
        if not self._lowest_m - 0.5 <= above <= self._highest_m + 0.5:
            raise CommandRefused(f"{above:.0f} m above home is too low or too high")
        if not abs(above - wish.height_m) <= 1.0:
            raise CommandRefused(f"{wish} is two heights")
        if self.manners.own_mode_first:
            return VehicleCommand(name="NAV_TAKEOFF", z_m=wish.height_m)
        return VehicleCommand(
            name="NAV_TAKEOFF",
            param1=-1.0,
            param4=nan,
            param5=nan,
            param6=nan,
            z_m=wish.altitude_amsl_m,
        )

    def _begun(
        self, order: _Order, wish: Wish, position: PositionSeen, now_s: float, *, first: bool
    ) -> _Motion:
        """The motion that must be observed from now on."""
        before, left, yaw = order.motion, 0.0, None
        heights = [position.altitude_amsl_m]
        if isinstance(wish, FlyThere):
            left = _distance_m(position, wish)
            heights.append(wish.altitude_amsl_m)
        elif isinstance(wish, TakeOff):
            heights.append(wish.altitude_amsl_m)
        elif before is not None and isinstance(wish, TurnInPlace):
            heights += [before.lowest_m, before.highest_m]
            left = before.left_m
        if position.yaw_deg is not None and not isinstance(wish, GoHome):
            yaw = YawWatch(
                start_s=now_s,
                yaw_deg=position.yaw_deg,
                tolerance_deg=YAW_DEG,
                wanted_deg=self._wanted_yaw_deg(wish),
                turn_deg=wish.turn_deg if isinstance(wish, TurnInPlace) else None,
                rate_deg_s=wish.rate_deg_s if isinstance(wish, TurnInPlace) else 0.0,
                turning_deg_s=self._turning_deg_s,
            )
        return _Motion(
            wish=wish,
            sent_s=now_s,
            first=first,
            before=self._target,
            left_m=left,
            slack_m=ASTRAY_M + stops_within_m(position.speed_m_s),
            lowest_m=min(heights),
            highest_m=max(heights),
            yaw=yaw,
            progress=Progress(),
            start=position,
            top_m=position.altitude_amsl_m,
        )

    def _wanted_yaw_deg(self, wish: Wish) -> float | None:
        """Heading that a command asks for, by an autopilot that takes one."""
        takes = isinstance(wish, FlyThere) and self.manners.yaw_in_reposition
        return wish.yaw_deg if isinstance(wish, FlyThere) and takes else None

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

    @property
    def obeyed(self) -> bool:
        """Whether the last command was seen to be obeyed; another may follow."""
        motion = self._motion
        return motion is not None and motion.obeyed

    @property
    def turned_deg(self) -> float:
        """How far the turn in place is."""
        watch = None if self._motion is None else self._motion.yaw
        return 0.0 if watch is None else watch.turned_deg

    def vehicle_seen(
        self,
        *,
        battery_percent: float | None = None,
        wishes_sent: int = 0,
        wishes_refused: int = 0,
        ground_silent_s: float = 0.0,
    ) -> VehicleSeen | None:
        """What a pilot needs to know; None without a position or a home."""
        position, home = self._position, self._home
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
            turned_deg=self.turned_deg,
            ground_silent_s=ground_silent_s,
        )

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
            self._end("the mode is not told any more", now_s)
        elif now_s - self._heartbeat_s > HEARTBEAT_LOST_S:
            self._end("no heartbeat of the autopilot", now_s)
        elif self._position is None or now_s - self._position.time_s > POSITION_LOST_S:
            self._end("the position is lost", now_s)
        elif order.sticks_us is not None and self._fresh_sticks(now_s, STICKS_LOST_S) is None:
            self._end("the sticks are not seen any more", now_s)
        elif order.switches is not None and order.switches.sure(now_s) is not None:
            self._end(switched(order.switches.sure(now_s) or 0), now_s)
        elif order.motion is not None:
            self._see_time(order, order.motion, now_s)
        elif now_s - order.confirmed_s > BEGINS_WITHIN_S:
            late = "" if self.late is None else f": {self.late}"
            self._end(f"the order was not begun within 10 s{late}", now_s)

    def _see_time(self, order: _Order, motion: _Motion, now_s: float) -> None:
        longest_s = OBEYED_WITHIN_S
        if isinstance(motion.wish, TakeOff):
            longest_s = TAKES_OFF_WITHIN_S
        target_lost_s = self.manners.target_lost_s
        if not motion.obeyed and now_s - motion.sent_s > longest_s:
            self._end("the command was not seen to be obeyed", now_s)
        elif motion.obeyed and motion.progress.stands(now_s):
            self._end("the drone has stopped on its way", now_s)
        elif order.takeoff:
            return  # ArduPilot tells no target then
        elif motion.obeyed and self._target_age_s(now_s) > target_lost_s:
            self._end("the target is not told any more", now_s)

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

    def _see_mode_in_command(self, order: _Order, motion: _Motion, seen: ModeSeen) -> None:
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
        if order.motion is not None:
            self._see_target_in_command(order.motion, seen)
            return
        if order.flown is not None and isinstance(order.flown.wish, FlyThere):
            self._see_target_yaw(order.flown, seen)
        # A vehicle in another mode follows the sticks with its target, or a mission.
        if order.mode == self.manners.own_mode:
            changed = before is not None and not self._same(seen, before)
            if changed or (before is None and _is_elsewhere(seen, order.place)):
                self._end("another has given a target", seen.time_s)

    def _see_target_in_command(self, motion: _Motion, seen: TargetSeen) -> None:
        place = motion.wish
        if isinstance(place, GoHome):
            return  # the mode tells
        if isinstance(place, TakeMode | TakeOff):
            self._see_target_of_takeoff(motion, seen)
            return
        if isinstance(place, TurnInPlace):
            if motion.before is not None and not self._same(seen, motion.before):
                self._end("another has given a target", seen.time_s)
            else:
                motion.obeyed |= self.turned_deg >= 10.0
            return
        if self._same(seen, _target_of(place)):
            self._see_target_yaw(motion, seen)
            # A turn keeps the place: there only the heading shows that it was obeyed.
            watch = motion.target_yaw or motion.yaw
            motion.obeyed |= watch is None or watch.begun
            return
        waits = not motion.obeyed and seen.time_s - motion.sent_s < CHANGES_WITHIN_S
        if waits and self._may_be_before(motion, seen):
            return
        self._end("another has given a target", seen.time_s)

    def _see_target_of_takeoff(self, motion: _Motion, seen: TargetSeen) -> None:
        """None, or above where it stood and at the height asked for, where it tells one."""
        height = seen.altitude_amsl_m
        if seen.latitude_deg is None or height is None:
            return
        here = _distance_m(motion.start, seen) < ASTRAY_M
        waits = isinstance(motion.wish, TakeMode) or (
            not motion.obeyed and seen.time_s - motion.sent_s < CHANGES_WITHIN_S
        )
        before = waits and abs(height - motion.start.altitude_amsl_m) < HEIGHT_OFF_M
        wanted = isinstance(motion.wish, TakeOff) and (
            abs(height - motion.highest_m) <= self.manners.target_m
        )
        if not (here and (before or wanted)):
            self._end("another has given a target", seen.time_s)

    def _same(self, one: TargetSeen, other: TargetSeen) -> bool:
        return _same(one, other, self.manners.target_m)

    def _may_be_before(self, motion: _Motion, seen: TargetSeen) -> bool:
        """Whether it is that of before our command, or what our change of mode makes."""
        if motion.before is not None and self._same(seen, motion.before):
            return True
        position = self._position
        if not motion.first or position is None:
            return False
        return seen.latitude_deg is None or (
            seen.longitude_deg is not None
            and distance_m(
                seen.latitude_deg,
                seen.longitude_deg,
                position.latitude_deg,
                position.longitude_deg,
            )
            < ASTRAY_M + stops_within_m(position.speed_m_s)
        )

    def _see_target_yaw(self, motion: _Motion, seen: TargetSeen) -> None:
        if seen.yaw_deg is None or not self.manners.yaw_in_reposition:
            return
        assert isinstance(motion.wish, FlyThere)
        if motion.target_yaw is None:
            motion.target_yaw = YawWatch(
                start_s=motion.sent_s,
                yaw_deg=seen.yaw_deg,
                tolerance_deg=TARGET_YAW_DEG,
                wanted_deg=self._wanted_yaw_deg(motion.wish),
                turning_deg_s=self._target_turning_deg_s,
                exact=True,
            )
        position = self._position
        here = (None, 0.0) if position is None else _bearing(position, motion.wish)
        fault = motion.target_yaw.fault(seen.time_s, seen.yaw_deg, *here)
        if fault is not None:
            self._end(fault, seen.time_s)

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
            self._see_motion(motion, seen)

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
        moved = distance_m(
            seen.latitude_deg, seen.longitude_deg, before.latitude_deg, before.longitude_deg
        )
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

    def _see_motion(self, motion: _Motion, seen: PositionSeen) -> None:
        if isinstance(motion.wish, GoHome):
            return
        if isinstance(motion.wish, TakeMode | TakeOff):
            self._see_climb(motion, seen)
            return
        place = motion.wish if isinstance(motion.wish, FlyThere) else motion.before
        left = 0.0 if place is None else _distance_m(seen, place)
        motion.left_m = min(motion.left_m, left)
        if left > motion.left_m + motion.slack_m:
            self._end("the drone does not fly to our target", seen.time_s)
        lowest, highest = motion.lowest_m - HEIGHT_OFF_M, motion.highest_m + HEIGHT_OFF_M
        if not lowest <= seen.altitude_amsl_m <= highest:
            self._end("another changes the height", seen.time_s)
        self._see_yaw(motion, seen)
        free = isinstance(motion.wish, FlyThere) and (
            left > stops_within_m(seen.speed_m_s) or seen.speed_m_s < SLOW_M_S
        )
        parts = _left(motion, seen, self._turning_deg_s)
        motion.progress.see(seen.time_s, *parts, free=free)

    def _see_yaw(self, motion: _Motion, seen: PositionSeen) -> None:
        if motion.yaw is None or seen.yaw_deg is None:
            return
        here = _bearing(seen, motion.wish) if isinstance(motion.wish, FlyThere) else (None, 0.0)
        fault = motion.yaw.fault(seen.time_s, seen.yaw_deg, *here)
        if fault is not None:
            self._end(fault, seen.time_s)

    def _see_climb(self, motion: _Motion, seen: PositionSeen) -> None:
        """Straight up, without rest, to its height; in `TakeMode` it stays on the ground."""
        altitude, start = seen.altitude_amsl_m, motion.start
        motion.top_m = max(motion.top_m, altitude)
        rises = isinstance(motion.wish, TakeOff)
        motion.obeyed |= rises and altitude > start.altitude_amsl_m + RISEN_M
        if motion.obeyed and rises:
            left = abs(motion.highest_m - altitude)
            part = Left(now=left, soon=left, least=HIGHER_M, tolerance=AT_TOP_M)
            motion.progress.see(seen.time_s, part)
        moved = distance_m(
            seen.latitude_deg, seen.longitude_deg, start.latitude_deg, start.longitude_deg
        )
        off = HEIGHT_OFF_M if rises else RISEN_M
        if moved > ASTRAY_M:
            self._end("the drone does not climb straight up", seen.time_s)
        elif not motion.top_m - AT_TOP_M <= altitude <= motion.highest_m + off:
            self._end("another changes the height", seen.time_s)
        else:
            self._see_yaw(motion, seen)

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
        moved = distance_m(
            seen.latitude_deg, seen.longitude_deg, before.latitude_deg, before.longitude_deg
        )
        if moved > HOME_MOVED_M:
            self._end("home was moved", seen.time_s)

    def _withdraw(self, why: str) -> None:
        """Offer it no more: a confirmation of it is refused with the reason."""
        assert self._offer is not None
        self._withdrawn, self._offer = (self._offer.nonce, why), None

    def _end(self, reason: str, time_s: float) -> None:
        """Be out, with nothing on offer; the first reason counts."""
        self._offer = None
        if self._order is None:
            return
        self._order, self.reason, self.out_s = None, reason, time_s
        self.counters["orders_ended"] += 1


def _left(motion: _Motion, seen: PositionSeen, turning_deg_s: float) -> tuple[Left, ...]:
    """What is left of a motion in the air."""
    wish, yaw = motion.wish, motion.yaw
    if not isinstance(wish, FlyThere):
        if yaw is None or yaw.turn_deg is None:
            return ()
        left = abs(yaw.turn_deg) - yaw.turned_deg
        least = min(TURNED_DEG, 1.5 * yaw.rate_deg_s)
        return (Left(now=left, soon=left, least=least, tolerance=LOOKS_DEG),)
    bearing, left = _bearing(seen, wish)
    height = abs(seen.altitude_amsl_m - wish.altitude_amsl_m)
    stops = [one * seen.speed_m_s / (2.0 * BRAKES_M_S2) for one in seen.velocity_m_s[:2]]
    along = radians(bearing)
    soon = hypot(left * cos(along) - stops[0], left * sin(along) - stops[1])
    place = Left(now=left, soon=soon, least=NEARER_M, tolerance=ARRIVED_M)
    up = Left(now=height, soon=height, least=HIGHER_M, tolerance=AT_HEIGHT_M)
    if seen.yaw_deg is None:
        return place, up
    asked = None if yaw is None else yaw.wanted_deg
    off = wrap_degrees_180((bearing if asked is None else asked) - seen.yaw_deg)
    stops_deg = turning_deg_s * abs(turning_deg_s) / (2.0 * STOPS_TURNING_DEG_S2)
    heading = Left(
        now=abs(off),
        soon=abs(off - stops_deg),
        least=TURNED_DEG,
        tolerance=LOOKS_ABOUT_DEG if asked is None else LOOKS_DEG,
        needed=asked is not None,
    )
    return place, up, heading


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


def _distance_m(seen: PositionSeen, place: FlyThere | TargetSeen) -> float:
    if place.latitude_deg is None or place.longitude_deg is None:
        return 0.0
    return distance_m(
        seen.latitude_deg, seen.longitude_deg, place.latitude_deg, place.longitude_deg
    )


def _bearing(seen: PositionSeen, place: FlyThere) -> tuple[float, float]:
    """Bearing of a place [deg] and its distance [m], from where the vehicle is."""
    east = wrap_degrees_180(place.longitude_deg - seen.longitude_deg)
    north = place.latitude_deg - seen.latitude_deg
    bearing = degrees(atan2(east * cos(radians(seen.latitude_deg)), north))
    return bearing, _distance_m(seen, place)


def _target_of(place: FlyThere) -> TargetSeen:
    """The target as the autopilot reports it."""
    return TargetSeen(
        time_s=0.0,
        latitude_deg=place.latitude_deg,
        longitude_deg=place.longitude_deg,
        altitude_amsl_m=place.altitude_amsl_m,
        yaw_deg=None,
    )


def _same(one: TargetSeen, other: TargetSeen, within_m: float) -> bool:
    """Whether two targets are one place; the heading is looked at elsewhere."""
    a, b, c, d = one.latitude_deg, one.longitude_deg, other.latitude_deg, other.longitude_deg
    if a is None or b is None or c is None or d is None:
        return a is None and c is None
    heights = one.altitude_amsl_m, other.altitude_amsl_m
    if heights[0] is None or heights[1] is None:
        return False
    return distance_m(a, b, c, d) <= within_m and abs(heights[0] - heights[1]) <= within_m


def _is_elsewhere(target: TargetSeen | None, place: PositionSeen | None) -> bool:
    """Whether a target that is the first one seen is not where the vehicle holds.

    In Guided ArduPilot tells no target before it has one; where it holds, or comes to rest, is
    nobody's order.
    """
    if target is None or target.latitude_deg is None or place is None:
        return False
    height = target.altitude_amsl_m
    climbs = height is not None and abs(height - place.altitude_amsl_m) > HEIGHT_OFF_M
    return climbs or _distance_m(place, target) > ASTRAY_M + stops_within_m(place.speed_m_s)
