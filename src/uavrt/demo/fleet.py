"""``uavrt demo --drones``: several simulated drones, one ground station with all pages."""

import shutil
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from uavrt.clock import Clock, cpu_s
from uavrt.config import write_tags
from uavrt.demo.programs import DemoPaths, Program, drone_settings, free_udp_port
from uavrt.demo.run import (
    DRAIN_TIMEOUT_S,
    READY_TIMEOUT_S,
    REFRESH_S,
    START_LEAD_S,
    not_started,
    phase_of,
)
from uavrt.demo.summary import DemoSummary, summarize_tag
from uavrt.demo.watch import RECEIVER, samples_lost
from uavrt.demo.workplace import require_free_port, workplace
from uavrt.ground.store import read_ground_pulses
from uavrt.messages import Pulse, SystemStatus
from uavrt.monitor import StatusReader
from uavrt.recording import read_flight, require_writable
from uavrt.simulation import Scenario, World, write_scenario
from uavrt.units import NANOSECONDS_PER_SECOND, ns_from_s

SAY_EVERY_S = 10.0


@dataclass(slots=True)
class _Drone:
    """One of the drones: its world's file, programs and what it has told."""

    system_id: int
    scenario: Scenario
    paths: DemoPaths
    programs: list[Program]
    reader: StatusReader
    status: SystemStatus | None = None
    flight_directory: str = ""
    detected: dict[int, int] = field(default_factory=dict)

    @property
    def heard_samples(self) -> bool:
        """Whether there is something to account for."""
        known = () if self.status is None else self.status.processes
        return bool(self.flight_directory) and any(
            one.process == RECEIVER and bool(one.counters.get("last_sample_ns"))
            for one in known
        )

    def check(self) -> None:
        for program in self.programs:
            program.check()


