"""The real connection process in this program, with the test in the supervisor's place."""

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest
from pulses import pulse_at
from relay import Relay
from some import some

from uavrt.config.settings import MavlinkSettings, RecordingSettings, Settings
from uavrt.core.clock import Clock
from uavrt.core.messages import Command, FlightInfo, Health, Pose, Pulse, PulsePose, Recorded
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.drone.ipc.record_link import LineBuffer, RecordSocket
from uavrt.drone.ipc.tag_assignment import Assignment
from uavrt.drone.ipc.topics import decode_record, encode_record
from uavrt.drone.processes.connection import ConnectionProcess
from uavrt.ground.link.drone_link import GroundLink
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt.simulation.vehicle.fake_autopilot import AutopilotSettings, FakeAutopilot
from world import turning_vehicle

turning = turning_vehicle(30.0)


def make_pulse(number: int, time_ns: int) -> Pulse:
    return pulse_at(
        time_ns,
        frequency_hz=148_710_000.0 + number,
        group_index=1 + number % 3,
        group_sequence=number // 3,
    )


class Bay:
    """Connection process, simulated autopilot, and what the supervisor would see."""

    def __init__(self, directory: Path, **mavlink: Any) -> None:
        self.clock = Clock.start()
        self.companion_port, self.ground_port = free_udp_port(), free_udp_port()
        self.settings = Settings(
            mavlink=MavlinkSettings(
                address=f"udpin://127.0.0.1:{self.companion_port}", **mavlink
            ),
            recording=RecordingSettings(directory=str(directory)),
        )
        self.assignment = Assignment(
            process="connection",
            settings=self.settings,
            clock_offset_ns=self.clock.offset_ns,
            flight=None,
        )
        self.autopilot_settings = AutopilotSettings(
            companion=("127.0.0.1", self.companion_port), ground=("127.0.0.1", self.ground_port)
        )
        self.autopilot: FakeAutopilot | None = None
        self.records: list[tuple[str, Any]] = []
        self.commands: list[Command] = []
        self.refusals: dict[str, str] = {}
        """What is said to commands of these names."""
        self.recorder_quick = True
        """A pulse is said to be recorded as soon as it has its pose."""
        self.health: Health | None = None
        self.process: ConnectionProcess | None = None
        self.relay: Relay | None = None
        self._sock: socket.socket | None = None

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator["Bay"]:
        """Run it while the block runs."""
        self._sock, theirs = socket.socketpair()
        self._sock.setblocking(False)
        loop = asyncio.get_running_loop()
        frame = ProcessFrame(RecordSocket(theirs), self.assignment)
        self.process = ConnectionProcess(frame)
        self.autopilot = FakeAutopilot(turning, self.autopilot_settings, self.clock)
        lines = LineBuffer()

        def read() -> None:
            assert self._sock is not None
            for line in lines.feed(self._sock.recv(1 << 20)):
                self._take(*decode_record(line))

        loop.add_reader(self._sock, read)
        tasks = [
            asyncio.create_task(self.process.run()),
            asyncio.create_task(self.autopilot.run()),
        ]
        try:
            yield self
            assert not tasks[0].done()
        finally:
            frame.stop()
            with contextlib.suppress(Exception):
                await asyncio.wait_for(asyncio.shield(tasks[0]), 10.0)
            for task in tasks:
                task.cancel()
            results = await asyncio.gather(*tasks, return_exceptions=True)
            loop.remove_reader(self._sock)
            loop.remove_reader(theirs.fileno())
            self._sock.close()
            theirs.close()
        for result in results:
            if isinstance(result, Exception):
                raise result

    def deliver(self, topic: str, record: object) -> None:
        """Send the process a record as its supervisor does."""
        some(self._sock).sendall(encode_record(topic, record))

    def flight_info(self, directory: Path) -> FlightInfo:
        return made.flight_info(
            directory, start_time_ns=self.clock.now_ns(), clock_offset_ns=self.clock.offset_ns
        )

    def begin_flight(self, directory: Path) -> None:
        self.deliver("flight", self.flight_info(directory))

    def send_pulse(self, number: int) -> None:
        """A detector's pulse, `number` Hz above the tag's nominal frequency."""
        self.deliver("pulse", make_pulse(number, self.clock.now_ns() - 100_000_000 + number))

    @contextlib.asynccontextmanager
    async def ground_station(
        self, *more: str, radio: bool = True, **options: Any
    ) -> AsyncIterator[tuple[GroundLink, list[Any]]]:
        """A ground station on the radio, and on more links, which it prefers."""
        events: list[Any] = []
        link = GroundLink(self.clock.now_ns, on_event=events.append, **options)
        by_radio = (f"udpin://127.0.0.1:{self.ground_port}",) if radio else ()
        task = asyncio.create_task(link.run(*more, *by_radio))
        try:
            await link.wait_for_drone(20.0)
            yield link, events
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    def vehicle(self, time_ns: int) -> Pose:
        """The vehicle's true pose at a time of the clock that it was started with."""
        return turning(time_ns)

    def recorded_flight(self, directory: Path, numbers: range) -> Path:
        """A flight that has ended, with pulses that nobody has."""
        pulses = [make_pulse(n, self.clock.now_ns() - 10**9 * (100 - n)) for n in numbers]
        unposed = [PulsePose(pulse=pulse, pose=None) for pulse in pulses]
        return made.flight(self.flight_info(directory), pulse_poses=unposed)

    def last_flights(self, *directories: Path) -> None:
        """Have the process told of flights that have ended."""
        self.assignment = replace(self.assignment, last_flights=(*map(str, directories),))

    def counter(self, name: str) -> float:
        return some(self.process)._counters()[name]

    def _take(self, topic: str, record: object) -> None:
        """Be recorder and supervisor: what was recorded comes back, every command is taken."""
        self.records.append((topic, record))
        if isinstance(record, PulsePose) and self.recorder_quick:
            self.deliver("recorded", Recorded(pulses=(record.pulse.key,)))
        elif isinstance(record, Command):
            self.commands.append(record)
            refusal = self.refusals.get(record.name)
            reply = made.reply(record, refusal or "", accepted=refusal is None)
            self.deliver("command_reply", reply)
        elif isinstance(record, Health):
            self.health = record


@pytest.fixture
def bay(tmp_path: Path) -> Bay:
    return Bay(tmp_path)


@pytest.fixture
def make_bay(tmp_path: Path) -> Callable[[], Bay]:
    """Bays to be made within a loop, by its clock."""
    return lambda: Bay(tmp_path)


@pytest.fixture
def two_link_bay(tmp_path: Path) -> Bay:
    """With a link over Wi-Fi as well; `relay` is the stretch between."""
    port = free_udp_port()
    bay = Bay(tmp_path, direct_links=(f"udpin://127.0.0.1:{port}",))
    bay.relay = Relay(port)
    return bay
