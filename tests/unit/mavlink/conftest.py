"""A drone side, a simulated autopilot and free ports for the tests of links."""

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import replace

import pytest
from pulses import pulse_at

from uavrt import tunnel
from uavrt.clock import Clock
from uavrt.demo.programs import free_udp_port
from uavrt.errors import TunnelError
from uavrt.mavlink import Connection, Handlers, Peer, Priority
from uavrt.mavlink.ftp_server import FileServer
from uavrt.messages import AttitudeSample, Pose, PositionSample, PulsePose, Tag
from uavrt.simulation.fake_autopilot import AutopilotSettings, FakeAutopilot
from uavrt.tunnel.private import RECEIPT_TYPE, Receipt
from uavrt.tunnel.reliable import ReliableSender

THESIS_TAG = Tag(
    tag_id=2,
    frequency_hz=148_710_000.0,
    pulse_width_s=0.020,
    pulse_intervals_s=(1.254,),
    interval_uncertainty_s=0.060,
    interval_jitter_s=0.010,
    k=3,
    false_alarm_probability=0.005,
)


def turning_vehicle(rate_deg_s: float) -> Callable[[int], Pose]:
    """Pose of a vehicle that turns on the spot, nose north at whole multiples of 360°."""

    def pose(time_ns: int) -> Pose:
        seconds = (time_ns % 10**12) / 1e9
        half = math.radians(rate_deg_s * seconds) / 2
        return Pose(
            time_ns=time_ns,
            latitude_deg=35.178241,
            longitude_deg=-111.656587,
            altitude_amsl_m=2157.0,
            altitude_relative_m=50.0,
            quaternion_wxyz=(math.cos(half), 0.0, 0.0, math.sin(half)),
        )

    return pose


class DroneSide:
    """What the connection process does, with a supervisor that accepts every tag but id 0."""

    def __init__(self, clock: Clock) -> None:
        self.attitudes: list[AttitudeSample] = []
        self.positions: list[PositionSample] = []
        self.payloads: list[tuple[bytes, Peer]] = []
        self.tags: list[Tag] = []
        self.detecting = False
        handlers = Handlers(
            attitude=self.attitudes.append,
            position=self.positions.append,
            tunnel=self._command,
            private=self._private,
            ftp=self._ftp,
        )
        self._clock = clock
        self.connection = Connection(handlers, clock.now_ns)
        self.sender = ReliableSender[PulsePose](lambda p: tunnel.pulse_to_wire(p).encode())
        self.connection.tunnel.add_source(self.sender, Priority.PULSE)
        self._sent = 0
        self.files: FileServer | None = None

    def send_pulse(self, pulse_pose: PulsePose) -> None:
        self._sent += 1
        self.sender.add((self._sent, pulse_pose.pulse.start_time_ns), pulse_pose)
        self.connection.tunnel.wake()

    async def tick(self) -> None:
        """What the connection process does 20 times a second."""
        while True:
            present = self.connection.station_present
            self.sender.station_present(present, self._clock.now_ns())
            self.connection.tunnel.wake()
            await asyncio.sleep(0.05)

    def _ftp(self, payload: bytes, peer: Peer) -> None:
        now_ns = self._clock.now_ns()
        if self.files is not None:
            trip_s = self.files.receive(payload, peer, now_ns)
            if trip_s is not None:
                self.connection.tunnel.rate.acknowledged(trip_s, now_ns)

    def _private(self, payload_type: int, payload: bytes, peer: Peer) -> None:
        assert payload_type == RECEIPT_TYPE
        receipt = Receipt.decode(payload)
        now_ns = self._clock.now_ns()
        place = (peer.system_id, peer.component_id)
        self.sender.receipt(receipt.store, receipt.hashes, place, now_ns)
        self.connection.tunnel.rate.acknowledged(self.sender.fresh_trip_s, now_ns)

    def _command(self, payload: bytes, peer: Peer) -> None:
        self.payloads.append((payload, peer))
        accepted, text, generation = True, "", "G1"
        try:
            message = tunnel.decode(payload)
            generation = tunnel.generation_of(message) or "G1"
            if isinstance(message, tunnel.TagG0 | tunnel.TagG1):
                tag = tunnel.tag_from_wire(message)
                self.tags = [t for t in self.tags if t.tag_id != tag.tag_id] + [tag]
            self.detecting = payload[0] == tunnel.CommandId.START_DETECTION
        except TunnelError as error:
            accepted, text = False, error.message
        number = tunnel.acked_command_of(payload)
        if number is not None:
            ack = tunnel.ack_to_wire(
                number, accepted, text, "G0" if generation == "G0" else "G1"
            )
            self.connection.tunnel.send_tunnel(ack.encode(), Priority.ACK, peer)


class World:
    """A drone side behind a simulated autopilot, with a port for a ground station."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.ground_port = free_udp_port()
        self.companion_port = free_udp_port()
        self.drone = DroneSide(clock)
        self.settings = AutopilotSettings(
            companion=("127.0.0.1", self.companion_port),
            ground=("127.0.0.1", self.ground_port),
        )
        self.vehicle = turning_vehicle(30.0)
        self.autopilot: FakeAutopilot | None = None
        self.failure: BaseException | None = None

    @property
    def ground_address(self) -> str:
        return f"udpin://127.0.0.1:{self.ground_port}"

    @contextlib.asynccontextmanager
    async def flying(self, **changes: object) -> AsyncIterator[FakeAutopilot]:
        """Run autopilot and drone side while the block runs."""
        settings = replace(self.settings, **changes)  # type: ignore[arg-type]
        self.autopilot = FakeAutopilot(self.vehicle, settings, self.clock)
        address = f"udpin://127.0.0.1:{self.companion_port}"
        tasks = [
            asyncio.create_task(self.drone.connection.run(address)),
            asyncio.create_task(self.autopilot.run()),
            asyncio.create_task(self.drone.tick()),
        ]
        try:
            yield self.autopilot
        finally:
            for task in tasks:
                task.cancel()
            results = await asyncio.gather(*tasks, return_exceptions=True)
        for result in results:
            if isinstance(result, Exception):
                raise result


async def until(condition: Callable[[], object], timeout_s: float = 20.0) -> None:
    """Wait until something is so; the time limit only ends a broken test."""
    async with asyncio.timeout(timeout_s):
        while not condition():  # noqa: ASYNC110 - any condition, not one object's
            await asyncio.sleep(0.01)


def make_pulse(index: int, time_ns: int) -> PulsePose:
    pulse = pulse_at(
        time_ns,
        frequency_hz=148_710_000.0 + index,
        group_index=1 + index % 3,
        group_sequence=index // 3,
    )
    return PulsePose(pulse=pulse, pose=turning_vehicle(30.0)(time_ns))


@pytest.fixture(name="until")
def until_fixture() -> Callable[..., Awaitable[None]]:
    return until


@pytest.fixture(name="make_pulse")
def make_pulse_fixture() -> Callable[[int, int], PulsePose]:
    return make_pulse


@pytest.fixture
def world() -> World:
    return World(Clock.start())


@pytest.fixture
def thesis_tag() -> Tag:
    return THESIS_TAG
