"""A drone with a key is commanded by who has it, and by nobody else."""

import asyncio
from pathlib import Path

from some import some

from uavrt import tunnel
from uavrt.ground.link.delivery_receipts import Receipts
from uavrt.ground.link.drone_parameters import DroneParameters
from uavrt.ground.link.protocol import GroundProtocol
from uavrt.mavlink import Peer, dialect
from uavrt.mavlink.frame import FrameParser, FrameWriter
from uavrt.mavlink.message import Message
from uavrt.messages import Command
from uavrt.tunnel.exchange import Answer, Exchange
from uavrt.tunnel.gate import Gate, Sealer
from uavrt.tunnel.private import MAX_SEALED_HASHES, Receipt
from uavrt.tunnel.seal import PLAIN_INSIDE, RECEIPT_INSIDE, Key, read_key

GROUND = (255, 190)
DRONE = (1, 191)
NOW_NS = 1_700_000_000_000_000_000
STOP = tunnel.HeaderMessage(command=tunnel.CommandId.STOP_DETECTION).encode()


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
    session = some(gate.announcement(DRONE))
    sealer.hear(session, DRONE)
    return ground


def test_a_sealed_command_is_taken_and_a_plain_one_is_refused_with_the_reason(
    tmp_path: Path,
) -> None:
    path = key_file(tmp_path)
    gate, exchange = Gate((), str(path)), Exchange()
    reason = some(gate.refusal(GROUND, sealed=False))
    answer = exchange.refuse(STOP, reason, GROUND)
    assert isinstance(answer, Answer)
    ack = tunnel.decode(answer.payload)
    assert isinstance(ack, tunnel.AckG1)
    assert ack.result == tunnel.FAILURE
    assert "only sealed" in ack.message
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
            parameters.take(frame)

    parameters = DroneParameters(sealing_ground(read_key(path), gate), drone, 0.01)
    parameters._bytewise = True
    assert asyncio.run(parameters.set("DET_K", 4.0)) == 4.0
    assert None not in opened
    assert gate.refused == 0
