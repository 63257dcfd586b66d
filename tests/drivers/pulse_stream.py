"""A drone that streams pulses to a ground station's process, and that process, to be killed."""

import asyncio
import resource
import select
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import made
from pulses import pulse_at

from uavrt.core.clock import Clock
from uavrt.core.messages import PulseKey, PulsePose
from uavrt.flight.logs.pulse_files import read_pulse_file
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.link.vehicles.vehicle_identity import DRONE_COMPONENT
from uavrt.ground.station import Station, StationSettings
from uavrt.ground.web.page_program import PageSettings, PageStation
from uavrt.ground.web.server import ServerSettings
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import FrameParser, FrameWriter
from uavrt.link.mavlink.message import Message
from uavrt.link.tunnel.generations.g1 import PulseG1
from uavrt.link.tunnel.own_messages.private import RECEIPT_TYPE, Receipt, payload_hash
from uavrt.link.tunnel.tunnel_records import pulse_from_wire, pulse_to_wire

REPEAT_S = 0.4
BEAT_S = 0.3


def serve(kind: str, port: int, directory: Path) -> None:
    """Be a ground station, with a page or headless."""
    address = f"udpin://127.0.0.1:{port}"
    station: PageStation | Station
    if kind == "page":
        server = ServerSettings(port=0)
        settings = PageSettings(directory=directory, address=address, server=server)
        station = PageStation(settings, lambda _event: None)
    else:
        station = Station(StationSettings(directory=directory, address=address), lambda _: None)
    asyncio.run(station.run())


class StreamingDrone:
    """Sends each pulse until it is acknowledged, as the drone side does."""

    def __init__(self, port: int, seed: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._there = ("127.0.0.1", port)
        self._parser, self._writer = FrameParser(), FrameWriter(1, DRONE_COMPONENT)
        self._next_ns = Clock.start().now_ns() - 10**9 + seed
        self._beat_at_s = 0.0
        self.keys: dict[int, PulseKey] = {}
        """Of each pulse that was sent, by its payload's hash."""
        self._open: dict[int, tuple[bytes, float]] = {}
        self.acknowledged: set[int] = set()

    def close(self) -> None:
        self._socket.close()

    def detect(self) -> None:
        """Have one more pulse to send."""
        self._next_ns += 31_000_000
        sent = pulse_to_wire(PulsePose(pulse=pulse_at(self._next_ns), pose=None))
        payload = sent.encode()
        assert isinstance(sent, PulseG1)
        received = pulse_from_wire(sent, None)
        assert isinstance(received, PulsePose)
        number = payload_hash(payload)
        self.keys[number] = received.pulse.key
        self._open[number] = (payload, 0.0)

    def run(self, wait_s: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Send and listen for a time, or until something holds; whether it does."""
        end_s = time.monotonic() + wait_s
        while (now_s := time.monotonic()) < end_s:
            if until():
                return True
            if now_s >= self._beat_at_s:
                self._beat_at_s = now_s + BEAT_S
                self._send(made.heartbeat())
            for number, (payload, sent_s) in list(self._open.items()):
                if now_s - sent_s >= REPEAT_S:
                    self._open[number] = (payload, now_s)
                    self._send(_tunnel(payload))
            if select.select([self._socket], [], [], 0.005)[0]:
                self._listen()
        return until()

    def all_acknowledged(self) -> bool:
        """Whether every pulse is."""
        return not self._open

    def _send(self, message: Message) -> None:
        with suppress(OSError):  # nobody is there yet
            self._socket.sendto(self._writer.encode(message), self._there)

    def _listen(self) -> None:
        with suppress(ConnectionError):
            for frame in self._parser.feed(self._socket.recv(2048)):
                message = frame.message()
                if isinstance(message, dialect.Tunnel) and message.payload_type == RECEIPT_TYPE:
                    receipt = Receipt.decode(message.payload[: message.payload_length])
                    for number in receipt.hashes:
                        self._open.pop(number, None)
                        self.acknowledged.add(number)


def _tunnel(payload: bytes) -> dialect.Tunnel:
    return made.tunnel(0, payload)


def limit_files(pid: int, most_bytes: int) -> None:
    """Let a process write no file beyond a size, as a full disk does."""
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (most_bytes, resource.RLIM_INFINITY))


def stored_keys(directory: Path) -> list[PulseKey]:
    """Pulses in all flights of a ground station's directory."""
    flights = (path.parent for path in directory.glob("*/flight.sqlite"))
    return [one.pulse.key for each in flights for one in read_flight(each).pulse_poses]


def line_keys(directory: Path) -> list[PulseKey]:
    """Pulses in the lines of a station without a page."""
    return [one.pulse.key for one in read_pulse_file(directory / "pulses.jsonl")]
