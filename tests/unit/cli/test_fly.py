"""What `uavrt fly` takes, and how it follows its own order and stops what it cannot follow."""

import asyncio
import contextlib
import json
from typing import Any

import made
import pytest

from uavrt.cli.system.fly import _Terminal, fly
from uavrt.core.commands import SystemState
from uavrt.core.errors import ConfigError, LinkError, TunnelError
from uavrt.core.messages import MotionRequest
from uavrt.ground.link.keys import LinkKeys
from uavrt.ground.link.motions.motion_requests import motion_request
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import FrameParser, FrameWriter
from uavrt.link.tunnel.generations.wire import PAYLOAD_TYPE
from uavrt.link.tunnel.own_messages.motion_messages import (
    MotionConfirmation,
    MotionState,
    decode_motion,
    encode_state,
)
from uavrt.link.tunnel.own_messages.private import MOTION_STATE_TYPE
from uavrt.link.tunnel.tunnel_records import heartbeat_to_wire
from uavrt.simulation.demo.demo_programs import free_udp_port

EARLIER, ORDER, LATER = 3, 5, 7


class Peer(asyncio.DatagramProtocol):
    """A drone that offers each requested order; the end of an earlier order comes late."""

    def __init__(self, *, answers: bool, ends: int) -> None:
        self.heard: list[Any] = []
        self._answers, self._ends = answers, ends
        self._parser, self._writer = FrameParser(), FrameWriter(1, 191)
        self._transport: Any = None

    def connection_made(self, transport: Any) -> None:
        self._transport = transport

    async def beat(self) -> None:
        while True:
            self._transport.sendto(self._writer.encode(made.heartbeat()))
            self._send(PAYLOAD_TYPE, heartbeat_to_wire(SystemState.IDLE, 51.5).encode())
            await asyncio.sleep(0.3)

    def datagram_received(self, data: bytes, addr: object) -> None:
        for frame in self._parser.feed(data):
            message = frame.message()
            if isinstance(message, dialect.Tunnel):
                with contextlib.suppress(TunnelError):  # a receipt
                    payload = bytes(message.payload[: message.payload_length])
                    self._answer(decode_motion(payload, (254, 190)))

    def _answer(self, said: Any) -> None:
        self.heard.append(said)
        if isinstance(said, MotionRequest):
            self._say("offer", "out", "hold here", said.request_id, ORDER)
        elif isinstance(said, MotionConfirmation) and self._answers:
            self._say("state", "out", "done", 0, EARLIER)
            self._say("state", "confirmed", "confirmed", said.request_id, ORDER)
            self._say("state", "out", "done", 0, EARLIER)
            self._say("state", "in command", "hold here", 0, ORDER)
            if self._ends == ORDER:
                self._say("state", "out", "the sticks were moved", 0, ORDER)
            else:
                self._say("state", "confirmed", "confirmed", 0, LATER)
        elif not isinstance(said, MotionConfirmation):
            self._say("state", "out", "stopped by the operator", said.request_id, ORDER)

    def _say(self, kind: Any, standing: Any, text: str, answers: int, order_id: int) -> None:
        said = MotionState(
            kind=kind, standing=standing, text=text, request_id=answers, order_id=order_id
        )
        self._send(MOTION_STATE_TYPE, encode_state(said))

    def _send(self, payload_type: int, payload: bytes) -> None:
        self._transport.sendto(self._writer.encode(made.tunnel(payload_type, payload)))


def hold(*, answers: bool, ends: int = ORDER) -> tuple[Peer, int | LinkError]:
    """Fly until the command ends; return the drone and the exit status or error."""
    port, peer = free_udp_port(), Peer(answers=answers, ends=ends)
    terminal = _Terminal(LinkKeys(), json_lines=True, yes=True, sticks_unseen=False)

    async def fly() -> int:
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: peer, remote_addr=("127.0.0.1", port)
        )
        beating = asyncio.create_task(peer.beat())
        try:
            return await terminal.run(
                f"udpin://127.0.0.1:{port}", "hold", motion_request("hold")
            )
        finally:
            beating.cancel()
            transport.abort()
            await asyncio.sleep(0)

    try:
        return peer, asyncio.run(fly())
    except LinkError as end:
        return peer, end


def test_the_end_of_an_earlier_order_is_not_taken_for_that_of_this_one(
    capsys: pytest.CaptureFixture[str],
) -> None:
    _, ended = hold(answers=True)
    printed = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert printed == [
        {"event": "offer", "text": "hold here"},
        {"event": "confirmed", "text": "confirmed"},
        {"event": "in command", "text": "hold here"},
        {"event": "out", "text": "the sticks were moved"},
    ]
    assert ended == 1


def test_an_order_of_another_ends_the_following_of_this_one(
    capsys: pytest.CaptureFixture[str],
) -> None:
    _, ended = hold(answers=True, ends=LATER)
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert last == {"event": "out", "text": "another order was confirmed"}
    assert ended == 1


def test_a_confirmation_without_an_answer_is_followed_by_a_stop() -> None:
    drone, ended = hold(answers=False)
    assert isinstance(ended, LinkError)
    kinds = [type(said).__name__ for said in drone.heard]
    assert kinds == ["MotionRequest", "MotionConfirmation", "MotionStop"]


@pytest.mark.parametrize(
    ("action", "numbers", "values", "reason"),
    [
        ("goto", (), {}, "goto needs a position"),
        ("goto", (47.1,), {}, "goto needs a position"),
        ("goto", (8.5, 147.1, 3.0), {}, "goto needs a position"),
        ("goto", (147.1, 8.5), {}, "is not a latitude"),
        ("goto", (float("nan"), 8.5), {}, "is not a latitude"),
        ("hold", (30.0,), {}, "hold accepts no numbers"),
        ("takeoff", (), {}, "takeoff needs one height"),
        ("takeoff", (30.0, 8.0), {}, "takeoff needs one height"),
        ("takeoff", (30.0,), {"height": 20.0}, "takeoff needs one height"),
    ],
)
def test_numbers_that_do_not_fit_are_refused_with_the_right_ones(
    action: Any, numbers: tuple[float, ...], values: dict[str, Any], reason: str
) -> None:
    with pytest.raises(ConfigError, match=reason) as refused:
        fly(action, *numbers, **values)
    assert refused.value.remedy
