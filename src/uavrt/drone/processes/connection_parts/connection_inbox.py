"""Handlers for everything that the connection process receives, in two tables.

The message type selects the handler of a ground station's message. For a sealed (authenticated)
message, this is the type of its content. The class of a record selects the handler of the
supervisor's records.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

from uavrt.config.parameters import PARAMETERS
from uavrt.config.settings import Settings
from uavrt.core.commands import SystemState
from uavrt.core.errors import TunnelError
from uavrt.core.log import get_logger
from uavrt.core.messages import (
    Beep,
    Command,
    CommandReply,
    Course,
    FlightInfo,
    LiveBearing,
    MotionOffer,
    Operation,
    Pulse,
    PulsePose,
    Recorded,
    SearchReport,
    StatusText,
    SystemStatus,
    VehicleRequest,
)
from uavrt.drone.processes.connection_parts.ground_stations import GroundStations
from uavrt.drone.processes.connection_parts.ground_status import GroundStatus
from uavrt.drone.processes.connection_parts.parameter_handler import ParameterHandler
from uavrt.drone.processes.connection_parts.pose_collector import PoseCollector
from uavrt.drone.processes.connection_parts.pulse_path import PulsePath
from uavrt.drone.processes.motions.motion_handler import MotionHandler
from uavrt.link.mavlink.dialect import ParamRequestList
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.mavlink_connection import Connection
from uavrt.link.mavlink.sending.pacing import Priority
from uavrt.link.mavlink.services.parameter_service import Requests
from uavrt.link.tunnel.drone_exchange import Exchange
from uavrt.link.tunnel.own_messages.link_messages import UNSEALED
from uavrt.link.tunnel.own_messages.live_bearing import BEARING_TYPE, encode_bearing
from uavrt.link.tunnel.own_messages.motion_messages import MotionState, encode_state, number_of
from uavrt.link.tunnel.own_messages.neighbour_messages import encode_course
from uavrt.link.tunnel.own_messages.private import COURSE_TYPE, SEALED_TYPE
from uavrt.link.tunnel.own_messages.seal import (
    ALIVE_INSIDE,
    CODED_TAG_INSIDE,
    MOTION_INSIDE,
    NEIGHBOUR_INSIDE,
    PARAMETER_INSIDE,
    PLAIN_INSIDE,
    RECEIPT_INSIDE,
)

log = get_logger()


class _Handler(Protocol):
    """Function that handles one type of message from a ground station."""

    def __call__(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        """Handle a payload. `sealed` is True if its authentication code was valid."""


class ConnectionInbox:
    """Calls the handler of each message and record; unknown types are ignored."""

    def __init__(
        self,
        link: Connection,
        stations: GroundStations,
        exchange: Exchange,
        pulses: PulsePath,
        poses: PoseCollector,
        status: GroundStatus,
        parameters: ParameterHandler,
        motion: MotionHandler | None,
        *,
        ask: Callable[[Command], None],
        text: Callable[[StatusText], None],
        linked: bool,
    ) -> None:
        self._link, self.stations, self._exchange = link, stations, exchange
        self._poses, self._pulses, self._status = poses, pulses, status
        self._parameters, self._motion, self._ask = parameters, motion, ask
        self.system: SystemStatus | None = None
        """Latest status of the system; None until the supervisor sends it, so that a restarted
        connection does not report an idle drone."""
        self._payloads: dict[int, _Handler] = {
            PLAIN_INSIDE: self._receive_command,
            RECEIPT_INSIDE: self._receive_receipt,
            PARAMETER_INSIDE: self._receive_parameter,
            MOTION_INSIDE: self._receive_motion,
            CODED_TAG_INSIDE: partial(self._receive_command, coded_tag=True),
            NEIGHBOUR_INSIDE: self._receive_neighbour,
            ALIVE_INSIDE: self._receive_keepalive,
        }
        self._records: dict[type, Callable[[Any], None]] = {
            Pulse: pulses.add,
            PulsePose: pulses.pose_reconstructed,
            Recorded: pulses.recorded,
            FlightInfo: pulses.begin_flight,
            Beep: status.beep,
            Operation: lambda record: stations.answer(exchange.operations.progress(record)),
            CommandReply: self._reply,
            Settings: self._changed,
            StatusText: text,
            SystemStatus: self._receive_system,
        }
        if motion is not None:
            self._records |= {
                MotionOffer: motion.orders.offer,
                VehicleRequest: motion.handle_request,
            }
        if linked:
            self._records |= {
                LiveBearing: self._send_bearing,
                Course: self._send_course,
                SearchReport: pulses.searched,
            }

    def payload(self, payload_type: int, payload: bytes, peer: Peer) -> None:
        """Open a sealed (authenticated) payload, then call the handler of its type.

        Rate limits apply only to unsealed messages, so a flood of them cannot block sealed
        ones.
        """
        if payload_type == SEALED_TYPE:
            opened = self.stations.gate.open(payload, peer.place, self._link.place)
            if opened is not None:
                self._payloads[opened[0]](opened[1], peer, sealed=True)
            return
        row = UNSEALED.get(payload_type)
        if row is None:
            self._exchange.counters["payloads_ignored"] += 1
        elif self.stations.admits(peer, row.answers):
            self._payloads[row.inside](payload, peer, sealed=False)

    def parameter_request(self, message: Requests, peer: Peer) -> None:
        """Handle an unauthenticated request to read or set parameters."""
        answers = len(PARAMETERS) if isinstance(message, ParamRequestList) else 1
        if self.stations.admits(peer, answers):
            refusal = self.stations.gate.refusal(peer.place, sealed=False)
            self._parameters.receive(message, peer, refusal, self._exchange.next_request_id())

    def _receive_command(
        self, payload: bytes, peer: Peer, *, sealed: bool, coded_tag: bool = False
    ) -> None:
        requester, gate = peer.place, self.stations.gate
        self.stations.asked(peer)
        reason = gate.refusal(requester, sealed=sealed)
        if reason is not None:
            refused = self._exchange.refuse(payload, reason, requester)
            self.stations.answer(refused, urgent=not gate.locked)
            return
        result = self._exchange.receive(payload, requester, coded_tag=coded_tag)
        if isinstance(result, Command):
            self._ask(replace(result, sealed=sealed))
        else:
            self.stations.answer(result)

    def _receive_receipt(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        if self.stations.gate.locked and not sealed:
            self._exchange.counters["payloads_ignored"] += 1
        else:
            self._pulses.receipt(payload, peer.place)

    def _receive_parameter(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        refusal = self.stations.gate.refusal(peer.place, sealed=sealed)
        number = self._exchange.next_request_id()
        self._parameters.receive_sealed(payload, peer, refusal, number)

    def _receive_motion(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        requester = peer.place
        self.stations.asked(peer)
        with self.stations.gate.order(payload, requester, sealed=sealed) as refusal:
            if self._motion is not None:
                self._motion.orders.receive(payload, requester, refusal, sealed=sealed)
                return
            text = "this drone accepts no motion orders: see guidance.enabled"
            number = number_of(payload)
            state = MotionState(kind="refused", standing="out", text=text, request_id=number)
            self.stations.answer_motion(encode_state(state), requester)

    def _receive_neighbour(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        if self._motion is not None:
            refusal = self.stations.gate.refusal(peer.place, sealed=sealed)
            self._motion.neighbours.receive(payload, peer.place, refusal, sealed=sealed)

    def _receive_keepalive(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        assert sealed
        self.stations.answer_keepalive(payload, peer)

    def record(self, topic: str, record: Any) -> None:
        """Handle a record from the supervisor."""
        if topic == "corrected_tags":
            self._status.clear_beeps()
        elif (handler := self._records.get(type(record))) is not None:
            handler(record)

    def _reply(self, reply: CommandReply) -> None:
        answer = self._exchange.reply(reply)
        if answer is not None and reply.accepted:
            self.stations.accepted(answer.requester)
        self.stations.answer(answer)
        self._parameters.reply(reply)
        if self._motion is not None:
            self._motion.orders.reply(reply)

    def _changed(self, settings: Settings) -> None:
        self._parameters.changed(settings)
        self._status.radio_set(settings.radio)
        self._poses.use(settings.pose)

    def _receive_system(self, status: SystemStatus) -> None:
        self.system = status
        self.stations.commander(status.commander)
        self._parameters.running(status.state is SystemState.DETECTING and not status.ending)
        self._status.tags(len(status.tags))

    def _send_bearing(self, bearing: LiveBearing) -> None:
        self._link.tunnel.send_tunnel(
            encode_bearing(bearing), Priority.STATUS, payload_type=BEARING_TYPE
        )

    def _send_course(self, course: Course) -> None:
        try:
            payload = encode_course(course)
        except TunnelError as error:
            log.warning(
                "cannot send this drone's course to the other drones", reason=error.message
            )
            return
        self._link.tunnel.send_tunnel(payload, Priority.STATUS, payload_type=COURSE_TYPE)

    def counters(self) -> dict[str, float]:
        """Counts of ignored and refused messages, for the health report."""
        return {
            **{name: float(count) for name, count in self._exchange.counters.items()},
            "seals_refused": self.stations.gate.refused,
            "messages_passed_over": self.stations.dropped,
            "parameters_refused": self._parameters.refused,
        }
