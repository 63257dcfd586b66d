"""Random and mutated frames: no crash, no state change, and the counters say what came.

20 000 here; `UAVRT_FUZZ=1000000` for the long form.
"""

import os
import struct
from contextlib import suppress
from random import Random
from typing import Any

import pytest

from uavrt.config.parameters import parameter_values, with_parameter
from uavrt.config.settings import Settings
from uavrt.core.errors import ConfigError, TunnelError
from uavrt.core.messages import Command
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.component import Component, Handlers
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.frame import FrameParser, FrameWriter
from uavrt.link.mavlink.services.parameter_service import (
    ParameterChange,
    ParameterServer,
    Requests,
)
from uavrt.link.tunnel.drone_exchange import Answer, Exchange
from uavrt.link.tunnel.gate import Gate
from uavrt.link.tunnel.own_messages.seal import Key, SealKeeper
from uavrt.link.tunnel.pulses.reliable import ReliableSender

COUNT = int(os.environ.get("UAVRT_FUZZ", "20000"))
NOW_NS = 1_700_000_000_000_000_000


SIZES = (0, 3, 4, 8, 12, 16, 40, 48, 88, 96, 120, 128)
"""Lengths of the tunnel's messages, and some that are none's."""


def parameter_frame(writer: FrameWriter, random: Random) -> bytes:
    name = random.choice(("RADIO_GAIN", "DET_K", "NOTHING", "", random.randbytes(20).hex()))
    target = {"target_system": random.choice((0, 1, 7)), "target_component": 191}
    value = struct.unpack("<f", random.randbytes(4))[0]
    requests = (
        dialect.ParamRequestList(**target),
        dialect.ParamRequestRead(
            **target, param_id=name, param_index=random.randrange(-32768, 32768)
        ),
        dialect.ParamSet(
            **target, param_id=name, param_value=value, param_type=random.randrange(256)
        ),
    )
    return writer.encode(random.choice(requests))


def tunnel_frame(writer: FrameWriter, random: Random) -> bytes:
    if random.random() < 0.1:
        return parameter_frame(writer, random)
    size = random.choice((*SIZES, random.randrange(129)))
    payload = bytearray(random.randbytes(size))
    if size >= 4 and random.random() < 0.9:
        payload[:4] = random.randrange(28).to_bytes(4, "little")
    return writer.encode(
        dialect.Tunnel(
            target_system=random.choice((0, 1, 1, 7)),
            target_component=random.choice((0, 191, 191, 5)),
            payload_type=random.choice((0, 0, 0, 5, 60_001, 60_002)),
            payload_length=random.choice((size, size, size, random.randrange(256))),
            payload=bytes(payload),
        )
    )


@pytest.mark.parametrize("generation", ["auto", "G2"])
def test_no_frame_disturbs_the_drone_side(generation: Any) -> None:
    random = Random(20260)
    parser = FrameParser()
    writer = FrameWriter(255, 190)
    exchange, gate = Exchange(generation, experimental=True), Gate()
    values = parameter_values(Settings())
    kinds = dict.fromkeys(values, dialect.MavParamType.INT32)
    parameters = ParameterServer(lambda: values, kinds, lambda: True)
    sender: ReliableSender[int] = ReliableSender(lambda number: bytes([number]))
    sender.station_present(True, NOW_NS)
    sender.pulses.add((2, 1), 1)
    sent: list[object] = []
    seen = {"payloads": 0, "private": 0, "commands": 0, "answers": 0, "wishes": 0}

    def manoeuvre(request: Requests, peer: Peer) -> None:
        answer = parameters.receive(request)
        if isinstance(answer, ParameterChange):
            seen["wishes"] += 1
            with suppress(ConfigError):
                with_parameter(Settings(), answer.name, answer.value)

    def take(payload: bytes, peer: Peer) -> None:
        seen["payloads"] += 1
        result = exchange.receive(payload, (peer.system_id, peer.component_id))
        seen["commands"] += isinstance(result, Command)
        seen["answers"] += isinstance(result, Answer)

    def private(kind: int, payload: bytes, peer: Peer) -> None:
        seen["private"] += 1
        assert gate.open(payload, (peer.system_id, peer.component_id), (1, 191)) is None

    component = Component(
        sent.append,
        Handlers(
            attitude=lambda sample: None,
            position=lambda sample: None,
            tunnel=take,
            private=private,
            parameters=manoeuvre,
        ),
    )
    component.tick(NOW_NS)
    fed, mutated = 0, 0
    for number in range(COUNT // 2):
        frame = bytearray(tunnel_frame(writer, random))
        if random.random() < 0.5:
            mutated += 1
            for _ in range(random.randrange(1, 4)):
                frame[random.randrange(len(frame))] = random.randrange(256)
        data = bytes(frame) if random.random() < 0.95 else random.randbytes(40)
        fed += len(data)
        parser.reset()
        for received in parser.feed(data):
            component.receive(received, NOW_NS + number)
    parser.reset()
    assert mutated > COUNT // 6
    assert parser.received > COUNT // 6
    assert seen["wishes"] > 0
    assert parser.bad_crc > 0
    assert parser.skipped_bytes < fed
    counters = component.counters
    assert counters["tunnels_received"] >= seen["payloads"] + seen["private"]
    assert counters["bad_tunnels"] > 0
    assert counters["for_others"] > 0
    assert gate.refused == seen["private"]
    refused = exchange.counters["payloads_refused"]
    assert refused > 0
    replayed = exchange.counters["acknowledgements_replayed"]
    levels = exchange.counters["log_levels"]
    assert seen["answers"] <= refused + replayed + levels
    assert seen["payloads"] >= seen["commands"] + seen["answers"]
    # Nobody who matters was made up, and the pulse still waits.
    assert component.discovery.autopilot is None
    assert (len(sender.pulses), len(sender.underway)) == (1, 0)


def test_no_sealed_message_is_ever_believed_by_chance() -> None:
    random = Random(20261)
    keeper = SealKeeper(Key(random.randbytes(32)))
    for _ in range(min(COUNT, 50_000)):
        head = bytes((2, random.randrange(3), 0, 0))
        payload = head + random.randbytes(random.randrange(125))
        with pytest.raises(TunnelError):
            keeper.open(payload, (255, 190), (1, 191))
