"""One autopilot with the product on its companion link, a ground station and a pilot."""

import asyncio
import contextlib
import random
import secrets
from collections.abc import AsyncIterator, Callable, Coroutine, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec

from uavrt.config.settings import GuidanceSettings
from uavrt.core.clock import Clock
from uavrt.core.earth.attitude import from_euler_deg
from uavrt.core.errors import UavrtError
from uavrt.core.messages import Pose, PulsePose, SystemStatus
from uavrt.core.units import ns_from_s, s_from_ns
from uavrt.drone.status_reader import StatusReader
from uavrt.ground.link.drone_link import GroundLink
from uavrt.link.mavlink import dialect
from uavrt.link.tunnel.own_messages.motion_messages import MotionState
from uavrt.link.tunnel.own_messages.seal import read_key
from uavrt.simulation.demo.demo_programs import (
    DemoPaths,
    Program,
    drone_settings,
    free_udp_port,
)
from uavrt.simulation.scene.demo_world import search_scenario
from uavrt.simulation.scene.flown_path import PathWriter
from uavrt.simulation.scene.scenario_file import write_scenario
from uavrt_experiments.autopilots.builds import Build
from uavrt_experiments.autopilots.hand import Hand
from uavrt_experiments.autopilots.tap import Tap

SAMPLE_RATE_HZ = 375_000.0
"""Sample rate of the simulated radio [Hz]; detectors get the same pulses as at 3 MS/s, for an
eighth of the work."""
START_LEAD_S = 1.0
READY_S = 60.0
PATH_S = 0.04
BATTERY_WH, SPEED_M_S, FENCE_M = 3000.0, 5.0, 900.0


class RunningScene:
    """Running programs of a rehearsal; made by `running`."""

    def __init__(
        self, build: Build, work: Path, seed: int, logs: Path, stack: contextlib.AsyncExitStack
    ) -> None:
        self.build, self.work, self.rng = build, work, random.Random(seed)
        self.clock = Clock.start()
        self.scenario = search_scenario(seed)
        radio = replace(self.scenario.radio, sample_rate_hz=SAMPLE_RATE_HZ)
        self.scenario = replace(self.scenario, radio=radio).starting_at(
            self.clock.now_ns() + ns_from_s(START_LEAD_S)
        )
        home = self.scenario.home
        self.home = (home.latitude_deg, home.longitude_deg)
        self.states: list[tuple[float, MotionState]] = []
        self.pulses: list[PulsePose] = []
        self.companion: Tap
        self.hand: Hand
        self.link: GroundLink
        self._path = DemoPaths(directory=work, flights=work / "flights")
        self._logs, self._stack = logs, stack
        self._programs: list[Program] = []

    def _start(self, name: str, arguments: Sequence[str], **values: Any) -> None:
        made = Program(name, arguments, Path(f"{self._logs}, {name}.log"), **values)
        self._stack.push_async_callback(asyncio.to_thread, made.stop)
        self._programs.append(made)

    def check(self) -> None:
        """Raise `UavrtError` when a program has ended by itself."""
        for one in self._programs:
            one.check()

    async def start(self) -> None:
        """Start the autopilot, then the drone's side, then the ground station."""
        self._path.flights.mkdir()
        write_scenario(self.scenario, self._path.scenario)
        home = self.scenario.home
        place = (home.latitude_deg, home.longitude_deg, home.altitude_amsl_m)
        directory = self.work / "autopilot"
        directory.mkdir()
        started = self.build.started(directory, place, self._path.scenario)
        ports = free_udp_port(), free_udp_port()
        ground = Tap(started.ground, started.ground_port, ("127.0.0.1", ports[0]), self.clock)
        self.companion = Tap(
            started.companion, started.companion_port, ("127.0.0.1", ports[1]), self.clock
        )
        for tap in (ground, self.companion):
            tap.open()
            self._stack.callback(tap.close)
        self.hand = Hand(ground, self.build.flavour)
        self.hand.check = self.check
        self._serve(self.hand.live())
        self._start(
            "autopilot",
            started.command,
            interpreter=("env", "-C", str(directory)),
            environment=started.environment,
        )
        writer, last = PathWriter(self._path.flown), [0.0]

        def moved(time_s: float, reported: dialect.GlobalPositionInt) -> None:
            if time_s - last[0] >= PATH_S:
                last[0] = time_s
                writer.add([(_pose(time_s, reported), reported.hdg / 100.0)])

        self.hand.moved = moved
        settings = drone_settings(self.scenario, self._path, ports[1], flies=True)
        key = self.work / "command.key"
        key.write_text(secrets.token_hex(32))
        key.chmod(0o600)
        settings = replace(
            settings,
            mavlink=replace(settings.mavlink, key_file=str(key)),
            guidance=GuidanceSettings(
                enabled=True,
                may_take_off=True,
                battery_wh=BATTERY_WH,
                speed_m_s=SPEED_M_S,
                fence_m=FENCE_M,
            ),
        )
        self._start(
            "supervisor", ("uavrt.drone.supervisor", msgspec.json.encode(settings).decode())
        )
        self.link = GroundLink(self.clock.now_ns, on_event=self._event, key=read_key(key))
        self._serve(self.link.run(f"udpin://127.0.0.1:{ports[0]}"))
        await self.hand.boot(READY_S)
        await self.link.wait_for_drone(READY_S)

    def _serve(self, work: Coroutine[object, object, None]) -> None:
        task = asyncio.create_task(work)

        async def end() -> None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

        self._stack.push_async_callback(end)

    def _event(self, event: object) -> None:
        if isinstance(event, MotionState):
            self.states.append((s_from_ns(self.clock.now_ns()), event))
        elif isinstance(event, PulsePose):
            self.pulses.append(event)

    @property
    def now_s(self) -> float:
        """Present time on the clock of the stored frames [s]."""
        return s_from_ns(self.clock.now_ns())

    @property
    def standing(self) -> str:
        """State of the order, as last reported by the drone."""
        return self.states[-1][1].standing if self.states else "out"

    def pid_of(self, process: str) -> int:
        """Process id of one of the drone's processes, from its supervisor's status."""
        reader = StatusReader(self._path.status_socket, READY_S, self.check)
        try:
            for _ in range(20):
                for _, record in reader.read(0.2):
                    if isinstance(record, SystemStatus):
                        for one in record.processes:
                            if one.process == process and one.pid:
                                return one.pid
        finally:
            reader.close()
        raise UavrtError(f"the drone's {process} does not run")


@contextlib.asynccontextmanager
async def running(
    build: Build, work: Path, seed: int, logs: Path, say: Callable[[str], None]
) -> AsyncIterator[RunningScene]:
    """Context manager that runs a scene; the names of its programs' logs begin with `logs`."""
    say(f"{build.name} starts")
    async with contextlib.AsyncExitStack() as stack:
        scene = RunningScene(build, work, seed, logs, stack)
        await scene.start()
        yield scene


def _pose(time_s: float, reported: dialect.GlobalPositionInt) -> Pose:
    return Pose(
        time_ns=ns_from_s(time_s),
        latitude_deg=reported.lat / 1e7,
        longitude_deg=reported.lon / 1e7,
        altitude_amsl_m=reported.alt / 1e3,
        altitude_relative_m=reported.relative_alt / 1e3,
        quaternion_wxyz=from_euler_deg(reported.hdg / 100.0, 0.0, 0.0),
    )
