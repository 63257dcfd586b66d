"""Send commands and motion orders, and wait for the drone's answer."""

import asyncio
import contextlib
from collections.abc import Callable
from math import ceil
from typing import Any

from uavrt.core.errors import CommandRefused, LinkError
from uavrt.core.units import ns_from_s, s_from_ns
from uavrt.ground.link.protocol import Acknowledged, GroundEvent, GroundProtocol
from uavrt.ground.link.requests.parallel_links import DroneLinks
from uavrt.ground.link.vehicles.drone_contact import DroneContact
from uavrt.link.mavlink.autopilot.waiting import within
from uavrt.link.tunnel.generations.codec import acked_command_of
from uavrt.link.tunnel.own_messages.motion_messages import MotionState, is_confirmation, is_stop
from uavrt.link.tunnel.own_messages.private import MOTION_TYPE

ACK_WAIT_S = 2.0
TRIES = 4
STOP_WAIT_S = 0.4
"""Time after which an unanswered stop is sent again [s]; an answer over a radio takes 0.3 s."""
CONFIRM_TIMEOUT_NS = ns_from_s(1.0)
"""Longest delay from the operator's confirmation to its sending [ns]; later it is not sent."""


class Exchange:
    """Sends one command or order at a time, and waits for its answer."""

    def __init__(
        self,
        protocol: GroundProtocol,
        links: DroneLinks,
        contact: DroneContact,
        clock_ns: Callable[[], int],
        ack_wait_s: float,
    ) -> None:
        self._protocol, self._links, self._contact = protocol, links, contact
        self._clock_ns = clock_ns
        self._ack_wait_s = ack_wait_s
        self._awaited: dict[tuple[int, int] | int, asyncio.Future[Any]] = {}
        """Expected answers by command number and request id, or by a motion's request id."""
        self._busy = asyncio.Lock()

    def receive(self, event: GroundEvent) -> None:
        """Pass an event to the command that waits for it."""
        key: tuple[int, int] | int | None = None
        if isinstance(event, Acknowledged):
            key = event.command, event.request_id
        elif isinstance(event, MotionState):
            key = event.request_id
        if key in self._awaited and not self._awaited[key].done():
            self._awaited[key].set_result(event)

    async def command(self, payload: bytes, payload_type: int, request_id: int) -> Acknowledged:
        """Send a command until it is acknowledged, up to four times with the same bytes."""
        number = acked_command_of(payload)
        assert number is not None

        def send(attempt: int) -> None:
            order = self._links.best()
            message = self._protocol.tunnel_message(payload, payload_type)
            self._links.send(message, order[attempt % len(order)])

        async with self._busy:
            answer = await self._until_answered(
                (number, request_id), send, TRIES, self._ack_wait_s
            )
            if answer is None:
                raise self._contact.unanswered(number, TRIES * self._ack_wait_s)
            ack: Acknowledged
            attempt, ack = answer
            if attempt > 0 and request_id == 0:
                # Answers to the earlier copies may follow; they must not be taken for the
                # answer to the next command of this number: G0 and G1 have no request ids.
                await asyncio.sleep(self._ack_wait_s / 2)
        if not ack.accepted:
            raise CommandRefused(ack.message or f"the drone refused command {number}")
        return ack

    async def motion(self, payload: bytes, request_id: int) -> MotionState:
        """Send a motion order, a confirmation or a stop; return the drone's answer.

        An order and a stop are repeated until they are answered. A confirmation is sent once,
        since its nonce is valid once. A stop does not wait for other exchanges.
        """

        def send(_attempt: int) -> None:
            self._links.send(self._protocol.tunnel_message(payload, MOTION_TYPE))

        wait_s = min(self._ack_wait_s, STOP_WAIT_S) if is_stop(payload) else self._ack_wait_s
        tries = 1 if is_confirmation(payload) else ceil(TRIES * self._ack_wait_s / wait_s)
        self._protocol.orders.append(request_id)
        begun_ns = self._clock_ns()
        async with contextlib.nullcontext() if is_stop(payload) else self._busy:
            waited_ns = self._clock_ns() - begun_ns
            if is_confirmation(payload) and waited_ns > CONFIRM_TIMEOUT_NS:
                raise LinkError(
                    "the confirmation was not sent, because it had to wait "
                    f"{s_from_ns(waited_ns):.0f} s for another command",
                    remedy="Request the motion again",
                )
            answer = await self._until_answered(request_id, send, tries, wait_s)
        if answer is None:
            raise LinkError(
                "the drone did not answer, so it is unknown whether it has accepted the motion",
                remedy="Check `uavrt fly status`; if the drone has a key, give it with "
                "--command-key",
            )
        state: MotionState = answer[1]
        if state.kind == "refused":
            raise CommandRefused(state.text)
        return state

    async def _until_answered(
        self, key: tuple[int, int] | int, send: Callable[[int], None], tries: int, wait_s: float
    ) -> tuple[int, Any] | None:
        """Send a payload until it is answered; return the number of repetitions and the answer,
        or None.
        """
        try:
            for attempt in range(tries):
                awaited = self._awaited[key] = asyncio.get_running_loop().create_future()
                try:
                    send(attempt)
                except LinkError:  # the drone's session comes within a second
                    if self._protocol.drone is None or attempt == tries - 1:
                        raise
                if (answer := await within(wait_s, awaited)) is not None:
                    return attempt, answer
                self._protocol.counters["retries"] += 1
        finally:
            self._awaited.pop(key, None)
        return None
