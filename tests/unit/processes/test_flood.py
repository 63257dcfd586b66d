"""A flood of a stranger's messages: pulses go on, and none of it is written or answered."""

import asyncio
import socket
from collections.abc import Callable, Iterator
from itertools import count, cycle
from typing import Any

import made
import pytest
from delivered import Delays, numbers
from until import until_async as until

from uavrt.core.messages import SystemStatus
from uavrt.drone.processes.connection_parts.station_limits import (
    ANSWERED_BURST,
    ANSWERED_PER_S,
    OTHERS_BURST,
    OTHERS_PER_S,
    OWN_BURST,
    StationLimits,
)
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import FrameWriter
from uavrt.link.tunnel.own_messages.private import Receipt, payload_hash
from uavrt.link.tunnel.pulses.receiving_stations import MOST_STORES
from uavrt.link.tunnel.pulses.reliable import ReliableSender

pytestmark = pytest.mark.slow

Bay = Any  # tests/unit/processes/conftest.py
COUNT = 4000
SECOND_NS = 10**9
OURS = {"target_system": 1, "target_component": 191}


def tunnel(kind: int, payload: bytes) -> dialect.Tunnel:
    return made.tunnel(kind, payload, **OURS)


def flood() -> Iterator[bytes]:
    """Frames of a stranger that has many names, as many of each kind."""
    messages = cycle(
        (
            tunnel(0, b"\x06\0\0\0"),
            tunnel(0, b"\x0d\0\0\0"),
            tunnel(0, b"\x63\0\0\0rubbish"),
            tunnel(60_001, bytes(20)),
            tunnel(60_001, Receipt(store=77).encode()),
            tunnel(60_002, bytes(40)),
            dialect.ParamSet(**OURS, param_id="DET_K", param_value=5.0, param_type=9),
            dialect.ParamRequestList(**OURS),
            dialect.Ping(time_usec=1, seq=2, target_system=0, target_component=0),
            made.command_long(512, *[148.0] * 7, **OURS),
        )
    )
    for number in range(COUNT):
        yield FrameWriter(1 + number % 250, 195).encode(next(messages))


def flood_of_names_and_stores() -> Iterator[bytes]:
    """The same, and receipts of ever other stores, and reports of a full radio, without end."""
    frames = cycle(list(flood()))
    for number in count(1):
        kind = number % 12
        if kind == 10:
            message = tunnel(60_001, Receipt(store=number).encode())
            yield FrameWriter(1 + number % 250, 195).encode(message)
        elif kind == 11:
            full = dialect.RadioStatus(rssi=1, remrssi=1, noise=1, remnoise=1)
            yield FrameWriter(1 + number % 250, 195).encode(full)
        else:
            yield next(frames)


def commanded_by(source: str) -> SystemStatus:
    return made.system_status(commander=source)


FLOOD_S, FIRST_S = 20, 7
BATCH_S = 0.002
PULSE_EVERY = 61
"""Batches between two pulses: 8 a second, at no fixed phase of the timers."""


