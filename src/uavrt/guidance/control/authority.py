"""Decide if the drone may be commanded; a pilot's action or a fault ends permission; no I/O.

Three states. *Out*: nothing is sent. *Confirmed*: the operator has confirmed an order; it must
begin within 10 s. *In command*: the first command was sent. Any observed change that no command
caused ends the order for good: nothing is repeated or queued. Only the confirmation of a new
order, with an unused nonce, begins again.

Acknowledgements of commands are ignored: PX4 refuses commands that it flies, and accepts some
that it does not. A command counts as obeyed when the vehicle reports its target. `Authority` is
the last stage on the drone before the autopilot, and receives the autopilot's reports first. So
a planner's command in transit during a takeover is refused.
"""

from collections import Counter
from enum import StrEnum

from uavrt.core.errors import CommandRefused
from uavrt.core.messages import Manoeuvre, TakeOff, VehicleStatus
from uavrt.guidance.control.observed import HomeReport, ModeReport, Observation, PositionReport
from uavrt.guidance.control.observed_vehicle import ObservedVehicle, ended_by
from uavrt.guidance.control.offers import Offer, Offers, resting
from uavrt.guidance.control.order_watch import OrderWatch
from uavrt.guidance.control.vehicle_commands import CommandWriter, VehicleCommand
from uavrt.guidance.safety import SAFETY


class ControlStage(StrEnum):
    """Stage of control over the vehicle: none, order confirmed, or commands sent."""

    OUT = "out"
    CONFIRMED = "confirmed"
    IN_COMMAND = "in command"


