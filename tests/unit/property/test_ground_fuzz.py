"""Hostile frames on the ground's link: it stays awake, and a pulse that follows is stored.

The twin of `test_link_fuzz`, which has the drone's side. 6 000 frames here;
`UAVRT_FUZZ=1000000` for the long form.
"""

import asyncio
import math
import os
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

import made
import pytest
from until import until_async as until

from uavrt.core.clock import Clock
from uavrt.core.commands import CommandId
from uavrt.core.errors import UavrtError
from uavrt.core.messages import PulsePose
from uavrt.flight.logs.pulse_files import read_pulse_file
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.link.requests import parallel_links as ways
from uavrt.ground.session import GroundSession
from uavrt.ground.station import Station, StationSettings, json_line
from uavrt.ground.store.ground_settings import GroundStore
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import Frame, FrameWriter
from uavrt.link.mavlink.links.address import Address, parse_address
from uavrt.link.mavlink.links.mavlink_link import Link
from uavrt.link.mavlink.message import Message
from uavrt.link.tunnel.generations.codec import DECODERS
from uavrt.link.tunnel.own_messages.burst import BURST_TYPE
from uavrt.link.tunnel.own_messages.live_bearing import BEARING_TYPE
from uavrt.link.tunnel.tunnel_records import pulse_to_wire

COUNT = int(os.environ.get("UAVRT_FUZZ", "6000"))
NASTY = (0.0, -0.0, 1.0, -1.0, math.nan, math.inf, -math.inf, 1e308, 5e-324, 9.5e9, 1.7e9, 1e19)
PLAUSIBLE = (0.0, 1.7e9, 1.7e9 + 1e-6, 1.8e9, 4e9, 9.1e9) * 2
WHOLE = (0, 1, 2, 127, 255, 65_535, 2**31 - 1, 2**31, 2**32 - 1)
MESSAGES = (*DECODERS, *[(7, 120)] * 20, *[(1, 128)] * 5)
BEARING_SIZE = 64
SIZES = (0, 3, 4, 8, 12, 16, 20, 48, 88, 96, 120, 128)
HEARD = (
    dialect.Heartbeat,
    dialect.AttitudeQuaternion,
    dialect.GlobalPositionInt,
    dialect.SysStatus,
    dialect.RadioStatus,
    dialect.Ping,
    dialect.ParamValue,
    dialect.AutopilotVersion,
    dialect.Statustext,
    dialect.FileTransferProtocol,
    dialect.CommandAck,
    dialect.Timesync,
)


class MemoryLink(Link):
    """A link whose other end is the test."""

    def hear(self, data: bytes) -> None:
        self._parser.reset()
        self._take(data)

    async def open(self) -> None:
        """Nothing to open."""

    async def close(self) -> None:
        """Nothing to close."""

    def _write(self, frame: bytes) -> bool:
        return True


@pytest.fixture
def links(monkeypatch: pytest.MonkeyPatch) -> list[MemoryLink]:
    """Memory in place of every socket; filled when a ground station opens its links."""
    opened: list[MemoryLink] = []

    async def open_link(address: str | Address, on_frame: Callable[[Frame], None]) -> Link:
        where = parse_address(address) if isinstance(address, str) else address
        opened.append(MemoryLink(where, on_frame))
        return opened[-1]

    monkeypatch.setattr(ways, "open_link", open_link)
    return opened


def nasty_bytes(random: Random, size: int) -> bytes:
    """Bytes in which floats and whole numbers at the edges lie where fields may be."""
    filled = bytearray(random.randbytes(size))
    for place in range(0, size - 7, 8):
        match random.randrange(4):
            case 0:
                filled[place : place + 8] = struct.pack("<d", random.choice(NASTY))
            case 1:
                pair = (random.choice(WHOLE), random.choice(WHOLE))
                filled[place : place + 8] = struct.pack("<II", *pair)
            case 2:
                narrow = [n for n in NASTY if not math.isfinite(n) or abs(n) < 1e38]
                pair_f = (random.choice(narrow), random.choice(narrow))
                filled[place : place + 8] = struct.pack("<ff", *pair_f)
    return bytes(filled)


def tunnel_message(random: Random) -> dialect.Tunnel:
    size = random.choice((*SIZES, random.randrange(129)))
    payload = bytearray(nasty_bytes(random, size))
    kind = random.choice(
        (0, 0, 0, 0, 0, 0, 5, 60_001, 60_002, 60_012, BEARING_TYPE, BURST_TYPE)
    )
    if kind == 0 and random.random() < 0.6:  # a length that the command has
        command, size = random.choice(MESSAGES)
        payload = bytearray(command.to_bytes(4, "little") + nasty_bytes(random, size)[4:])
        if random.random() < 0.7:
            payload[4:8] = random.choice((2, 3, *WHOLE)).to_bytes(4, "little")[: size - 4]
    elif kind == BEARING_TYPE and random.random() < 0.6:
        size = BEARING_SIZE
        payload = bytearray(nasty_bytes(random, size))
    elif size >= 8 and random.random() < 0.95:
        payload[:4] = random.choice((*CommandId, random.randrange(40))).to_bytes(4, "little")
        if random.random() < 0.5:
            payload[4:8] = random.randrange(6).to_bytes(4, "little")
    if payload[:1] == b"\x07" and size >= 120 and random.random() < 0.7:
        payload[8:12] = (148_700_000).to_bytes(4, "little")
        payload[16:24] = struct.pack("<d", random.choice((*NASTY, *PLAUSIBLE)))
        payload[24:32] = struct.pack("<d", random.choice((*NASTY, *PLAUSIBLE)))
        payload[64 if size == 128 else 72] = random.randrange(5)
    if kind in (BEARING_TYPE, BURST_TYPE, 60_012) and payload:
        payload[0] = 1
    if kind == BURST_TYPE and size >= 24 and random.random() < 0.8:
        count = (size - 16) // 6
        payload[1:4] = bytes((count, 0, 0))
        del payload[16 + 6 * count :]
        size = len(payload)
    return dialect.Tunnel(
        target_system=random.choice((0, 254, 254, 1)),
        target_component=random.choice((0, 190, 190, 1)),
        payload_type=kind,
        payload_length=random.choice((size, size, size, random.randrange(256))),
        payload=bytes(payload),
    )


