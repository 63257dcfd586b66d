"""Send motion commands while the authority permits them, until control ends.

The authority (`uavrt.guidance`) decides from the autopilot's messages whether a command may be
sent. An operator ends control by *Take back*.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from uavrt.config.settings import GuidanceSettings
from uavrt.core.clock import monotonic_s
from uavrt.core.errors import CommandRefused
from uavrt.core.log import get_logger
from uavrt.core.messages import (
    Command,
    FlyThere,
    Manoeuvre,
    MotionOffer,
    StatusText,
    VehicleRequest,
)
from uavrt.drone.processes.motions.stall_watch import StallWatch
from uavrt.guidance.autopilot_behaviour import BEHAVIOURS, AutopilotName
from uavrt.guidance.control.authority import Authority, ControlStage
from uavrt.guidance.control.observed import Observation
from uavrt.guidance.control.offers import PILOT_FLIES
from uavrt.guidance.control.vehicle_commands import CommandWriter
from uavrt.guidance.height_frames import target_amsl_m
from uavrt.guidance.safety import SAFETY
from uavrt.link.mavlink.autopilot.vehicle_messages import command_message
from uavrt.link.mavlink.message import Message
from uavrt.link.tunnel.own_messages.motion_messages import MotionConfirmation

log = get_logger()

Requester = tuple[int, int]
STOP_WITHIN_S = 1.5
"""Longest time in which to send the stop command [s]; afterwards control ends without it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionOutputs:
    """Functions that send commands, reports and texts of motion control."""

    command: Callable[[Message], None]
    """Function that sends a command to the autopilot at once."""
    leaves: Callable[[], bool]
    """Function that returns True if the link can send a command at once."""
    state: Callable[[bytes, Requester | None], None]
    """Function that sends an order's state to one ground station, or to all if None."""
    ask: Callable[[Command], None]
    record: Callable[[str, object], None]
    """Function that sends a record to the guide process, through the supervisor."""
    text: Callable[[StatusText], None]