class Authority:
    """Permits or refuses each command to one vehicle, as the last check before it is sent.

    A take-off is refused unless `may_take_off`. `unwatched_channels` are numbers of RC channels
    without a switch or stick, which are ignored.
    """

    def __init__(
        self,
        writer: CommandWriter,
        *,
        may_take_off: bool = False,
        unwatched_channels: frozenset[int] = frozenset(),
    ) -> None:
        self._writer, self.behaviour = writer, writer.behaviour
        self._may_take_off, self._unwatched = may_take_off, unwatched_channels
        self.reason = "no order was confirmed"
        """Reason why this program may not command the drone, for the operator."""
        self.out_s = 0.0
        self.nearest_m: float | None = None
        """Shortest distance to the target reached on the previous leg [m]; None: no leg."""
        self.counters: Counter[str] = Counter()
        self.vehicle = ObservedVehicle(self.behaviour)
        self._offers = Offers()
        self._order: OrderWatch | None = None

    @property
    def standing(self) -> ControlStage:
        """Present stage: out, order confirmed, or in command."""
        if self._order is None:
            return ControlStage.OUT
        begun = self._order.motion is not None
        return ControlStage.IN_COMMAND if begun else ControlStage.CONFIRMED

    @property
    def order_id(self) -> int | None:
        """Number of the order that is confirmed or being flown; None without one."""
        return None if self._order is None else self._order.offer.order_id

    def offer(self, order_id: int, nonce: int, now_s: float, *, takeoff: bool = False) -> None:
        """Propose an order for the operator's confirmation; it replaces an earlier proposal."""
        mode, place, home = self._check_vehicle(now_s, takeoff=takeoff)
        vehicle = self.vehicle
        rests = self._order is None and vehicle.in_own_mode
        target, heading = (vehicle.target, place) if rests else (None, None)
        offer = Offer(
            order_id=order_id,
            takeoff=takeoff,
            nonce=nonce,
            made_s=now_s,
            mode=mode.mode,
            rests=rests,
            target=target,
            place=place,
            home=home,
            rc=vehicle.rc(now_s, self._unwatched),
            yaw=resting(heading, now_s, vehicle.turning_deg_s, SAFETY.yaw_deg),
            target_yaw=resting(
                target, now_s, vehicle.target_turning_deg_s, SAFETY.target_yaw_deg
            ),
        )
        self._offers.add(offer)

    def confirm(
        self, order_id: int, nonce: int, now_s: float, *, sticks_unseen: bool = False
    ) -> None:
        """Accept the operator's confirmation of the proposed order.

        With `sticks_unseen` the operator accepts that the RC sticks are not monitored. Raises
        `CommandRefused` if the order is not the proposed one, the confirmation is late, or the
        vehicle's state has changed.
        """
        offer = self._offers.confirmed(order_id, nonce, now_s)
        vehicle, before = self.vehicle, self._order
        _, place, home = self._check_vehicle(now_s, takeoff=offer.takeoff)
        offer.check(vehicle)
        if not sticks_unseen and not vehicle.sticks_reported(now_s, SAFETY.sticks_age_s):
            what = "the RC sticks are not received, so a takeover would go unnoticed"
            if vehicle.sticks_reported(now_s, SAFETY.sticks_lost_s):
                what = (
                    f"the RC sticks are reported less often than every {SAFETY.sticks_age_s} s"
                )
            raise CommandRefused(
                what, remedy="Switch the remote control on, or confirm to fly without it"
            )
        self._end("another order was confirmed", now_s)
        self._order = OrderWatch(
            offer=offer,
            confirmed_s=now_s,
            planner_s=now_s,
            place=place,
            home=home,
            target=vehicle.target,
            rc=vehicle.rc(now_s, self._unwatched),
            sticks_unseen=sticks_unseen,
            flown=before.leg if before is not None and vehicle.in_own_mode else None,
        )
        self.reason = ""
        self.counters["orders_confirmed"] += 1

    def _check_vehicle(
        self, now_s: float, *, takeoff: bool
    ) -> tuple[ModeReport, PositionReport, HomeReport]:
        """Return mode, position and home; raise `CommandRefused` if no order is possible."""
        fault = self.fault(now_s, takeoff=takeoff)
        if fault is not None:
            raise CommandRefused(*fault[:1], remedy=fault[1])
        return self.vehicle.known

    def fault(self, now_s: float, *, takeoff: bool = False) -> tuple[str, str] | None:
        """Return why no order can be confirmed now, and the remedy; None if one can."""
        if takeoff and not self._may_take_off:
            remedy = "Take off by hand, or set guidance.may_take_off = true on the drone"
            return "this drone may not take off by itself", remedy
        return self.vehicle.fault(now_s, takeoff=takeoff)

    def stop(self, now_s: float, reason: str = "stopped by the operator") -> None:
        """End the order. The reason, such as the operator's stop, is shown to the operator."""
        self._end(reason, now_s)

    def planner_alive(self, now_s: float) -> None:
        """Note that the guide process, which plans motions, is alive; its silence ends an
        order.
        """
        if self._order is not None:
            self._order.planner_alive(now_s)

    def command(
        self, order_id: int, manoeuvre: Manoeuvre, now_s: float, *, stops: bool = False
    ) -> VehicleCommand:
        """Check a requested motion; return its command, which must be sent now and only once.

        With `stops`, the command stops the drone in its present mode; it may be an order's
        first while the previous order is still flown. `CommandRefused` means that nothing may
        be sent, and that the request is dropped.
        """
        self.tick(now_s)
        order = self._order
        if order is None or order_id != order.offer.order_id:
            raise CommandRefused(
                f"this order is not being flown: {self.reason or 'another order is flown'}"
            )
        first = order.motion is None and not stops
        order.check(manoeuvre, self.vehicle, now_s, first=first, stops=stops)
        command = self._writer.command(
            manoeuvre, first=first, datum_m=order.datum_m, home=self.vehicle.home
        )
        self.nearest_m = order.nearest_m
        order.sent(manoeuvre, self.vehicle, now_s, first=first)
        self.counters["commands_sent"] += 1
        return command

    @property
    def taking_off(self) -> bool:
        """True while a take-off order is flown; the drone must not be stopped meanwhile."""
        order = self._order
        return order is not None and order.offer.takeoff and order.motion is not None

    @property
    def climbs(self) -> bool:
        """True while the drone climbs by the take-off command, until the next command."""
        motion = None if self._order is None else self._order.motion
        return motion is not None and isinstance(motion.manoeuvre, TakeOff)

    @property
    def flies_ours(self) -> bool:
        """True while the vehicle flies a command of the present or of the previous order."""
        return self._order is not None and self._order.leg is not None

    def vehicle_seen(
        self,
        *,
        battery_percent: float | None = None,
        requests_sent: int = 0,
        requests_refused: int = 0,
        ground_silent_s: float = 0.0,
    ) -> VehicleStatus | None:
        """Return the vehicle's state for `OrderExecution`; None without position or home."""
        position, home, order = self.vehicle.position, self.vehicle.home, self._order
        if position is None or home is None:
            return None
        above = position.altitude_relative_m
        if order is not None:
            above = position.altitude_amsl_m - order.datum_m
        motion = None if order is None else order.motion
        return VehicleStatus(
            latitude_deg=position.latitude_deg,
            longitude_deg=position.longitude_deg,
            altitude_amsl_m=position.altitude_amsl_m,
            altitude_relative_m=above,
            speed_m_s=position.speed_m_s,
            yaw_deg=position.yaw_deg,
            home=(home.latitude_deg, home.longitude_deg),
            battery_percent=battery_percent,
            obeyed=self.obeyed,
            requests_sent=requests_sent,
            requests_refused=requests_refused,
            turned_deg=0.0 if motion is None else motion.turned_deg,
            ground_silent_s=ground_silent_s,
            settling=motion is not None and motion.not_settled_yet,
            heading_rests=self.vehicle.heading_rests,
        )

    @property
    def obeyed(self) -> bool:
        """True if the reports show that the autopilot follows the last command."""
        motion = None if self._order is None else self._order.motion
        return motion is not None and motion.obeyed

    def observe(self, seen: Observation) -> None:
        """Handle a report of the vehicle. A change that no command caused ends the order."""
        restarted = self.vehicle.restarted(seen)
        if restarted is not None:
            self._end(restarted, seen.time_s)
            self.vehicle = ObservedVehicle(self.behaviour, self.vehicle.failsafe)
        if not self.vehicle.store(seen):
            return
        self._offers.observe(seen, self.vehicle)
        self._end(ended_by(seen), seen.time_s)
        if self._order is not None:
            self._end(self._order.observe(seen, self.vehicle), seen.time_s)

    def tick(self, now_s: float) -> None:
        """End the order if it has timed out, or if required reports are missing."""
        if self._order is not None:
            self._end(self._order.overdue(self.vehicle, now_s), now_s)

    def _end(self, reason: str | None, time_s: float) -> None:
        """End the order and withdraw any proposed one, unless `reason` is None."""
        if reason is None:
            return
        self._offers.clear()
        if self._order is None:
            return
        self.nearest_m = self._order.nearest_m
        self._order, self.reason, self.out_s = None, reason, time_s
        self.counters["orders_ended"] += 1
