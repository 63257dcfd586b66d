"""Fly an order step by step: request each motion when the previous one is done; no I/O.

`uavrt.guidance.control.authority` permits or refuses each request. A refused request is
dropped; the next one is chosen from the vehicle's state at that time.
"""

from collections.abc import Sequence
from math import atan2, cos, degrees, radians

from uavrt.core.earth.geodesy import distance_m
from uavrt.core.messages import FlyThere, GoHome, Manoeuvre, TakeMode, TakeOff, TurnInPlace
from uavrt.core.units import wrap_degrees_180
from uavrt.guidance.height_frames import target_amsl_m
from uavrt.guidance.operator_orders import Limits, Order, Place, VehicleNow
from uavrt.guidance.plans import (
    Climb,
    Go,
    Home,
    Plan,
    SetTakeoffMode,
    Step,
    Turn,
    map_fault,
    must_return,
)
from uavrt.guidance.safety import SAFETY, stops_within_m


class _BatteryWatch:
    """Checks every `SAFETY.battery_s` seconds whether the battery requires a return."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._checked_s = 0.0
        self._reported = False

    def due(self, now: VehicleNow) -> bool:
        """True if it is time for the next battery check, which then counts as made."""
        due = now.time_s >= self._checked_s + SAFETY.battery_s
        self._checked_s = now.time_s if due else self._checked_s
        return due

    def reason(self, now: VehicleNow) -> str | None:
        """Return why the drone must return: charge, wind, or no battery reports; else None."""
        if now.battery_percent is not None:
            self._reported = True
        elif self._reported and self._limits.battery_wh is not None:
            return "the battery is no longer reported"
        return must_return(now, self._limits)


def _waits(step: Step, now: VehicleNow) -> bool:
    """True if the drone must first come to rest, or stop turning, before this step begins."""
    if isinstance(step, Turn) and not now.heading_rests:
        return True
    return now.settling and not isinstance(step, Home)


class OrderExecution:
    """Flies the steps of one order. With `waits`, further steps may follow (`redirect`)."""

    def __init__(
        self, order: Order, plan: Plan, limits: Limits, *, waits: bool = False
    ) -> None:
        self.order, self.plan = order, plan
        self._waits = waits
        self._limits = limits
        self._steps: list[Step] = list(plan.steps)
        self._number = 0
        self._requested = 0
        self._requested_step: Step | None = None
        self._there_s: float | None = None
        self._sent_for_step = 0
        self._holding: Go | None = None
        self._holding_s = 0.0
        self.returning = self._flies_home = False
        """`returning`: True if a return was decided here, such as for a low battery."""
        self.shared = False
        """True if other drones search too. The drone then flies home at its own height, because
        the autopilot's return may climb into another drone's height."""
        self._awaits_operator = False
        """True while the operator must decide; the drone then only hovers."""
        self._battery = _BatteryWatch(limits)
        self._sent = self._refused_before = 0
        self._failed: str | None = None
        """Reason for cutting the order short; None if it is flown as planned."""
        self.ended: str | None = None
        """Reason for the order's end; None while it continues."""
        self.status_text = ""
        """Text on the present action and its reason, for the operator."""

    @property
    def progress(self) -> str:
        """Present step and number of steps as text: ``step 2 of 5``."""
        return f"step {min(self._number + 1, len(self._steps))} of {len(self._steps)}"

    @property
    def idle(self) -> bool:
        """True if all steps are done and the order is waiting for further ones."""
        return self._waits and self._number >= len(self._steps)

    def redirect(self, steps: Sequence[Step], now: VehicleNow) -> None:
        """Replace the remaining steps, after a stop if the turn could look like a takeover."""
        if self._flies_home:
            return
        if self.shared and isinstance(steps[0], Home):
            steps = (self._over_home(now), *steps)
        first: list[Step] = []
        if not self.idle and self._turns_off(steps[0], now):
            first = [self._stop_at(now)]
        self._steps, self._number = [*first, *steps], 0
        self._requested_step = None

    def give_up(self, reason: str) -> None:
        """End the order early and fly home, because the battery is not monitored in a hover.

        An order that has not begun, or a take-off, ends without a command.
        """
        self._failed = self._failed or reason

    def _turns_off(self, step: Step, now: VehicleNow) -> bool:
        """True if the bend towards `step` could look like another station's command."""
        before = self._steps[self._number]
        if not isinstance(before, Go) or now.speed_m_s < SAFETY.free_speed_m_s:
            return False
        if not isinstance(step, Go):
            return True
        here = (now.latitude_deg, now.longitude_deg)
        ways = [_course_deg(here, one.place) for one in (before, step)]
        near = min(distance_m(*here, *one.place) for one in (before, step)) < SAFETY.bend_from_m
        return near or abs(wrap_degrees_180(ways[1] - ways[0])) > SAFETY.bend_deg

    def next(self, now: VehicleNow) -> Manoeuvre | None:
        """Return the motion to request now; None if there is none."""
        if self.ended is not None:
            return None
        if now.order_id != self.order.order_id:
            self.ended = "the order has ended"
            return None
        if now.requests_sent > self._sent:
            self._sent, self._refused_before = now.requests_sent, now.requests_refused
        if now.requests_refused - self._refused_before > SAFETY.refusals:
            self._refused_before = now.requests_refused
            if self.returning:
                self.ended = "the commands are refused"
                return None
            self.give_up("the commands are refused")
        if self._failed is not None and (not now.began or self.order.action == "takeoff"):
            self.ended = self._failed
            return None
        if now.requests_sent + now.requests_refused < self._requested or (
            now.began and not now.obeyed
        ):
            return None  # the last one is on its way, or is not seen to be obeyed yet
        if now.requests_sent < self._sent_for_step:
            self._requested_step = None  # it was refused
        step = self._due(now)
        return None if step is None or _waits(step, now) else self._request_step(step, now)

    def _due(self, now: VehicleNow) -> Step | None:
        """Return the step to request now; None if no step is due.

        A return or a hold comes before the order's other steps.
        """
        urgent = self._urgent(now)
        if isinstance(urgent, Home) and self.shared:
            self._steps, self._number, self._holding = [self._over_home(now), urgent], 0, None
            self._flies_home = True
        elif urgent is not None:
            return urgent
        if self._flies_home and not isinstance(self._requested_step, Home):
            return self._next_step(now)
        if self.returning or self._holding is not None:
            waiting = Home() if self._holding is None or self.returning else self._holding
            return None if self._requested_step in (waiting, Home()) else waiting
        return self._next_step(now)

    def _next_step(self, now: VehicleNow) -> Step | None:
        if self.idle:
            return None
        step = self._steps[self._number]
        if self._requested_step is not step:
            return step
        last = self._number + 1 == len(self._steps)
        if not self._done(step, now) or (now.settling and not last):
            return None
        self._number += 1
        if last:
            self.ended = None if self._waits else "done"
            return None
        return self._steps[self._number]

    def _request_step(self, step: Step, now: VehicleNow) -> Manoeuvre:
        self._requested += 1
        self._sent_for_step = now.requests_sent + 1
        self._requested_step, self._there_s = step, None
        match step:
            case Go():
                amsl = target_amsl_m(
                    now.altitude_amsl_m, now.altitude_relative_m, step.height_m
                )
                return FlyThere(
                    latitude_deg=step.place[0],
                    longitude_deg=step.place[1],
                    altitude_amsl_m=amsl,
                    yaw_deg=step.yaw_deg,
                )
            case Turn():
                return TurnInPlace(turn_deg=step.turn_deg, rate_deg_s=step.rate_deg_s)
            case Home():
                self.returning = True  # the vehicle's mode will end the order
                return GoHome()
            case SetTakeoffMode():
                return TakeMode()
            case Climb():
                amsl, relative = now.altitude_amsl_m, now.altitude_relative_m
                return TakeOff(
                    height_m=step.height_m,
                    altitude_amsl_m=target_amsl_m(amsl, relative, step.height_m),
                )

    def _done(self, step: Step, now: VehicleNow) -> bool:
        match step:
            case Turn():
                return now.turned_deg >= abs(step.turn_deg) - SAFETY.at_yaw_deg
            case Home() | SetTakeoffMode():
                return True
            case Climb():
                return abs(now.altitude_relative_m - step.height_m) < SAFETY.at_height_m
        there = (
            distance_m(now.latitude_deg, now.longitude_deg, *step.place) < SAFETY.arrived_m
            and now.speed_m_s < SAFETY.standing_speed_m_s
            and abs(now.altitude_relative_m - step.height_m) < SAFETY.at_height_m
        )
        if there and step.yaw_deg is not None:
            yaw = now.yaw_deg
            there = (
                yaw is not None
                and abs(wrap_degrees_180(step.yaw_deg - yaw)) < SAFETY.at_yaw_deg
            )
        if not there:
            self._there_s = None
            return False
        if self._there_s is None:
            self._there_s = now.time_s
        return now.time_s - self._there_s >= step.stay_s

    def _urgent(self, now: VehicleNow) -> Step | None:
        """Return the step that a low battery or lost link requires; None if neither."""
        limits = self._limits
        if not now.began or self.returning or self.order.action == "takeoff":
            return None  # a take-off ends where it hovers, and says no more
        if self._failed is not None:
            return self._home(self._failed)
        if self._battery.due(now):
            reason = self._battery.reason(now)
            if reason is not None:
                return self._home(reason)
            apart = map_fault(now, limits)
            if apart is not None and not self._awaits_operator:
                self._awaits_operator, self._holding = True, self._stop_at(now)
                self.status_text = f"{apart}: holding, confirm another order"
        if self._awaits_operator:
            return None
        if now.ground_silent_s < limits.link_lost_s or limits.link_lost == "go on":
            if self._holding is not None:
                self._holding, self._requested_step = None, None  # and on with the step
                self.status_text = "contact with the ground station is back"
            return None
        if limits.link_lost == "return":
            return self._home("the link to the ground is lost")
        if self._holding is None:
            self._holding_s = now.time_s
            self.status_text = "the link to the ground is lost: holding"
            self._holding = self._stop_at(now)
        elif now.time_s - self._holding_s >= limits.return_after_s:
            return self._home("the link to the ground stays lost")
        return None

    def _stop_at(self, now: VehicleNow) -> Go:
        """Return the step to the point on the present path where the drone can stop."""
        step = None if self.idle else self._steps[self._number]
        place = (now.latitude_deg, now.longitude_deg)
        if isinstance(step, Go):
            place = stopping_place(now, step.place)
        height = max(now.altitude_relative_m, self._limits.lowest_m)
        return Go(place=place, height_m=min(height, self._limits.highest_m))

    def _over_home(self, now: VehicleNow) -> Go:
        """Return the step to the point above home, at this drone's own height in a search."""
        height = self.order.height_m
        height = now.altitude_relative_m if height is None else height
        height = max(height, self._limits.lowest_m)
        return Go(place=now.home, height_m=min(height, self._limits.highest_m))

    def _home(self, reason: str) -> Step:
        self.status_text, self.returning = f"returning: {reason}", True
        return Home()


def stopping_place(now: VehicleNow, goal: Place) -> Place:
    """Return the point on the way to `goal` where the drone can stop without turning back."""
    here = (now.latitude_deg, now.longitude_deg)
    left = distance_m(*here, *goal)
    share = min(1.0, stops_within_m(now.speed_m_s) / max(left, 0.1))
    east = wrap_degrees_180(goal[1] - here[1])
    return (here[0] + share * (goal[0] - here[0]), here[1] + share * east)


def _course_deg(here: Place, there: Place) -> float:
    """Return the direction from one position to a near one, clockwise from north [°]."""
    east = wrap_degrees_180(there[1] - here[1]) * cos(radians(here[0]))
    return degrees(atan2(east, there[0] - here[0]))
