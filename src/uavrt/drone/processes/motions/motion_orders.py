"""Motion orders of ground stations: check authentication and permission, propose, confirm."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from uavrt.core.clock import monotonic_s
from uavrt.core.commands import CommandName
from uavrt.core.errors import CommandRefused, TunnelError
from uavrt.core.log import get_logger
from uavrt.core.messages import Command, CommandReply, MotionOffer, MotionRequest
from uavrt.core.newest import Newest
from uavrt.drone.processes.motions.motion_control import (
    MotionControl,
    MotionOutputs,
    Requester,
    TakeBack,
)
from uavrt.drone.processes.motions.motion_reports import MotionReports
from uavrt.drone.processes.motions.reported_autopilot import ReportedAutopilot
from uavrt.link.tunnel.own_messages.motion_messages import (
    MotionConfirmation,
    MotionStop,
    decode_motion,
)
from uavrt.link.tunnel.own_messages.neighbour_messages import decode_neighbour

log = get_logger()

PENDING = 16
SUPERVISOR_TIMEOUT_S = 2.0
"""Longest time in which the supervisor must permit a confirmation [s]; stations do not wait
longer."""
SENDER_S = 10.0
"""Silence after which a ground station no longer counts as the one that reports other drones
[s]. Two such stations at once could assign the same path twice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _PendingRequest:
    name: CommandName
    about: MotionRequest | MotionConfirmation
    requester: Requester
    asked_s: float


class MotionOrders:
    """Handles motion orders of ground stations.

    `next_request_id` numbers the queries to the supervisor.
    """

    def __init__(
        self,
        outlets: MotionOutputs,
        autopilot: ReportedAutopilot,
        control: MotionControl,
        take_back: TakeBack,
        reports: MotionReports,
        next_request_id: Callable[[], int],
    ) -> None:
        self._out, self._autopilot, self._control = outlets, autopilot, control
        self._take_back, self._reports = take_back, reports
        self._next_request_id = next_request_id
        self._pending: Newest[int, _PendingRequest] = Newest(PENDING)
        self._offered_to: Requester | None = None
        self.refused = 0
        """Number of orders that were unauthenticated or invalid."""

    def receive(
        self, payload: bytes, requester: Requester, refusal: str | None, *, sealed: bool
    ) -> None:
        """Handle a station's motion message.

        `refusal` is the reason why the station may not command, or None.
        """
        try:
            message = decode_motion(payload, requester)
        except TunnelError as error:
            self.refused += 1
            log.seldom(self.refused, "motion order refused", reason=error.message)
            return
        if refusal is None and not sealed and not self._autopilot.takes_unsealed:
            refusal = "motion orders must be sealed (authenticated): set a key on both sides"
        if refusal is None and not isinstance(message, MotionStop):
            refusal = self._autopilot.link_fault
        if refusal is not None:
            self.refused += 1
            self._reports.answer("refused", refusal, requester, message.request_id)
        elif isinstance(message, MotionStop):
            self._stop(message, requester)
        elif isinstance(message, MotionConfirmation):
            self._ask("confirm_motion", message, requester, sealed=sealed)
        elif not self._reports.is_repeated(requester, message.request_id):
            self._ask("fly", message, requester, sealed=sealed)

    def _stop(self, stop: MotionStop, requester: Requester) -> None:
        now_s = monotonic_s()
        self._control.wake(now_s)
        self._take_back.begin(now_s)
        self._reports.answer("state", self._control.text, requester, stop.request_id)

    def _ask(
        self,
        name: CommandName,
        about: MotionRequest | MotionConfirmation,
        requester: Requester,
        *,
        sealed: bool,
    ) -> None:
        number = self._next_request_id()
        self._pending[number] = _PendingRequest(
            name=name, about=about, requester=requester, asked_s=monotonic_s()
        )
        self._out.ask(
            Command(
                name=name,
                request_id=number,
                source=f"mavlink {requester[0]}/{requester[1]}",
                sealed=sealed,
            )
        )

    def reply(self, reply: CommandReply) -> None:
        """Handle the supervisor's reply to the query whether a station may command."""
        question = self._pending.get(reply.request_id)
        if question is None or question.name != reply.name:
            return
        del self._pending[reply.request_id]
        about, requester = question.about, question.requester
        waited_s = monotonic_s() - question.asked_s
        if not reply.accepted:
            self._reports.answer("refused", reply.message, requester, about.request_id)
        elif isinstance(about, MotionRequest):
            self._out.record("motion", about)
        elif waited_s > SUPERVISOR_TIMEOUT_S:
            text = f"the confirmation was delayed by {waited_s:.0f} s: request the motion again"
            self._reports.answer("refused", text, requester, about.request_id)
        else:
            self._confirm(about, requester)

    def _confirm(self, confirmation: MotionConfirmation, requester: Requester) -> None:
        now_s, control = monotonic_s(), self._control
        try:
            if control.known and requester != self._offered_to:
                raise CommandRefused(
                    "another station requested this order",
                    remedy="Request the motion from this station",
                )
            control.confirm(confirmation, now_s)
        except CommandRefused as error:
            self._reports.answer("refused", str(error), requester, confirmation.request_id)
            return
        log.info("motion order confirmed", order=confirmation.order_id, source=requester)
        self._reports.confirmed(requester, confirmation.request_id, now_s)

    def offer(self, offer: MotionOffer) -> None:
        """Send a proposed order, or its refusal, to the station that requested it."""
        answer, requester, number = self._reports.answer, offer.requester, offer.request_id
        if offer.refused:
            answer("refused", offer.summary, requester, number)
            return
        try:
            self._control.offer(offer)
        except CommandRefused as error:
            answer("refused", str(error), requester, number)
            return
        self._offered_to = requester
        order_id, nonce = offer.order_id, offer.nonce
        answer("offer", offer.summary, requester, number, order_id=order_id, nonce=nonce)


class NeighbourReports:
    """Passes one ground station's reports about other drones to the guide process."""

    def __init__(
        self,
        outlets: MotionOutputs,
        autopilot: ReportedAutopilot,
        own_place: Callable[[], tuple[int, int]],
    ) -> None:
        self._record, self._autopilot, self._own_place = outlets.record, autopilot, own_place
        self._sender: Requester | None = None
        self._sent_s = -inf
        self.refused = 0

    def receive(
        self, payload: bytes, requester: Requester, refusal: str | None, *, sealed: bool
    ) -> None:
        """Handle a report about another drone.

        `refusal` is the reason why the reporting station may not command, or None.
        """
        now_s = monotonic_s()
        try:
            neighbour = decode_neighbour(payload)
        except TunnelError as error:
            self.refused += 1
            log.seldom(self.refused, "neighbour refused", reason=error.message)
            return
        another = self._sender not in (None, requester) and now_s - self._sent_s < SENDER_S
        proven = refusal is None and (sealed or self._autopilot.takes_unsealed)
        if not proven or another or neighbour.vehicle == self._own_place()[0]:
            self.refused += 1
            return
        self._sender, self._sent_s = requester, now_s
        self._record("neighbour", neighbour)
