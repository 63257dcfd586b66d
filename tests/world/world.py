"""One world in virtual time: drone, autopilot, radio and ground station in one event loop.

Everything between the animal and the operator is the product: supervisor, mission, recorder,
connection, guide, motion handler and authority, ground link and session. Simulated are the
autopilot (`uavrt.simulation`), the radio link (`Relay`) and what the detectors find. Under
`asyncio.run` of the unit tests a wait costs nothing; in a real loop the same world runs in
real time.

`tests/drivers/flown.py` and `motion_handled.py` fly the same vehicle without wires, loop or
processes, at thousands of steps in a second, to test the rules of authority and orders. This
world tests whether the parts are connected. Both use the animals of `searched.py`.

::

    world = World(tmp_path)
    async with world.flying([(20.0, world.radio_cut), (30.0, world.radio_back)]):
        async with world.station() as (link, events):
            await link.upload_tags(TAGS)
            await link.start_detection()
"""

import asyncio
import contextlib
import gc
import itertools
import math
import random
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import numpy as np
import pytest
from drone_computer import DroneComputer
from pulses import pulse_at
from relay import Relay
from searched import Animal, pulse, report, snr_db
from until import until_async

from uavrt.config.settings import (
    BearingSettings,
    GuidanceSettings,
    MavlinkSettings,
    RadioSettings,
    RecordingSettings,
    Settings,
)
from uavrt.core.clock import Clock
from uavrt.core.messages import Beep, Command, Health, Pose, Pulse, Tag, VehicleReport
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.drone.ipc.topics import decode_record
from uavrt.drone.supervisor.supervisor_program import start_commands
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.session import GroundSession
from uavrt.ground.store.ground_settings import GroundStore
from uavrt.guidance.control.authority import ControlStage
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt.simulation.vehicle.fake_autopilot import AutopilotSettings, FakeAutopilot

HOME = (35.178241, -111.656587)
AUTOPILOT_S = 0.05
"""Between two turns of the autopilot; its vehicle moves in steps of 0.02 s."""
DETECTOR_S = 0.1
FAINTEST_DB = 9.2
THESIS_TAG = made.tag(
    2,
    148_710_000.0,
    interval_uncertainty_s=0.060,
    interval_jitter_s=0.010,
    k=3,
    false_alarm_probability=0.005,
)
until = until_async
Script = Sequence[tuple[float, Callable[[], object]]]
"""Faults and hands: seconds after the start, and what happens then."""


def turning_vehicle(rate_deg_s: float) -> Callable[[int], Pose]:
    """Pose of a vehicle that turns on the spot, nose north at whole multiples of 360°."""

    def pose(time_ns: int) -> Pose:
        half = math.radians(rate_deg_s * ((time_ns % 10**12) / 1e9)) / 2
        return made.pose(
            time_ns,
            HOME[0],
            HOME[1],
            altitude_amsl_m=2157.0,
            altitude_relative_m=50.0,
            quaternion_wxyz=(math.cos(half), 0.0, 0.0, math.sin(half)),
        )

    return pose


def tag_of(number: int, animal: Animal) -> Tag:
    """Tag of the animal with this place in the list: 2, 4, 6 …"""
    return made.tag(2 * number + 2, 148_700_000.0 + 10_000.0 * number, animal.interval_s)


