import math

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st
from some import some, typed

from uavrt.core.commands import CommandId, SystemState
from uavrt.core.messages import Command, CommandReply, PulsePose
from uavrt.link.tunnel.drone_exchange import Answer, Exchange
from uavrt.link.tunnel.generations.codec import decode
from uavrt.link.tunnel.generations.g0 import AckG0, HeaderMessage, PulseG0
from uavrt.link.tunnel.generations.g1 import AckG1, FieldsG1, PulseG1
from uavrt.link.tunnel.tunnel_records import tag_to_wire

QGC = (255, 190)
MAVSDK = (245, 190)
TAG = made.tag(
    interval_uncertainty_s=0.06, interval_jitter_s=0.01, false_alarm_probability=0.005
)
PULSE = PulsePose(
    pulse=made.pulse(
        1_700_205_419_230_494_976, frequency_hz=148_710_123.4, group_sequence=7, noise_psd=1e-9
    ),
    pose=None,
)


def header(command: CommandId) -> bytes:
    return HeaderMessage(command=command).encode()


def reply_to(command: Command, *, accepted: bool = True, message: str = "") -> CommandReply:
    return made.reply(command, message=message, accepted=accepted)


def test_the_acknowledgement_goes_to_whoever_asked() -> None:
    exchange = Exchange()
    first = exchange.receive(header(CommandId.START_TAGS), QGC)
    second = exchange.receive(header(CommandId.END_TAGS), MAVSDK)
    assert isinstance(first, Command)
    assert isinstance(second, Command)
    answer = some(exchange.reply(reply_to(second, accepted=False, message="no upload")))
    assert answer.requester == MAVSDK
    assert decode(answer.payload) == AckG1(acked_command=3, result=0, message="no upload")
    answer = some(exchange.reply(reply_to(first)))
    assert answer.requester == QGC


@pytest.mark.parametrize(
    ("generation", "ack", "pulse"), [("G0", AckG0, PulseG0), ("G1", AckG1, PulseG1)]
)
def test_the_ground_is_answered_in_its_own_generation(
    generation: str, ack: type, pulse: type
) -> None:
    exchange = Exchange()
    wire = tag_to_wire(TAG, "G0" if generation == "G0" else "G1")
    command = typed(Command, exchange.receive(wire.encode(), QGC))
    assert command.tag == TAG
    answer = some(exchange.reply(reply_to(command)))
    assert isinstance(decode(answer.payload), ack)
    assert isinstance(decode(exchange.pulse(PULSE)), pulse)


def test_start_carries_the_frequency_and_gain_chosen_on_the_ground_or_leaves_them() -> None:
    numbers = {"center_frequency_hz": 148_700_000.0, "gain": 17.0}
    start = FieldsG1.of(CommandId.START_DETECTION, numbers).encode()
    for payload, chosen in (
        (start, (148_700_000, 17)),
        (header(CommandId.START_DETECTION), (None, None)),
    ):
        command = typed(Command, Exchange().receive(payload, QGC))
        assert (command.center_frequency_hz, command.gain) == chosen


def test_a_tag_of_the_wrong_length_is_refused_with_the_reason() -> None:
    answer = typed(Answer, Exchange().receive(tag_to_wire(TAG).encode()[:-4], QGC))
    ack = typed(AckG1, decode(answer.payload))
    assert ack.result == 0
    assert "84 bytes" in ack.message


@given(st.binary(max_size=140))
def test_any_payload_gives_a_command_an_answer_or_nothing(payload: bytes) -> None:
    exchange = Exchange()
    result = exchange.receive(payload, QGC)
    if isinstance(result, Answer):
        decode(result.payload)
    elif isinstance(result, Command):
        assert result.source == "mavlink 255/190"
        if result.tag is not None:
            assert result.tag.frequency_hz > 0
            assert math.isfinite(result.tag.false_alarm_probability)
    else:
        assert sum(exchange.counters.values()) <= 1


@given(st.lists(st.binary(max_size=140), max_size=200))
def test_commands_that_are_never_answered_do_not_pile_up(payloads: list[bytes]) -> None:
    exchange = Exchange()
    for payload in [*payloads, *[header(CommandId.STOP_DETECTION)] * 100]:
        exchange.receive(payload, QGC)
    assert exchange.counters["replies_missing"] >= 36


def test_the_thesis_ground_gets_no_messages_it_does_not_know() -> None:
    exchange = Exchange("G0")
    assert exchange.heartbeat(SystemState.IDLE, None) is None
