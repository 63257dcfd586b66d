"""A drone with a key is commanded by who has it, and by nobody else."""

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
from pulses import pulse_at
from sealed import introduce
from some import some

from uavrt.config.parameters import OFFERED
from uavrt.config.settings import Settings
from uavrt.core.commands import CommandId
from uavrt.core.messages import Command, Course, PulsePose
from uavrt.drone.processes.connection_parts.parameter_handler import ParameterHandler
from uavrt.ground.link.delivery_receipts import Receipts
from uavrt.ground.link.protocol import GroundProtocol
from uavrt.ground.link.requests.drone_parameters import DroneParameters
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.frame import FrameParser, FrameWriter
from uavrt.link.mavlink.message import Message
from uavrt.link.tunnel.drone_exchange import Answer, Exchange
from uavrt.link.tunnel.gate import Gate, Sealer
from uavrt.link.tunnel.generations.codec import decode
from uavrt.link.tunnel.generations.g0 import FAILURE, SUCCESS, HeaderMessage
from uavrt.link.tunnel.generations.g1 import AckG1
from uavrt.link.tunnel.own_messages.motion_messages import MotionState, encode_state
from uavrt.link.tunnel.own_messages.neighbour_messages import encode_course
from uavrt.link.tunnel.own_messages.private import (
    COURSE_TYPE,
    MAX_SEALED_HASHES,
    MOTION_STATE_TYPE,
    Receipt,
)
from uavrt.link.tunnel.own_messages.seal import PLAIN_INSIDE, RECEIPT_INSIDE, Key, read_key
from uavrt.link.tunnel.tunnel_records import pulse_to_wire

GROUND = (255, 190)
DRONE = (1, 191)
COURSE = Course(sequence=5, place=(47.0, 8.0), altitude_amsl_m=500.0, goal=(47.001, 8.0))
NOW_NS = 1_700_000_000_000_000_000
STOP = HeaderMessage(command=CommandId.STOP_DETECTION).encode()


def key_file(tmp_path: Path) -> Path:
    path = tmp_path / "key"
    path.write_text("00112233445566778899aabbccddeeff")
    path.chmod(0o600)
    return path


def sealing_ground(key: Key, gate: Gate) -> GroundProtocol:
    """A ground station that has heard the drone's session."""
    receipts = Receipts(7)
    receipts.most = MAX_SEALED_HASHES
    ground = GroundProtocol(*GROUND, receipts, sealer := Sealer(key, GROUND))
    ground.drone = Peer(*DRONE)
    introduce(sealer, gate, GROUND, DRONE)
    return ground


def test_a_sealed_command_is_taken_and_a_plain_one_is_refused_with_the_reason(
    tmp_path: Path,
) -> None:
    path = key_file(tmp_path)
    gate, exchange = Gate((), str(path)), Exchange()
    reason = some(gate.refusal(GROUND, sealed=False))
    answer = exchange.refuse(STOP, reason, GROUND)
    assert isinstance(answer, Answer)
    ack = decode(answer.payload)
    assert isinstance(ack, AckG1)
    assert ack.result == FAILURE
    assert "only accepts sealed" in ack.message
    sent = sealing_ground(read_key(path), gate).tunnel_message(STOP)
    opened = gate.open(sent.payload[: sent.payload_length], GROUND, DRONE)
    assert opened == (PLAIN_INSIDE, STOP)
    assert gate.refusal(GROUND, sealed=True) is None
    assert isinstance(exchange.receive(STOP, GROUND), Command)


def test_a_full_receipt_fits_into_a_seal(tmp_path: Path) -> None:
    path = key_file(tmp_path)
    gate = Gate((), str(path))
    ground = sealing_ground(read_key(path), gate)
    assert ground.receipts is not None
    for number in range(20):
        ground.receipts.stored(bytes([number]))
    message = some(ground.receipt(NOW_NS))
    opened = some(gate.open(message.payload[: message.payload_length], GROUND, DRONE))
    kind, inside = opened
    assert kind == RECEIPT_INSIDE
    assert len(Receipt.decode(inside).hashes) == MAX_SEALED_HASHES


def test_only_named_systems_may_command() -> None:
    gate = Gate((245,))
    assert gate.refusal((245, 190), sealed=False) is None
    assert "255 may not command" in (gate.refusal(GROUND, sealed=False) or "")


def test_forged_messages_are_counted(tmp_path: Path) -> None:
    gate = Gate((), str(key_file(tmp_path)))
    assert gate.open(bytes(40), GROUND, DRONE) is None
    other_file = tmp_path / "other"
    other_file.write_text("00" * 32)
    other_file.chmod(0o600)
    other_drone = Gate((), str(other_file))
    other = sealing_ground(Key(bytes(32)), other_drone).tunnel_message(STOP)
    assert gate.open(other.payload[: other.payload_length], GROUND, DRONE) is None
    assert gate.refused == 2