def hostile_frame(writers: list[FrameWriter], random: Random) -> bytes:
    message: Message = tunnel_message(random)
    if random.random() < 0.4:
        kind = random.choice(HEARD)
        message = kind.unpack(nasty_bytes(random, kind.LAYOUT.size))
        if isinstance(message, dialect.FileTransferProtocol):
            message.target_system, message.target_component = 254, 190
    frame = bytearray(random.choice(writers).encode(message))
    if random.random() < 0.2:
        frame[random.randrange(len(frame))] = random.randrange(256)
    return bytes(frame) if random.random() < 0.97 else random.randbytes(40)


def writers_of_all() -> list[FrameWriter]:
    drone = FrameWriter(1, 191)
    return [drone, drone, drone, FrameWriter(1, 1), FrameWriter(7, 191), FrameWriter(254, 190)]


def heartbeat() -> dialect.Heartbeat:
    return made.heartbeat()


def genuine_pulse(start_ns: int) -> dialect.Tunnel:
    pulse = made.pulse(start_ns, frequency_hz=148_700_000.0, snr_db=20.0, noise_psd=1e-9)
    payload = pulse_to_wire(PulsePose(pulse=pulse, pose=None)).encode()
    return made.tunnel(0, payload)


def is_among(start_ns: int, stored: Sequence[PulsePose]) -> bool:
    """Whether a pulse of that time is stored; the wire resolves 0.24 µs."""
    return any(abs(item.pulse.start_time_ns - start_ns) < 1000 for item in stored)


async def attack(links: list[MemoryLink], random: Random) -> None:
    """Let the station hear everything at once, with a drone between."""
    await until(lambda: links)
    writers = writers_of_all()
    links[0].hear(writers[0].encode(heartbeat()))
    for number in range(COUNT // 2):
        links[0].hear(hostile_frame(writers, random))
        if number % 100 == 0:
            await asyncio.sleep(0)


def collected_faults(faults: list[dict[str, Any]]) -> None:
    asyncio.get_running_loop().set_exception_handler(lambda _, fault: faults.append(fault))


def test_no_frame_makes_the_page_deaf(tmp_path: Path, links: list[MemoryLink]) -> None:
    clock = Clock.start()
    now_ns = clock.now_ns()
    faults: list[dict[str, Any]] = []

    async def main() -> None:
        collected_faults(faults)
        session = GroundSession(GroundStore(tmp_path), clock)
        listener = session.vehicle.feed.hub.listen()
        serving = asyncio.create_task(session.run())
        await attack(links, Random(20262))
        session.vehicle.begin_flight()
        links[0].hear(FrameWriter(1, 191).encode(genuine_pulse(now_ns)))
        await until(lambda: session.vehicle.flight.keeper.pulses)
        session.vehicle.flight.keeper.queue.commit()
        assert session.vehicle.flight.keeper.queue.fault is None
        await asyncio.sleep(1.2)  # an estimate of whatever was believed
        serving.cancel()
        with suppress(asyncio.CancelledError, UavrtError):
            await serving
        assert not listener.empty()

    asyncio.run(main())
    assert not faults
    assert links[0].counters.faults == 0
    newest = max(path for path in tmp_path.iterdir() if path.is_dir() and "flight" in path.name)
    assert is_among(now_ns, read_flight(newest).pulse_poses)


def test_no_frame_makes_the_station_without_a_page_deaf(
    tmp_path: Path, links: list[MemoryLink]
) -> None:
    now_ns = Clock.start().now_ns()
    faults: list[dict[str, Any]] = []
    lines: list[str] = []
    written: list[int] = []

    async def main() -> None:
        collected_faults(faults)
        settings = StationSettings(address="udpin://127.0.0.1:14550", directory=tmp_path)
        station = Station(settings, lambda event: lines.append(json_line(event)))
        serving = asyncio.create_task(station.run())
        await attack(links, Random(20263))
        before = station.pulses
        links[0].hear(FrameWriter(1, 191).encode(genuine_pulse(now_ns)))
        await until(lambda: station.pulses > before)
        written.append(station.pulses)
        station.stop()
        await serving

    asyncio.run(main())
    assert not faults
    assert links[0].counters.faults == 0
    assert any('"acknowledged"' in line for line in lines)
    stored = read_pulse_file(tmp_path / "pulses.jsonl")
    assert [len(stored)] == written, "what is stored is read back"
    assert is_among(now_ns, stored)
    assert len(stored) > COUNT // 1000, "hostile pulses, too: they had to be believed"
