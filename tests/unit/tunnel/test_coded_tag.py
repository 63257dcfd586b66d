"""Coded tags on their way to the drone: their bytes, and what cannot be is refused."""

import struct
from dataclasses import replace

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st
from some import some, typed

from uavrt.core.commands import CommandId
from uavrt.core.errors import LinkError, TunnelError
from uavrt.core.messages import Command
from uavrt.ground.link.requests.command_payloads import CommandEncoder
from uavrt.link.tunnel.drone_exchange import Answer, Exchange
from uavrt.link.tunnel.generations.codec import decode
from uavrt.link.tunnel.generations.g1 import AckG1
from uavrt.link.tunnel.generations.g2 import UploadG2
from uavrt.link.tunnel.generations.wire import MAX_PAYLOAD
from uavrt.link.tunnel.own_messages.coded_tag import CodedTag
from uavrt.link.tunnel.own_messages.seal import MAX_INSIDE
from uavrt.link.tunnel.tag_lists import tag_list_digest

GROUND = (255, 190)
TAG = made.tag(
    30,
    148_690_000.0,
    4.7,
    pulse_width_s=0.0025,
    interval_uncertainty_s=0.004,
    k=10,
    gaps_s=(0.022, 0.0488, 0.0366),
)


def accept(exchange: Exchange, result: object) -> tuple[Command, bytes]:
    assert isinstance(result, Command)
    reply = made.reply(result)
    answer = some(exchange.reply(reply))
    return result, answer.payload


def test_the_bytes_are_those_of_the_manual() -> None:
    payload = CodedTag(tag=TAG, request_id=1, upload_id=2, tag_index=3).encode()
    assert payload.hex(" ", -4) == (
        "04000000 01000000 02000000 03000000 1e000000 50d4dc08 c4090000 60b74700 a00f0000"
        " 00000000 01030a00 7b14ae47 e17a843f f0550000 a0be0000 f88e0000"
    )
    assert CodedTag.decode(payload).tag == TAG
    longest = replace(TAG, gaps_s=(0.02,) * 7)
    assert len(CodedTag(tag=longest).encode()) <= MAX_INSIDE


def test_a_list_goes_to_the_drone_and_is_the_same_there() -> None:
    exchange, writing = Exchange(), CommandEncoder("G1")
    begin, coded, end = writing.upload([replace(TAG, name="hen")])
    accept(exchange, exchange.receive(begin, GROUND))
    command, ack = accept(exchange, exchange.receive(coded, GROUND, coded_tag=True))
    assert (command.name, command.tag) == ("add_tag", TAG)
    answer = typed(AckG1, decode(ack))
    assert answer.acked_command == CommandId.TAG
    accept(exchange, exchange.receive(end, GROUND))
    assert tag_list_digest([TAG]) == tag_list_digest([CodedTag.decode(coded).tag])
    with pytest.raises(LinkError, match="original UAV-RT"):
        CommandEncoder("G0").upload([TAG])


def test_a_numbered_upload_is_complete_with_its_coded_tags() -> None:
    exchange, writing = Exchange("G2", experimental=True), CommandEncoder("G2")
    begin, coded, end = writing.upload([TAG])
    accept(exchange, exchange.receive(begin, GROUND))
    early = typed(Answer, exchange.receive(end, GROUND))
    assert b"missing 0" in early.payload
    accept(exchange, exchange.receive(coded, GROUND, coded_tag=True))
    again = exchange.receive(coded, GROUND, coded_tag=True)
    assert isinstance(again, Answer), "the answer is replayed, the tag not added again"
    opened = typed(UploadG2, decode(end, "G2"))
    fresh = replace(opened, request_id=opened.request_id ^ 1 << 20)
    accept(exchange, exchange.receive(fresh.encode(), GROUND))


@given(st.binary(max_size=MAX_PAYLOAD))
def test_any_bytes_are_a_coded_tag_or_refused_with_an_answer(payload: bytes) -> None:
    try:
        CodedTag.decode(payload)
    except TunnelError:
        result = Exchange().receive(payload, GROUND, coded_tag=True)
        assert result is None or isinstance(result, Answer)


@pytest.mark.parametrize(
    ("offset", "layout", "value", "said"),
    [
        (0, "<I", 5, "command 5, not"),
        (16, "<I", 0, "tag_id 0"),
        (20, "<I", 0, "frequency_hz 0"),
        (24, "<I", 0, "overlap"),
        (28, "<I", 100_000, "longer than its interval"),
        (40, "<B", 2, "version 2"),
        (41, "<B", 0, "0 gaps"),
        (41, "<B", 7, "bytes, not"),
        (42, "<H", 0, "k 0"),
        (44, "<d", float("nan"), "probability"),
        (52, "<I", 4_000, "overlap"),
    ],
)
def test_a_code_that_cannot_be_is_refused(
    offset: int, layout: str, value: float, said: str
) -> None:
    payload = bytearray(CodedTag(tag=TAG).encode())
    struct.pack_into(layout, payload, offset, value)
    with pytest.raises(TunnelError, match=said):
        CodedTag.decode(bytes(payload))