def test_a_parameter_whose_answer_was_lost_is_asked_for_with_a_new_seal(tmp_path: Path) -> None:
    path = key_file(tmp_path)
    gate = Gate((), str(path))
    opened: list[tuple[int, bytes] | None] = []

    def drone(message: Message) -> None:
        assert isinstance(message, dialect.Tunnel)
        opened.append(gate.open(message.payload[: message.payload_length], GROUND, DRONE))
        if len(opened) == 2:  # the first answer does not arrive
            value = dialect.ParamValue(
                param_id="DET_K", param_value=4.0, param_type=9, param_count=9, param_index=4
            )
            (frame,) = FrameParser().feed(FrameWriter(1, 191).encode(value))
            parameters.receive(frame)

    parameters = DroneParameters(sealing_ground(read_key(path), gate), drone, 0.01)
    parameters._bytewise = True
    assert asyncio.run(parameters.set("DET_K", 4.0)) == 4.0
    assert None not in opened
    assert gate.refused == 0


def test_two_changes_of_one_parameter_are_confirmed_one_after_the_other() -> None:
    protocol = GroundProtocol(*GROUND)
    protocol.drone = Peer(*DRONE)
    tries: list[float] = []

    def drone(message: Message) -> None:
        assert isinstance(message, dialect.ParamSet)
        tries.append(message.param_value)
        value = dialect.ParamValue(
            param_id="DET_K",
            param_value=message.param_value,
            param_type=9,
            param_count=9,
            param_index=4,
        )
        (frame,) = FrameParser().feed(FrameWriter(*DRONE).encode(value))
        asyncio.get_running_loop().call_soon(parameters.receive, frame)

    async def set_both() -> list[float]:
        return await asyncio.gather(*(parameters.set("DET_K", k) for k in (4.0, 5.0)))

    parameters = DroneParameters(protocol, drone, 0.5)
    parameters._bytewise = True
    assert asyncio.run(set_both()) == [4.0, 5.0]
    assert tries == [4.0, 5.0], "no change was sent twice"


def test_a_drone_with_a_key_lists_its_parameters_for_sealed_requests(tmp_path: Path) -> None:
    path = key_file(tmp_path)
    gate, asked = Gate((), str(path)), list[Any]()
    handler = ParameterHandler(
        Settings(),
        lambda: True,
        send=lambda value, _: asked.append(value.param_id),
        ask=lambda _: None,
        notify=lambda _: None,
    )

    def drone(message: Message) -> None:
        assert isinstance(message, dialect.Tunnel), "nothing unsealed"
        opened = some(gate.open(message.payload[: message.payload_length], GROUND, DRONE))
        handler.receive_sealed(opened[1], Peer(*GROUND), None, 1)

    parameters = DroneParameters(sealing_ground(read_key(path), gate), drone, 0.01)
    for message in parameters._missing(Peer(*DRONE)):
        drone(message)
    every = list(asked)
    assert len(every) == len(OFFERED)
    parameters._count, parameters._indices = len(every), {*range(len(every))} - {3, 5}
    for message in parameters._missing(Peer(*DRONE)):
        drone(message)
    assert asked[len(every) :] == [every[3], every[5]]


def test_what_a_drone_reports_is_shown_without_a_proof(tmp_path: Path) -> None:
    """Pulses, acknowledgements of commands and states; answers to orders of motion are not."""
    path = key_file(tmp_path)
    ground = sealing_ground(read_key(path), Gate((), str(path)))
    ground.orders.append(7)
    forger = FrameWriter(*DRONE)
    pulse = pulse_to_wire(PulsePose(pulse=pulse_at(NOW_NS), pose=None)).encode()
    ack = AckG1(acked_command=6, result=SUCCESS, message="").encode()
    state = MotionState(kind="state", standing="out", text="stopped")
    shown: list[str] = []
    for kind, payload in (
        (0, pulse),
        (0, ack),
        (MOTION_STATE_TYPE, encode_state(state)),
        (MOTION_STATE_TYPE, encode_state(replace(state, request_id=7))),
        (COURSE_TYPE, encode_course(COURSE)),
    ):
        message = made.tunnel(
            kind, payload, target_system=GROUND[0], target_component=GROUND[1]
        )
        beat = made.heartbeat()
        for one in (beat, message):
            (frame,) = FrameParser().feed(forger.encode(one))
            shown += [type(event).__name__ for event in ground.receive(frame, NOW_NS)]
    assert shown == ["PulsePose", "Acknowledged", "MotionState", "Course"]
    assert ground.counters["bad_payloads"] == 1, "the answer to an order"