class FleetDemo:
    """One flight of several drones on this machine.

    Parameters
    ----------
    scenarios : sequence of Scenario
        World of each drone: the same animals, another flight.
    flight_dir : Path
        Each drone's flight directory is made below `drone-NUMBER` in it, the ground's in
        `ground`.
    page_port : int
        0 for any free one.
    say : callable
        Takes a line for the person at the terminal.
    on_page : callable
        Called with the page's address when it is there.
    """

    def __init__(
        self,
        *,
        scenarios: Sequence[Scenario],
        flight_dir: Path,
        page_port: int,
        say: Callable[[str], None],
        on_page: Callable[[str], None],
    ) -> None:
        self._scenarios, self._duration_s = scenarios, scenarios[0].duration_s
        self._flight_dir, self._page_port = flight_dir, page_port
        self._say, self._on_page = say, on_page
        self._stack = ExitStack()
        self._drones: list[_Drone] = []
        self._delivered = 0

    def run(self) -> dict[int, DemoSummary]:
        """Fly once; what came of it by each drone's system number.

        Raises
        ------
        UavrtError
            A program ended by itself or did not get ready; the text says why.
        """
        with self._stack:
            self._start()
            self._fly_until_told()
            self._stop()
            return {one.system_id: self._summary(one) for one in self._drones}

    def _start(self) -> None:
        require_writable(self._flight_dir)
        require_free_port(self._page_port)
        work = self._stack.enter_context(workplace("uavrt-fleet-"))
        self._begun_ns = Clock.start().now_ns()
        self._start_ns = self._begun_ns + ns_from_s(START_LEAD_S)
        ground_port = free_udp_port()
        for number, scenario in enumerate(self._scenarios, start=1):
            started = scenario.starting_at(self._start_ns)
            self._drones.append(self._drone(number, started, work, ground_port))
        tags = work / "tags.toml"
        write_tags(tags, self._scenarios[0].tags)
        further = [("--vehicle", str(one.system_id)) for one in self._drones[1:]]
        self._ground_directory = self._flight_dir.resolve() / "ground"
        self._ground = self._program(
            work / "ground.log",
            "uavrt.cli",
            *("ground", "--page", "--no-browser", "--port", str(self._page_port)),
            *("--mavlink", f"udpin://127.0.0.1:{ground_port}", "--tags", str(tags)),
            *("--start", "--json", "-o", str(self._ground_directory)),
            *(word for pair in further for word in pair),
        )

    def _drone(self, number: int, scenario: Scenario, work: Path, ground_port: int) -> _Drone:
        """Start a drone side and its autopilot."""
        own = work / f"drone-{number}"
        own.mkdir()
        paths = DemoPaths(directory=own, flights=self._flight_dir.resolve() / f"drone-{number}")
        paths.flights.mkdir(parents=True, exist_ok=True)
        write_scenario(scenario, paths.scenario)
        companion = free_udp_port()
        settings = drone_settings(scenario, paths, companion)
        programs = [
            self._program(
                own / "autopilot.log",
                "uavrt.simulation.autopilot",
                *("--scenario", str(paths.scenario), "--system-id", str(number)),
                *("--companion", f"127.0.0.1:{companion}"),
                *("--ground", f"127.0.0.1:{ground_port}"),
            ),
            self._program(
                own / "supervisor.log",
                "uavrt.supervisor",
                msgspec.json.encode(settings).decode(),
            ),
        ]

        def check() -> None:
            for program in programs:
                program.check()

        reader = StatusReader(paths.status_socket, READY_TIMEOUT_S, check)
        self._stack.callback(reader.close)
        return _Drone(number, scenario, paths, programs, reader)

    def _program(self, log: Path, *arguments: str) -> Program:
        program = Program(log.stem, arguments, log)
        self._stack.callback(program.stop)
        return program

    # ------------------------------------------------------------------- flight

    def _fly_until_told(self) -> None:
        """Fly to the end, or until Ctrl-C once there is something to account for."""
        try:
            self._fly()
        except KeyboardInterrupt:
            if not all(one.heard_samples for one in self._drones):
                raise
            elapsed_ns = Clock.start().now_ns() - self._start_ns
            self._duration_s = round(elapsed_ns / NANOSECONDS_PER_SECOND, 1)

    def _fly(self) -> None:
        clock = Clock.start()
        deadline_s = time.monotonic() + READY_TIMEOUT_S
        end_ns = self._start_ns + ns_from_s(self._duration_s)
        said_s = 0.0
        while clock.now_ns() < end_ns:
            self._tick()
            elapsed_s = (clock.now_ns() - self._start_ns) * 1e-9
            if elapsed_s - said_s >= SAY_EVERY_S:
                said_s = elapsed_s
                self._tell(elapsed_s)
            silent = [one.system_id for one in self._drones if not one.flight_directory]
            if silent and time.monotonic() > deadline_s:
                raise not_started(self._ground, f" on drone {silent[0]}")

    def _tick(self, *, check: bool = True) -> None:
        if check:
            self._ground.check()
        for event in self._ground.new_events():
            if event.get("event") == "pulse":
                self._delivered += 1
            elif event.get("event") == "page":
                self._on_page(event["address"])
        for drone in self._drones:
            if check:
                drone.check()
            for topic, record in drone.reader.read(REFRESH_S / len(self._drones)):
                match record:
                    case Pulse():
                        tag_id = record.tag_id
                        drone.detected[tag_id] = drone.detected.get(tag_id, 0) + 1
                    case SystemStatus() if topic == "system_status":
                        drone.status = record
                        drone.flight_directory = (
                            record.flight_directory or drone.flight_directory
                        )

    def _tell(self, elapsed_s: float) -> None:
        words = [
            f"drone {one.system_id} {phase_of(one.scenario.flight, elapsed_s)}, "
            f"{sum(one.detected.values())} pulses"
            for one in self._drones
        ]
        self._say(f"{elapsed_s:3.0f} s: {'; '.join(words)}; on the ground {self._delivered}")

    def _stop(self) -> None:
        """Let the ground stop detection on all, then wait until everything has arrived."""
        self._ground.ask_to_stop()
        deadline_s = time.monotonic() + DRAIN_TIMEOUT_S
        while not self._ground.ended and time.monotonic() < deadline_s:
            self._tick(check=False)
        self._ground.stop()
        for drone in self._drones:
            for program in reversed(drone.programs):
                program.stop()

    # ------------------------------------------------------------------ account

    def _summary(self, drone: _Drone) -> DemoSummary:
        flight = read_flight(Path(drone.flight_directory))
        shutil.copy(drone.paths.scenario, drone.flight_directory)
        received = read_ground_pulses(self._ground_directory, self._begun_ns)
        status = drone.status
        assert status is not None
        processes = {one.process: one for one in status.processes}
        receiver = processes["receiver"].counters
        truth = World(drone.scenario).truth(
            int(receiver["first_sample_ns"]), int(receiver["last_sample_ns"])
        )
        return DemoSummary(
            tags={
                str(tag.tag_id): summarize_tag(
                    tag,
                    truth,
                    [item.pulse for item in flight.pulse_poses],
                    [p.start_time_ns for p in received if p.tag_id == tag.tag_id],
                )
                for tag in drone.scenario.tags
            },
            samples_lost=samples_lost(receiver),
            cpu_seconds=self._cpu(drone, status),
            duration_s=self._duration_s,
            flight_directory=drone.flight_directory,
        )

    def _cpu(self, drone: _Drone, status: SystemStatus) -> dict[str, float]:
        """CPU time of the drone's processes, and of those that all share."""
        spent = {one.process: one.cpu_s for one in status.processes}
        spent["autopilot (simulated)"] = drone.programs[0].cpu_s
        shared = {"ground": self._ground.cpu_s, "demo": cpu_s()}
        return {name: round(value, 3) for name, value in (spent | shared).items()}


def run_fleet_demo(
    *,
    scenarios: Sequence[Scenario],
    flight_dir: Path,
    page_port: int,
    say: Callable[[str], None],
    on_page: Callable[[str], None],
) -> dict[int, DemoSummary]:
    """Run the demo of several drones once; see `FleetDemo`."""
    demo = FleetDemo(
        scenarios=scenarios,
        flight_dir=flight_dir,
        page_port=page_port,
        say=say,
        on_page=on_page,
    )
    return demo.run()
