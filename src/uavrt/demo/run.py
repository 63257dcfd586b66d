"""Run the demo: start the programs, fly, show, stop, account."""

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from pathlib import Path

import msgspec
from rich.console import Console
from rich.live import Live

from uavrt.clock import Clock
from uavrt.config import write_tags
from uavrt.demo.programs import (
    DemoPaths,
    Program,
    drone_settings,
    free_ros_domain,
    free_udp_port,
)
from uavrt.demo.summary import DemoSummary, summarize_tag
from uavrt.demo.view import DemoView, TagView
from uavrt.demo.watch import RECEIVER, Cpu, samples_lost
from uavrt.demo.workplace import require_free_port, workplace
from uavrt.errors import UavrtError
from uavrt.ground.store import read_ground_pulses
from uavrt.messages import Pulse, SystemStatus
from uavrt.monitor import StatusReader
from uavrt.recording import read_flight, require_writable
from uavrt.simulation import Flight, Scenario, World, write_scenario
from uavrt.units import ns_from_s

START_LEAD_S = 2.5
"""The world's clock starts this long after the programs: they take about 1.5 s to be ready."""
READY_TIMEOUT_S = 20.0
DRAIN_TIMEOUT_S = 15.0
REFRESH_S = 0.25


class Demo:
    """One run of the whole system on this machine.

    Parameters
    ----------
    scenario : Scenario
        The world; when it starts is set here.
    flight_dir : Path
        Where the drone makes its flight directory.
    page_port : int, optional
        Port of the ground station's page, 0 for any free one; None flies without a page.
    on_page : callable, optional
        Called with the page's address when it is there.
    on_ros_domain : callable, optional
        Called with the ROS domain in which the drone's nodes are, if it has any.
    """

    def __init__(
        self,
        *,
        scenario: Scenario,
        flight_dir: Path,
        page_port: int | None = None,
        on_page: Callable[[str], None] | None = None,
        on_ros_domain: Callable[[int], None] | None = None,
    ) -> None:
        self.scenario = scenario
        self._flight_dir = flight_dir
        self._page_port = page_port
        self._on_page = on_page
        self._on_ros_domain = on_ros_domain
        self._stack = ExitStack()
        self.view = DemoView(
            duration_s=scenario.duration_s,
            tags={tag.tag_id: TagView(tag) for tag in self.scenario.tags},
        )
        self._cpu = Cpu()
        self._flight_directory = ""
        self._duration_s = scenario.duration_s

    def run(self, console: Console | None, picture: Path | None = None) -> DemoSummary:
        """Fly once; draw on the console if there is one; save a picture if asked for.

        Ctrl-C ends the flight where it is, and it is accounted for as one that was flown out.

        Raises
        ------
        UavrtError
            A program ended by itself or did not get ready; the text says why.
        """
        with self._stack:
            paths = self._prepare()
            with self._display(console):
                self._start(paths)
                self._fly_until_told()
                if picture is not None:
                    self.view.save_picture(picture, time.monotonic())
                self._stop()
            return self._summarize(paths)

    # ------------------------------------------------------------------- set-up

    def _prepare(self) -> DemoPaths:
        require_writable(self._flight_dir)
        require_free_port(self._page_port)
        work = self._stack.enter_context(workplace("uavrt-demo-"))
        paths = DemoPaths(directory=work, flights=self._flight_dir.resolve())
        write_tags(paths.tags, self.scenario.tags)
        return paths

    def _start(self, paths: DemoPaths) -> None:
        companion_port, ground_port = free_udp_port(), free_udp_port()
        start_ns = Clock.start().now_ns() + ns_from_s(START_LEAD_S)
        self.scenario = self.scenario.starting_at(start_ns)
        self._begun_ns = start_ns - ns_from_s(START_LEAD_S)
        self._start_ns = start_ns
        write_scenario(self.scenario, paths.scenario)
        # The gateway is part of the demo wherever its extra is installed.
        if find_spec("cyclonedds") is not None:
            self.view.ros_domain = free_ros_domain()
            if self._on_ros_domain is not None:
                self._on_ros_domain(self.view.ros_domain)
        settings = drone_settings(
            self.scenario, paths, companion_port, ros_domain=self.view.ros_domain
        )
        self._programs = [
            self._program(
                paths,
                "autopilot",
                "uavrt.simulation.autopilot",
                "--scenario",
                str(paths.scenario),
                "--companion",
                f"127.0.0.1:{companion_port}",
                "--ground",
                f"127.0.0.1:{ground_port}",
            ),
            self._program(
                paths, "supervisor", "uavrt.supervisor", msgspec.json.encode(settings).decode()
            ),
            self._program(
                paths,
                "ground",
                "uavrt.cli",
                "ground",
                "--mavlink",
                f"udpin://127.0.0.1:{ground_port}",
                "--tags",
                str(paths.tags),
                "--start",
                "--json",
                "-o",
                str(self._ground_directory(paths)),
                *self._page_arguments(),
            ),
        ]
        self._reader = StatusReader(paths.status_socket, READY_TIMEOUT_S, self._check)
        self._stack.callback(self._reader.close)

    def _ground_directory(self, paths: DemoPaths) -> Path:
        """Where the ground stores; with a page beside the drone's flights, to look at later."""
        return paths.ground if self._page_port is None else paths.flights / "ground"

    def _page_arguments(self) -> tuple[str, ...]:
        if self._page_port is None:
            return ("--headless",)
        return ("--page", "--no-browser", "--port", str(self._page_port))

    def _program(self, paths: DemoPaths, name: str, *arguments: str) -> Program:
        program = Program(name, arguments, paths.directory / f"{name}.log")
        self._stack.callback(program.stop)
        return program

    # ------------------------------------------------------------------- flight

    def _fly_until_told(self) -> None:
        """Fly to the end, or until Ctrl-C once there is something to account for."""
        try:
            self._fly()
        except KeyboardInterrupt:
            if not self._cpu.counters(RECEIVER).get("last_sample_ns") or (
                not self._flight_directory
            ):
                raise
            self._duration_s = round(self.view.elapsed_s, 1)

    def _fly(self) -> None:
        """Wait for detection to start, then until the flight's end."""
        clock = Clock.start()
        deadline_s = time.monotonic() + READY_TIMEOUT_S
        end_ns = self._start_ns + ns_from_s(self.scenario.duration_s)
        while clock.now_ns() < end_ns:
            self._tick(clock)
            if self._flight_directory == "" and time.monotonic() > deadline_s:
                raise not_started(self._programs[2])

    def _stop(self) -> None:
        """Let the ground stop detection, then wait until everything has arrived."""
        self.view.phase = "landed, delivering"
        ground = self._programs[2]
        clock = Clock.start()
        ground.ask_to_stop()
        deadline_s = time.monotonic() + DRAIN_TIMEOUT_S
        while not ground.ended and time.monotonic() < deadline_s:
            self._tick(clock, check=False)
        for program in reversed(self._programs):
            program.stop()

    def _tick(self, clock: Clock, *, check: bool = True) -> None:
        if check:
            self._check()
        self.view.elapsed_s = max(0.0, (clock.now_ns() - self._start_ns) * 1e-9)
        for event in self._programs[2].new_events():
            if event.get("event") == "pulse" and event["tag_id"] in self.view.tags:
                self.view.tags[event["tag_id"]].delivered += 1
            elif event.get("event") == "page":
                self.view.page_address = event["address"]
                if self._on_page is not None:
                    self._on_page(event["address"])
        for topic, record in self._reader.read(REFRESH_S):
            match record:
                case Pulse() if record.tag_id in self.view.tags:
                    self.view.tags[record.tag_id].add(record, time.monotonic())
                case SystemStatus() if topic == "system_status":
                    self._take_status(record)

    def _take_status(self, status: SystemStatus) -> None:
        self.view.status = status
        if status.flight_directory:
            self._flight_directory = status.flight_directory
            self.view.phase = phase_of(self.scenario.flight, self.view.elapsed_s)
        self._cpu.take(status, self._programs)
        self.view.cpu_percent = self._cpu.percents()

    def _check(self) -> None:
        for program in self._programs:
            program.check()

    @contextmanager
    def _display(self, console: Console | None) -> Iterator[None]:
        if console is None:
            yield
            return
        with Live(
            get_renderable=lambda: self.view.render(time.monotonic()),
            console=console,
            refresh_per_second=4,
        ):
            yield

    # ------------------------------------------------------------------ account

    def _summarize(self, paths: DemoPaths) -> DemoSummary:
        flight = read_flight(Path(self._flight_directory))
        # The world goes with the flight, so that bearings and positions can be checked later.
        shutil.copy(paths.scenario, self._flight_directory)
        received = read_ground_pulses(self._ground_directory(paths), self._begun_ns)
        receiver = self._cpu.counters(RECEIVER)
        first_ns, last_ns = receiver["first_sample_ns"], receiver["last_sample_ns"]
        truth = World(self.scenario).truth(int(first_ns), int(last_ns))
        return DemoSummary(
            tags={
                str(tag.tag_id): summarize_tag(
                    tag,
                    truth,
                    [item.pulse for item in flight.pulse_poses],
                    [p.start_time_ns for p in received if p.tag_id == tag.tag_id],
                )
                for tag in self.scenario.tags
            },
            samples_lost=samples_lost(receiver),
            cpu_seconds=self._cpu.totals(),
            duration_s=self._duration_s,
            flight_directory=self._flight_directory,
        )