class World:
    """A drone behind its autopilot, and a port for a ground station.

    `directory`: for the drone's flights, and the ground station's.
    `animals`: their places are in metres from the drone's start; each wears the tag of
    `tag_of`.
    `ground_port`: where the ground station listens.
    `mavlink`, `guidance`: settings of the drone that differ from the usual ones; with
    `guidance` it takes orders.
    `flights`: the drone's directory of flights.
    `vehicle`: pose of the vehicle at a time [ns]; it turns on the spot unless it flies.
    `**autopilot`: what differs of `AutopilotSettings`.
    """

    def __init__(
        self,
        directory: Path,
        *,
        animals: Sequence[Animal] = (),
        ground_port: int | None = None,
        mavlink: dict[str, Any] | None = None,
        guidance: dict[str, Any] | None = None,
        flights: Path | None = None,
        vehicle: Callable[[int], Pose] | None = None,
        **autopilot: Any,
    ) -> None:
        self.directory, self.animals = directory, list(animals)
        self.clock = Clock.start()
        self.ground_port = free_udp_port() if ground_port is None else ground_port
        self.companion_port = free_udp_port()
        self.radio = Relay(self.ground_port, seed=autopilot.get("seed", 1))
        self.vehicle = vehicle or turning_vehicle(0.0 if autopilot.get("flies") else 30.0)
        self.settings = AutopilotSettings(
            companion=("127.0.0.1", self.companion_port),
            ground=("127.0.0.1", self.radio.port),
            **autopilot,
        )
        self.drone_settings = Settings(
            radio=RadioSettings(center_frequency_hz=148_700_000.0),
            recording=RecordingSettings(directory=str(flights or directory / "drone")),
            mavlink=MavlinkSettings(
                address=f"udpin://127.0.0.1:{self.companion_port}",
                **{"attitude_rate_hz": 10.0 if guidance is not None else 50.0}
                | (mavlink or {}),
            ),
            bearings=BearingSettings(antenna="RA-23K"),
            guidance=GuidanceSettings(enabled=guidance is not None, **(guidance or {})),
        )
        self.tags = [tag_of(number, one) for number, one in enumerate(self.animals)]
        self.autopilot = FakeAutopilot(self.vehicle, self.settings, self.clock)
        self.computer: DroneComputer
        self.to_find: deque[Pulse] = deque()
        """Pulses that the detectors find next, besides the animals'."""
        self.beeps: deque[Beep] = deque()
        """What the receiver finds next without knowing any tag."""
        self.searched: dict[int, Tag] = {}
        """Tags of the detectors that run."""
        self.records: list[tuple[str, Any]] = []
        """What passed the supervisor, but for what comes many times a second."""
        self.unkept = {"vehicle", "vehicle_request", "poses", "search_report", "course"}
        self.health: dict[str, Health] = {}
        self._vehicle_line = b""
        self._numbers = itertools.count()
        self._rng = np.random.default_rng(autopilot.get("seed", 1))

    # ------------------------------------------------------------------ life

    @contextlib.asynccontextmanager
    async def flying(self, script: Script = (), **changes: Any) -> AsyncIterator[FakeAutopilot]:
        """Live while the block runs, and do what the script says.

        `script`: faults and hands.
        `**changes`: of the autopilot's settings.
        """
        self.settings = replace(self.settings, **changes)
        self.autopilot = FakeAutopilot(self.vehicle, self.settings, self.clock)
        numbers = random.Random(self.settings.seed)
        with pytest.MonkeyPatch.context() as patch:
            for module in (
                "uavrt.drone.processes.guide",
                "uavrt.ground.link.motions.motion_requests",
            ):
                patch.setattr(f"{module}.secrets.randbits", numbers.getrandbits)
            async with self.alive(script):
                yield self.autopilot

    @contextlib.asynccontextmanager
    async def alive(self, script: Script = ()) -> AsyncIterator[None]:
        """Run the drone during the block, with unpredictable order numbers."""
        gc.freeze()  # what is there stays: each process collects garbage now and then
        self.computer = DroneComputer(
            self.drone_settings, self._detect, self._passed, self._receive
        )
        self.computer.start()
        flying = asyncio.create_task(self._fly())
        doing = asyncio.create_task(self._play(script))
        try:
            async with self.radio.running():
                yield
                for task in (flying, doing):
                    if task.done():
                        task.result()
                await self.computer.stop()
        finally:
            failures = self.computer.launcher.failures
            for task in (flying, doing):
                task.cancel()
            await asyncio.gather(flying, doing, return_exceptions=True)
            if failures:
                raise failures[0]

    async def _play(self, script: Script) -> None:
        loop = asyncio.get_running_loop()
        start_s = loop.time()
        for at_s, action in sorted(script, key=lambda one: one[0]):
            await asyncio.sleep(start_s + at_s - loop.time())
            done = action()
            if isinstance(done, Awaitable):
                await done

    async def _fly(self) -> None:
        """Serve the autopilot; a new one that took its place goes on."""
        self.autopilot.open()
        try:
            while True:
                one = self.autopilot
                one.step(self.clock.now_ns())
                busy = len(one.companion.ring) or len(one.ground.ring)
                await asyncio.sleep(0.004 if busy else AUTOPILOT_S)
        finally:
            self.autopilot.close()

    # ------------------------------------------------------------ the drone side

    @property
    def mission(self) -> Any:
        """What the operator asked for, as the drone has it."""
        return self.computer.supervisor.mission

    @property
    def standing(self) -> ControlStage:
        """Our say over the vehicle, as the motion handler at the link has it."""
        return ControlStage(self.vehicle_report.standing)

    @property
    def vehicle_report(self) -> VehicleReport:
        """What the motion handler last reported of the vehicle."""
        report: VehicleReport = decode_record(self._vehicle_line)[1]
        return report

    def counter(self, name: str, process: str = "connection") -> float:
        """What a process last counted."""
        return self.health[process].counters[name] if process in self.health else 0.0

    def of(self, kind: type[Any]) -> list[Any]:
        """Records of a kind that have passed the supervisor."""
        return [record for _, record in self.records if isinstance(record, kind)]

    def detect(self, *tags: Tag) -> None:
        """Begin a flight as `uavrt run --tags` does, without a ground station."""
        self._command(start_commands(tags or (THESIS_TAG,)))

    def take_tags(self, *tags: Tag) -> None:
        """Take tags as if a ground station had sent them."""
        self._command(start_commands(tags)[:-1])

    def _command(self, commands: Sequence[Command]) -> None:
        for command in commands:
            numbered = replace(command, request_id=next(self._numbers))
            reply = self.computer.supervisor.command(numbered)
            assert reply.accepted, reply.message

    def find_pulse(self, number: int) -> None:
        """Let a detector find a pulse, `number` Hz above the thesis tag's frequency."""
        self.to_find.append(
            pulse_at(
                self.clock.now_ns() - 100_000_000 + number,
                frequency_hz=THESIS_TAG.frequency_hz + number,
                group_index=1 + number % 3,
                group_sequence=number // 3,
            )
        )

    def _passed(self, line: bytes) -> None:
        if line.startswith(b"vehicle\t"):
            self._vehicle_line = line
        if line[: line.index(b"\t")].decode() in self.unkept:
            return
        topic, record = decode_record(line)
        if isinstance(record, Health):
            self.health[record.process] = record
        else:
            self.records.append((topic, record))

    async def _detect(self, frame: ProcessFrame) -> None:
        """Find what the detectors of these tags would find, and report what they searched."""
        report_s = 0.0
        loop = asyncio.get_running_loop()
        self.searched.update((tag.tag_id, tag) for tag in frame.assignment.tags)
        while frame.running:
            frame.receive()
            while self.to_find:
                frame.send("pulse", self.to_find.popleft())
            self._beep(frame)
            if loop.time() >= report_s:
                report_s = loop.time() + 1.0
                for tag in frame.assignment.tags:
                    frame.send("search_report", report(tag.tag_id, frame.clock.now_ns()))
            frame.report("detecting")
            await asyncio.sleep(DETECTOR_S)

    async def _receive(self, frame: ProcessFrame) -> None:
        """Serve as a receiver whose samples always flow; the detector needs none."""
        while frame.running:
            frame.receive()
            while self.beeps:
                frame.send("beep", self.beeps.popleft())
            frame.report("receiving")
            await asyncio.sleep(0.2)

    def _beep(self, frame: ProcessFrame) -> None:
        now_ns = frame.clock.now_ns()
        for tag, animal in zip(self.tags, self.animals, strict=True):
            searched = any(one.tag_id == tag.tag_id for one in frame.assignment.tags)
            if not searched or now_ns / 1e9 < animal.next_s:
                continue
            animal.next_s = now_ns / 1e9 + animal.interval_s
            found_db = snr_db(animal, self.flown) + 2.0 * float(self._rng.normal())
            if found_db > FAINTEST_DB:
                frame.send("pulse", pulse(tag, now_ns - 50_000_000, found_db))

    @property
    def flown(self) -> Any:
        """The vehicle that flies by itself."""
        assert self.autopilot.flown is not None
        return self.autopilot.flown.vehicle

    # ------------------------------------------------------------ the ground side

    @property
    def ground_address(self) -> str:
        return f"udpin://127.0.0.1:{self.ground_port}"

    @contextlib.asynccontextmanager
    async def station(self, **options: Any) -> AsyncIterator[tuple[GroundLink, list[Any]]]:
        """A ground station's link, and what it receives; waits for the drone."""
        events: list[Any] = []
        link = GroundLink(self.clock.now_ns, on_event=events.append, **options)
        task = asyncio.create_task(link.run(self.ground_address))
        try:
            await link.wait_for_drone(30.0)
            yield link, events
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    @contextlib.asynccontextmanager
    async def session(self, **options: Any) -> AsyncIterator[GroundSession]:
        """A ground station without its web server; waits for the drone."""
        store = GroundStore(self.directory / "ground")
        store.settings = replace(store.settings, address=self.ground_address)
        session = GroundSession(store, self.clock, **options)
        task = asyncio.create_task(session.run())
        try:
            await until(lambda: session.vehicle.situation().drone_present)
            yield session
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    # ------------------------------------------------------------ faults and hands

    def radio_cut(self) -> None:
        self.radio.cut = True

    def radio_back(self) -> None:
        self.radio.cut = False

    def restart_autopilot(self) -> None:
        self.autopilot.reboot()

    def kill(self, process: str) -> None:
        """Kill a process of the drone; its supervisor starts another one."""
        self.computer.kill(process)
