"""Handlers of what ground stations send, in a table by the message's number inside a seal."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Protocol

from uavrt.config.parameters import PARAMETERS
from uavrt.mavlink.connection import Connection
from uavrt.mavlink.dialect import ParamRequestList
from uavrt.mavlink.discovery import Peer
from uavrt.mavlink.parameters import Requests
from uavrt.messages import Command
from uavrt.processes.ground_stations import GroundStations
from uavrt.processes.motion_desk import MotionDesk
from uavrt.processes.parameter_desk import ParameterDesk
from uavrt.processes.pulse_path import PulsePath
from uavrt.tunnel.exchange import Exchange
from uavrt.tunnel.link_messages import UNSEALED
from uavrt.tunnel.motion import MotionState, encode_state, number_of
from uavrt.tunnel.private import SEALED_TYPE
from uavrt.tunnel.seal import (
    ALIVE_INSIDE,
    CODED_TAG_INSIDE,
    MOTION_INSIDE,
    NEIGHBOUR_INSIDE,
    PARAMETER_INSIDE,
    PLAIN_INSIDE,
    RECEIPT_INSIDE,
)


class _Handler(Protocol):
    """Handler of a ground station's message."""

    def __call__(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        """Handle its payload."""


class GroundPayloads:
    """Passes each message of a ground station to its part of the process.

    `motion`: None where this drone takes no orders.
    `ask`: gives a command to the supervisor.
    """

    def __init__(
        self,
        link: Connection,
        stations: GroundStations,
        exchange: Exchange,
        pulses: PulsePath,
        parameters: ParameterDesk,
        motion: MotionDesk | None,
        *,
        ask: Callable[[Command], None],
    ) -> None:
        self._link, self.stations, self._exchange = link, stations, exchange
        self._pulses, self._parameters, self._motion = pulses, parameters, motion
        self._ask = ask
        self._handlers: dict[int, _Handler] = {
            PLAIN_INSIDE: self._take_command,
            RECEIPT_INSIDE: self._take_receipt,
            PARAMETER_INSIDE: self._take_parameter,
            MOTION_INSIDE: self._take_motion,
            CODED_TAG_INSIDE: partial(self._take_command, coded_tag=True),
            NEIGHBOUR_INSIDE: self._take_neighbour,
            ALIVE_INSIDE: self._take_sign_of_life,
        }

    def receive(self, payload_type: int, payload: bytes, peer: Peer) -> None:
        """Handle a payload by its row in the table of link messages.

        A seal is checked first: however much arrives under the ids of who has the key, what
        that station sends is handled. Allowances are for what has no valid seal.
        """
        if payload_type == SEALED_TYPE:
            opened = self.stations.gate.open(payload, peer.place, self._link.place)
            if opened is not None:
                self._handlers[opened[0]](opened[1], peer, sealed=True)
            return
        row = UNSEALED.get(payload_type)
        if row is None:
            self._exchange.counters["payloads_ignored"] += 1
        elif self.stations.admits(peer, row.answers):
            self._handlers[row.inside](payload, peer, sealed=False)

    def parameter_request(self, message: Requests, peer: Peer) -> None:
        """Handle a request for parameters without a seal."""
        answers = len(PARAMETERS) if isinstance(message, ParamRequestList) else 1
        if self.stations.admits(peer, answers):
            refusal = self.stations.gate.refusal(peer.place, sealed=False)
            self._parameters.receive(message, peer, refusal, self._exchange.next_request_id())

    def _take_command(
        self, payload: bytes, peer: Peer, *, sealed: bool, coded_tag: bool = False
    ) -> None:
        """Handle a command from who may command, or refuse it with the reason."""
        asker, gate = peer.place, self.stations.gate
        self.stations.asked(peer)
        reason = gate.refusal(asker, sealed=sealed)
        if reason is not None:
            refused = self._exchange.refuse(payload, reason, asker)
            self.stations.answer(refused, urgent=not gate.locked)
            return
        result = self._exchange.receive(payload, asker, coded_tag=coded_tag)
        if isinstance(result, Command):
            self._ask(replace(result, sealed=sealed))
        else:
            self.stations.answer(result)

    def _take_receipt(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        if self.stations.gate.locked and not sealed:
            self._exchange.counters["payloads_ignored"] += 1
        else:
            self._pulses.receipt(payload, peer.place)

    def _take_parameter(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        refusal = self.stations.gate.refusal(peer.place, sealed=sealed)
        number = self._exchange.next_request_id()
        self._parameters.receive_sealed(payload, peer, refusal, number)

    def _take_motion(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        """Handle an order of motion, or refuse it with the remedy."""
        asker = peer.place
        self.stations.asked(peer)
        with self.stations.gate.order(payload, asker, sealed=sealed) as refusal:
            if self._motion is not None:
                self._motion.orders.receive(payload, asker, refusal, sealed=sealed)
                return
            text = "this drone takes no orders of motion: see guidance.enabled"
            number = number_of(payload)
            state = MotionState(kind="refused", standing="out", text=text, request_id=number)
            self.stations.answer_motion(encode_state(state), asker)

    def _take_neighbour(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        """Handle the report of another drone; ignored unless this drone takes orders."""
        if self._motion is not None:
            refusal = self.stations.gate.refusal(peer.place, sealed=sealed)
            self._motion.neighbours.receive(payload, peer.place, refusal, sealed=sealed)

    def _take_sign_of_life(self, payload: bytes, peer: Peer, *, sealed: bool) -> None:
        assert sealed
        self.stations.answer_sign_of_life(payload, peer)

    def counters(self) -> dict[str, float]:
        """Counts with names for a health record."""
        return {
            **{name: float(count) for name, count in self._exchange.counters.items()},
            "seals_refused": self.stations.gate.refused,
            "messages_passed_over": self.stations.passed_over,
            "parameters_refused": self._parameters.refused,
        }