def not_started(ground: Program, where: str = "") -> UavrtError:
    """Say that the ground could not start detection, with its last words and where all are."""
    last = ground.last_line()
    return UavrtError(
        f"detection did not start{where}" + (f": {last}" if last else ""),
        remedy=f"Look at {ground.log} and the other log files beside it",
    )


def phase_of(flight: Flight, elapsed_s: float) -> str:
    """Describe what the drone does at a moment of its flight."""
    turns = 0
    for leg in flight.leg:
        turns += bool(leg.turn_deg)
        if elapsed_s < leg.duration_s:
            if leg.turn_deg:
                return f"turning at point {turns}"
            if leg.height_m is not None:
                return "taking off"
            if leg.north_m is not None:
                return f"flying to point {turns + 1}"
            return "hovering" if turns else "standing"
        elapsed_s -= leg.duration_s
    return "flight plan flown"


def run_demo(
    *,
    scenario: Scenario,
    flight_dir: Path,
    console: Console | None,
    picture: Path | None = None,
    page_port: int | None = None,
    on_page: Callable[[str], None] | None = None,
    on_ros_domain: Callable[[int], None] | None = None,
) -> DemoSummary:
    """Run the demo once; see `Demo`."""
    demo = Demo(
        scenario=scenario,
        flight_dir=flight_dir,
        page_port=page_port,
        on_page=on_page,
        on_ros_domain=on_ros_domain,
    )
    return demo.run(console, picture)