async def fly_in_a_flood(bay: Bay, frames: Iterator[bytes] | None) -> Delays:
    """Send pulses for twenty seconds while somebody sends 2000 frames a second."""
    delays = Delays(bay)
    async with bay.running(), bay.ground_station() as (ground, _):
        ground._on_event = delays.append
        bay.deliver("system_status", commanded_by("mavlink 254/190"))
        for number in range(8):  # the station shows that it is there, the link what it takes
            bay.send_pulse(1000 + number)
            await asyncio.sleep(0.125)
        with socket.socket(type=socket.SOCK_DGRAM) as stranger:
            stranger.connect(("127.0.0.1", bay.companion_port))
            for batch in range(round(FLOOD_S / BATCH_S)):
                for _ in range(4 if frames is not None else 0):
                    stranger.send(next(frames))  # type: ignore[arg-type]
                if batch % PULSE_EVERY == 0:
                    delays.send(batch // PULSE_EVERY)
                await asyncio.sleep(BATCH_S)
        await asyncio.sleep(1.0)
    return delays


async def test_a_flood_delays_95_percent_of_the_pulses_by_a_tenth_at_most(
    make_bay: Callable[[], Bay],
) -> None:
    quiet = await fly_in_a_flood(make_bay(), None)
    flooded = await fly_in_a_flood(make_bay(), flood_of_names_and_stores())
    first = round(FIRST_S / BATCH_S) // PULSE_EVERY
    everything = len(quiet.sent_s)
    for begin, end in ((0, first), (first, everything)):
        assert flooded.p95_s(begin, end) <= 1.1 * quiet.p95_s(begin, end)
    assert flooded.seen_s.keys() >= flooded.sent_s.keys()


async def test_a_flood_is_neither_answered_nor_written_and_pulses_go_on(
    bay: Bay, capsys: pytest.CaptureFixture[str]
) -> None:
    async with bay.running(), bay.ground_station() as (ground, events):
        await until(lambda: ground.protocol.drone is not None)
        bay.deliver("system_status", commanded_by("mavlink 255/190"))
        stranger = socket.socket(type=socket.SOCK_DGRAM)
        stranger.connect(("127.0.0.1", bay.companion_port))
        capsys.readouterr()
        for number, frame in enumerate(flood()):
            stranger.send(frame)
            if number % 40 == 0:
                await asyncio.sleep(0.01)
            if number % 400 == 0:
                bay.send_pulse(number // 400)
        await ground.stop_detection()
        await until(lambda: len(numbers(events)) == COUNT // 400)
        stranger.close()
        counters = bay.process._counters()
        assert counters["messages_passed_over"] > COUNT // 4
        assert counters["questions_passed_over"] > COUNT // 20
        assert len(bay.commands) < COUNT // 20
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) < 60, "powers of two of a few kinds"


def test_others_share_what_is_left_beside_the_commander() -> None:
    crowd = StationLimits()
    crowd.commander((255, 190))
    admitted = sum(crowd.admits((n % 250, 195), n * SECOND_NS // 2000) for n in range(20_000))
    assert OTHERS_BURST <= admitted <= OTHERS_BURST + 10 * OTHERS_PER_S + 1
    assert crowd.dropped == 20_000 - admitted
    assert all(crowd.admits((255, 190), 10 * SECOND_NS) for _ in range(OWN_BURST))
    asked = sum(
        crowd.admits((n % 250, 195), n * SECOND_NS // 2000, answers=1) for n in range(20_000)
    )
    assert ANSWERED_BURST <= asked <= ANSWERED_BURST + 10 * ANSWERED_PER_S + 1
    lists = sum(crowd.admits((9, 9), 60 * SECOND_NS, answers=11) for _ in range(100))
    assert lists == ANSWERED_BURST // 11


def test_made_up_stores_take_no_place_from_who_acknowledges() -> None:
    sender: ReliableSender[int] = ReliableSender(lambda number: bytes([number]))
    sender.station_present(True, 0)
    now_ns = SECOND_NS
    sender.receipt(1, (), (255, 190), 0)
    sender.pulses.add((2, 1), 1)
    outgoing = sender.take(now_ns, 1e6)
    assert outgoing is not None
    genuine = Receipt.decode(
        Receipt(store=1, hashes=(payload_hash(outgoing.payload),)).encode()
    )
    assert sender.receipt(1, genuine.hashes, (255, 190), SECOND_NS) == [(2, 1)]
    for store in range(100, 400):
        now_ns += SECOND_NS
        sender.receipt(1, (), (255, 190), now_ns)
        sender.receipt(store, (), (254, 190), now_ns)
        sender.wait_ns(now_ns)
    assert 1 in sender.stores
    assert len(sender.stores) <= MOST_STORES
    assert sender.stores.refused > 250


def test_a_made_up_store_does_not_hold_up_who_acknowledges() -> None:
    sender: ReliableSender[int] = ReliableSender(lambda number: number.to_bytes(4, "little"))
    sender.station_present(True, 0)
    sender.receipt(1, (), (255, 190), 0)
    sender.receipt(77, (), (254, 190), 0)
    heard: set[bytes] = set()
    now_ns = 0
    for number in range(300):
        sender.pulses.add((2, number), number)
        now_ns += SECOND_NS // 10
        sender.receipt(77, (), (254, 190), now_ns)
        hashes = []
        while (outgoing := sender.take(now_ns, 1e6)) is not None:
            heard.add(outgoing.payload)
            hashes.append(payload_hash(outgoing.payload))
        sender.receipt(1, hashes, (255, 190), now_ns)
        assert len(heard) == number + 1, "at once"
    assert 77 not in sender.stores
    assert sender.stores.refused > 0
    assert sender.repeats < 100