class MotionControl:
    """Sends the commands of the confirmed order to the autopilot, if `Authority` permits."""

    def __init__(
        self,
        settings: GuidanceSettings,
        outlets: MotionOutputs,
        own_place: Callable[[], tuple[int, int]],
        changed: Callable[[float], None],
    ) -> None:
        self._settings, self._out = settings, outlets
        self._own_place, self._changed = own_place, changed
        self.authority: Authority | None = None
        """Permits or refuses each command; None while the autopilot is unknown."""
        self.standing = ControlStage.OUT
        self.stalls = StallWatch(monotonic_s())
        self.order_id = self.sent = self.refused = 0
        """Id of the last confirmed order; numbers of its commands `sent` and `refused`."""
        self._status_text = ""
        self._late_reported = False

    def use(self, kind: AutopilotName | None) -> None:
        """Set the kind of autopilot. While it is None (unknown), no command can be sent."""
        if kind is None:
            self.authority = None
            return
        settings = self._settings
        writer = CommandWriter(
            behaviour=BEHAVIOURS[kind],
            lowest_m=settings.lowest_m,
            highest_m=settings.highest_m,
            farthest_m=settings.fence_m,
        )
        self.authority = Authority(
            writer,
            may_take_off=settings.may_take_off,
            unwatched_channels=frozenset(settings.unwatched_channels),
        )

    @property
    def text(self) -> str:
        """State of the order for the operator, or why no command is sent."""
        if self.authority is None:
            return "the autopilot's type is unknown"
        if self.authority.standing is ControlStage.OUT:
            return self.authority.reason
        late = self.authority.vehicle.late
        return self._status_text if late is None else f"{late}: no command is sent"

    def watch(self, now_s: float) -> None:
        """If the stage of control has changed, report it at once."""
        standing = ControlStage.OUT if self.authority is None else self.authority.standing
        if standing is not self.standing:
            self.standing = standing
            self._changed(now_s)

    def wake(self, now_s: float, *, turn: bool = False) -> None:
        """End control after a long pause of this process; unread reports may be outdated.

        `turn` is True once in each pass of the main loop.
        """
        pause_s = self.stalls.wake(now_s, turn=turn)
        if pause_s > SAFETY.stall_s:
            self.end(f"the drone's program paused for {pause_s:.0f} s", now_s)

    def observe(self, observations: Iterable[Observation], now_s: float) -> None:
        """Pass the autopilot's reports to `Authority`, which ends control after a takeover."""
        if self.authority is not None:
            for one in observations:
                self.authority.observe(one)
            self.watch(now_s)

    def end(self, reason: str, now_s: float) -> None:
        """End uavrt's control of the drone for a given reason; then no command is sent."""
        if self.authority is not None:
            self.authority.stop(now_s, reason)
            self.watch(now_s)

    def tick(self, now_s: float) -> None:
        """End control if autopilot, guide process or operator has been silent for too long."""
        if self.authority is not None and self.stalls.silence_counts(now_s):
            self.authority.tick(now_s)

    def offer(self, offer: MotionOffer) -> None:
        """Make an order ready for the operator's confirmation; raises `CommandRefused`."""
        authority = self.known
        mode = authority.vehicle.mode_name
        if offer.mode != mode:
            raise CommandRefused(f"the flight mode has changed to {mode}", remedy=PILOT_FLIES)
        authority.offer(offer.order_id, offer.nonce, monotonic_s(), takeoff=offer.takeoff)

    def confirm(self, confirmation: MotionConfirmation, now_s: float) -> None:
        """Take control for the order that the operator confirmed; raises `CommandRefused`."""
        self.known.confirm(
            confirmation.order_id,
            confirmation.nonce,
            now_s,
            sticks_unseen=confirmation.sticks_unseen,
        )
        self.sent = self.refused = 0
        self._late_reported = False
        self._status_text, self.order_id = "confirmed", confirmation.order_id

    @property
    def known(self) -> Authority:
        """Return the `Authority`; raises `CommandRefused` while the autopilot is unknown."""
        if self.authority is None:
            raise CommandRefused(
                "the autopilot has not reported yet", remedy="Check the link to the autopilot"
            )
        return self.authority

    def fly(self, request: VehicleRequest, now_s: float) -> bool:
        """Handle a request of the guide process; True if it is a motion, even a refused one."""
        authority = self.known
        assert request.order_id is not None
        self._status_text = request.status_text or self._status_text
        if request.ends:
            late = authority.vehicle.late
            authority.stop(
                now_s, request.status_text if late is None else f"{request.status_text}: {late}"
            )
            return False
        if request.manoeuvre is None:
            return False
        if not self.stalls.late and self.command(request.order_id, request.manoeuvre, now_s):
            self.sent += 1
        else:
            self.refused += 1
        return True

    def command(
        self, order_id: int, manoeuvre: Manoeuvre, now_s: float, *, stops: bool = False
    ) -> bool:
        """Send a motion command if it is permitted and the link is free; True if sent."""
        authority = self.known
        try:
            if not self._out.leaves():
                raise CommandRefused("the link to the autopilot is busy")
            command = authority.command(order_id, manoeuvre, now_s, stops=stops)
        except CommandRefused as error:
            log.info("motion command not sent", reason=error.message)
            self._report_late(authority)
            return False
        self._out.command(command_message(command, self._own_place()[0]))
        nearest_m = authority.nearest_m
        log.info("command sent", command=command.name, order=order_id, nearest_m=nearest_m)
        return True

    def _report_late(self, authority: Authority) -> None:
        late = authority.vehicle.late
        if late is None or authority.standing is ControlStage.OUT or self._late_reported:
            return
        self._late_reported = True
        self._out.text(StatusText(severity=4, text=f"No command sent: {late}"))


class TakeBack:
    """The operator's *Take back*: stops the drone in place, then ends control."""

    def __init__(self, settings: GuidanceSettings, control: MotionControl) -> None:
        self._settings, self._control = settings, control
        self._by_s = 0.0

    @property
    def under_way(self) -> bool:
        """True from the operator's *Take back* until control has ended."""
        return self._by_s > 0.0

    def begin(self, now_s: float) -> None:
        """Stop the drone if it flies an order; end control and withdraw proposed orders."""
        if self._control.authority is not None:
            self._by_s = self._by_s or now_s + STOP_WITHIN_S
            self.go_on(now_s)

    def go_on(self, now_s: float) -> None:
        """End control once the stop command is sent, at the latest after `STOP_WITHIN_S`."""
        authority = self._control.authority
        if authority is None or not self.under_way:
            return
        if authority.taking_off:
            climbs = ": it continues to climb to its height" if authority.climbs else ""
            authority.stop(now_s, f"stopped by the operator{climbs}")
        if not authority.flies_ours or self._send_stop(authority, now_s):
            authority.stop(now_s)
        elif now_s >= self._by_s:
            authority.stop(now_s, "stopped by the operator: it flies on to its last target")
        if authority.standing is ControlStage.OUT:
            self._by_s = 0.0
        self._control.watch(now_s)

    def _send_stop(self, authority: Authority, now_s: float) -> bool:
        now, order_id = authority.vehicle_seen(), authority.order_id
        if self._control.stalls.late or now is None or order_id is None:
            return False
        height = max(now.altitude_relative_m, self._settings.lowest_m)
        here = FlyThere(
            latitude_deg=now.latitude_deg,
            longitude_deg=now.longitude_deg,
            altitude_amsl_m=target_amsl_m(
                now.altitude_amsl_m,
                now.altitude_relative_m,
                min(height, self._settings.highest_m),
            ),
        )
        return self._control.command(order_id, here, now_s, stops=True)
