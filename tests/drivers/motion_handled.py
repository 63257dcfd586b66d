"""A drone whose telemetry, orders and commands go through the motion handler at the link."""

import random
from collections import deque
from typing import Any

from flown import Flown, nonce_of
from virtual_time import follow

from uavrt.config.settings import GuidanceSettings
from uavrt.core.errors import CommandRefused
from uavrt.core.messages import (
    Command,
    CommandReply,
    MotionOffer,
    VehicleReport,
    VehicleRequest,
)
from uavrt.drone.processes.motions.motion_control import MotionOutputs
from uavrt.drone.processes.motions.motion_handler import MotionHandler
from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.operator_orders import Order, VehicleNow
from uavrt.guidance.vehicle_reports import now_of
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.links.address import parse_address
from uavrt.link.tunnel.own_messages.motion_messages import (
    MotionConfirmation,
    MotionState,
    MotionStop,
    decode_state,
    encode_confirmation,
    encode_stop,
)
from uavrt.simulation.vehicle.airframe import Flavour

STATION = (254, 190)
SLOWEST_STEPS = 3
"""That the hub needs from guide to motion handler."""


class MotionHandled(Flown):
    """Its guide wishes by records that take some time, as through the hub.

    The clock of the test shows the time of the drone that was made last.
    """

    def __init__(self, flavour: Flavour, **values: Any) -> None:
        self.time_s = 100.0
        follow(lambda: self.time_s)
        self._report: VehicleReport | None = None
        self._is_new = False
        self._wishes: deque[tuple[int, VehicleRequest]] = deque()
        self.states: list[MotionState] = []
        self.stop_commands: list[Any] = []
        self._stopping = False
        self.leaves = True
        self.sent_when_out = 0
        self._asked: list[Command] = []
        self._numbers = iter(range(1, 1_000_000))
        self._hub = random.Random(str(values.get("phase_s")))
        limits = values.get("limits")
        self.handler = MotionHandler(
            GuidanceSettings(
                enabled=True,
                battery_wh=120.0,
                may_take_off=True,
                fence_m=500.0 if limits is None else limits.fence_m,
            ),
            MotionOutputs(
                command=self._command,
                leaves=lambda: self.leaves,
                state=lambda payload, _: self.states.append(decode_state(payload)),
                ask=self._asked.append,
                record=self._take,
                text=lambda _: None,
            ),
            own_place=lambda: (1, 191),
            next_request_id=lambda: next(self._numbers),
            autopilot_link=parse_address("serial:///dev/ttyAMA0:921600"),
        )
        super().__init__(flavour, **values)

    def _command(self, message: Any) -> None:
        if not isinstance(message, dialect.CommandInt | dialect.CommandLong):
            return
        if message.command == dialect.MavCmd.REQUEST_MESSAGE:
            return
        self.commands.append((self.time_s, message))
        self.sent_when_out += self.authority.standing is ControlStage.OUT
        if self._stopping:
            self.stop_commands.append(message)
        self.vehicle.command(message)

    def _take(self, _: str, record: object) -> None:
        if isinstance(record, VehicleReport):
            self._report, self._is_new = record, True

    def control(self) -> None:
        for message in self.through(self.time_s, self.telemetry()):
            self.handler.vehicle(message)
        self._stopping = True  # the motion handler itself commands nothing else
        self.handler.tick({STATION: self.ground_silent_s})
        self._stopping = False
        self.authority = self.handler.control.authority or self.authority
        while self._wishes and self._wishes[0][0] <= self.steps:
            self.handler.handle_request(self._wishes.popleft()[1])
        if self.alive and self._is_new:
            self._is_new = False
            self.request_motion()

    def request_motion(self) -> None:
        """As the guide does with each report."""
        report, execution = self._report, self.execution
        assert report is not None
        if report.order_id is None:
            return
        record = VehicleRequest(order_id=report.order_id)
        now = self.now()
        if (
            execution is not None
            and now is not None
            and report.order_id == execution.order.order_id
        ):
            manoeuvre = execution.next(now)
            if manoeuvre is not None:
                record = VehicleRequest(order_id=execution.order.order_id, manoeuvre=manoeuvre)
            elif execution.ended is not None:
                record = VehicleRequest(
                    order_id=report.order_id, ends=True, status_text=execution.ended
                )
        due = self.steps + self._hub.randint(0, SLOWEST_STEPS)
        before = self._wishes[-1][0] if self._wishes else 0
        self._wishes.append((max(due, before), record))

    def now(self) -> VehicleNow | None:
        return None if self._report is None else now_of(self._report, self.time_s)

    def confirm(self, order: Order) -> None:
        self.offer(order.order_id, takeoff=order.action == "takeoff")
        self._raise_if_refused()
        self.say_yes(order.order_id)
        self._raise_if_refused()

    def _raise_if_refused(self) -> None:
        if self.states[-1].kind == "refused":
            raise CommandRefused(self.states[-1].text)

    def offer(self, order_id: int, *, takeoff: bool = False) -> None:
        self.handler.orders.offer(
            MotionOffer(
                request_id=next(self._numbers),
                requester=STATION,
                order_id=order_id,
                nonce=nonce_of(order_id),
                summary="",
                mode=self.authority.vehicle.mode_name,
                takeoff=takeoff,
            )
        )

    def say_yes(self, order_id: int) -> None:
        """Confirm, and let the supervisor agree."""
        confirmation = MotionConfirmation(
            request_id=next(self._numbers),
            order_id=order_id,
            nonce=nonce_of(order_id),
            sticks_unseen=not self.channels,
        )
        self.handler.orders.receive(
            encode_confirmation(confirmation), STATION, None, sealed=True
        )
        asked, self._asked[:] = list(self._asked), []
        for one in asked:
            self.handler.orders.reply(
                CommandReply(
                    request_id=one.request_id, name=one.name, accepted=True, message=""
                )
            )

    def stop(self) -> None:
        """The operator takes it back."""
        self._stopping = True
        stop = encode_stop(MotionStop(request_id=next(self._numbers)))
        self.handler.orders.receive(stop, STATION, None, sealed=True)
        self._stopping = False
