"""Run the demo: start the programs, fly one drone or several, and summarise the flight."""

import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path

from rich.console import Console
from rich.live import Live

from uavrt.config.settings import Ros2Settings, Settings
from uavrt.config.tags.tag_files import write_tags
from uavrt.core.clock import Clock
from uavrt.core.errors import UavrtError
from uavrt.core.messages import Pulse, SystemStatus
from uavrt.core.units import ns_from_s
from uavrt.drone.status_reader import StatusReader
from uavrt.flight.flight_layout import require_writable
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.store.stored import read_ground_pulses
from uavrt.simulation.demo.demo_programs import (
    DemoPaths,
    Program,
    free_ros_domain,
    free_udp_port,
)
from uavrt.simulation.demo.rig import Rig, SimulatedDrone
from uavrt.simulation.demo.summary import DemoSummary, sampled_span, summarize_tag
from uavrt.simulation.demo.view import DemoView, TagView
from uavrt.simulation.demo.watch import RECEIVER, Cpu, samples_lost
from uavrt.simulation.demo.workplace import require_free_port, workplace
from uavrt.simulation.scene.flight import Flight
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.scene.world import World
from uavrt.simulation.vehicle.airframe import Flavour

START_LEAD_S = 2.5
"""Time by which the programs start before the simulated world [s]; they need 1.5 s to be
ready."""
READY_TIMEOUT_S = 20.0
DRAIN_TIMEOUT_S = 15.0
REFRESH_S = 0.25
PROGRESS_PERIOD_S = 10.0


@dataclass(slots=True)
class _Drone:
    side: SimulatedDrone
    reader: StatusReader
    view: DemoView
    cpu: Cpu = field(default_factory=Cpu)
    flight_directory: str = ""

    @property
    def heard_samples(self) -> bool:
        """True once the receiver of the drone has counted samples."""
        return bool(self.flight_directory and self.cpu.last_sample_ns)

    def read(self, wait_s: float, ground: Program) -> None:
        for topic, record in self.reader.read(wait_s):
            match record:
                case Pulse() if record.tag_id in self.view.tags:
                    self.view.tags[record.tag_id].add(record, time.monotonic())
                case SystemStatus() if topic == "system_status":
                    self._receive_status(record, ground)

    def _receive_status(self, status: SystemStatus, ground: Program) -> None:
        self.view.status = status
        if status.flight_directory:
            self.flight_directory = status.flight_directory
            self.view.phase = phase_of(self.side.scenario.flight, self.view.elapsed_s)
        self.cpu.take(status, (self.side.autopilot, self.side.supervisor, ground))
        self.view.cpu_percent = self.cpu.percents()


class Demo:
    """Flies one demo of the whole system on this computer.

    `scenarios`: world of each drone, with the same animals and different flights; their start
    time is set here. `flight_dir`: parent of the drone's flight directory; with several drones,
    parent of `drone-NUMBER`. With a page, the ground station stores data in
    `flight_dir`/ground. `page_port`: port of the ground station's page; 0: any free port; None:
    no page. `console`: terminal that shows the flight, or None. `on_page`: called with the
    page's address when the page is ready. `on_ros_domain`: called with the ROS domain of the
    drone's nodes, if any.
    """

    def __init__(
        self,
        *,
        scenarios: Sequence[Scenario],
        flight_dir: Path,
        page_port: int | None = None,
        console: Console | None = None,
        on_page: Callable[[str], None] | None = None,
        on_ros_domain: Callable[[int], None] | None = None,
        autopilot: Flavour = "px4",
    ) -> None:
        self._scenarios, self._duration_s = scenarios, scenarios[0].duration_s
        self._flight_dir, self._page_port = flight_dir, page_port
        self._console, self._on_page = console, on_page
        self._on_ros_domain = on_ros_domain
        self._rig, self._clock = Rig(autopilot), Clock.start()
        self._drones: list[_Drone] = []
        self._delivered = 0

    def run(self, picture: Path | None = None) -> dict[int, DemoSummary]:
        """Fly once, until the end or Ctrl-C; return the summary of each drone by its number.

        `picture`: file for a picture of the terminal view, or None. Ctrl-C ends the flight
        early, but the summary is complete.
        """
        require_writable(self._flight_dir)
        require_free_port(self._page_port)
        with ExitStack() as stack:
            work = stack.enter_context(workplace("uavrt-demo-"))
            stack.enter_context(self._rig)
            self._start(work, work / "tags.toml")
            with self._display():
                self._fly_until_interrupted()
                if picture is not None:
                    self._drones[0].view.save_picture(picture, time.monotonic())
                self._stop()
            return {one.side.system_id: self._summary(one) for one in self._drones}

    # ------------------------------------------------------------------- set-up

    def _start(self, work: Path, tags: Path) -> None:
        write_tags(tags, self._scenarios[0].tags)
        self._begun_ns = self._clock.now_ns()
        self._start_ns = self._begun_ns + ns_from_s(START_LEAD_S)
        port, flights = free_udp_port(), self._flight_dir.resolve()
        several = len(self._scenarios) > 1
        for number, scenario in enumerate(self._scenarios, start=1):
            paths = DemoPaths(directory=work, flights=flights)
            if several:
                paths = paths.below(f"drone-{number}")
            self._drones.append(self._drone(number, scenario, paths, port))
        page = self._page_port is not None
        # With a page in the folder of the drone's flights, for later use.
        self._ground_directory = flights / "ground" if page else work / "ground"
        self._ground = self._rig.ground(
            work,
            port,
            self._ground_directory,
            *("--tags", str(tags), "--start", "--json"),
            *(("--page", "--no-browser", "--port", str(self._page_port)) if page else ()),
            *(() if page else ("--headless",)),
            vehicles=len(self._scenarios),
        )

    def _drone(self, number: int, scenario: Scenario, paths: DemoPaths, port: int) -> _Drone:
        view = DemoView(
            duration_s=scenario.duration_s,
            tags={tag.tag_id: TagView(tag) for tag in scenario.tags},
        )
        # The gateway is part of the demo of one drone wherever its extra is installed.
        if len(self._scenarios) == 1 and find_spec("cyclonedds") is not None:
            view.ros_domain = free_ros_domain()
            if self._on_ros_domain is not None:
                self._on_ros_domain(view.ros_domain)

        def settings(made: Settings) -> Settings:
            shown = view.ros_domain is not None
            return replace(made, ros2=Ros2Settings(enabled=shown, domain_id=view.ros_domain))

        side = self._rig.drone(
            scenario.starting_at(self._start_ns),
            paths,
            system_id=number,
            ground_port=port,
            settings=settings,
        )
        return _Drone(side, self._rig.reader(side, READY_TIMEOUT_S), view)

    # ------------------------------------------------------------------- flight

    def _fly_until_interrupted(self) -> None:
        try:
            self._fly()
        except KeyboardInterrupt:
            if not all(one.heard_samples for one in self._drones):
                raise
            self._duration_s = round(self._elapsed_s, 1)

    @property
    def _elapsed_s(self) -> float:
        return max(0.0, (self._clock.now_ns() - self._start_ns) * 1e-9)

    def _fly(self) -> None:
        deadline_s = time.monotonic() + READY_TIMEOUT_S
        said_s = 0.0
        while self._elapsed_s < self._duration_s:
            self._tick()
            if len(self._drones) > 1 and self._elapsed_s - said_s >= PROGRESS_PERIOD_S:
                said_s = self._elapsed_s
                self._print_progress(said_s)
            silent = [one for one in self._drones if not one.flight_directory]
            if silent and time.monotonic() > deadline_s:
                several = f" on drone {silent[0].side.system_id}"
                raise not_started(self._ground, several if len(self._drones) > 1 else "")

    def _stop(self) -> None:
        for one in self._drones:
            one.view.phase = "landed, delivering"
        self._ground.terminate()
        deadline_s = time.monotonic() + DRAIN_TIMEOUT_S
        while not self._ground.ended and time.monotonic() < deadline_s:
            self._tick(check=False)
        self._rig.close()

    def _tick(self, *, check: bool = True) -> None:
        if check:
            self._ground.check()
        for event in self._ground.new_events():
            if event.get("event") == "pulse":
                self._delivered += 1
                for one in self._drones:
                    if event["tag_id"] in one.view.tags:
                        one.view.tags[event["tag_id"]].delivered += 1
            elif event.get("event") == "page":
                for one in self._drones:
                    one.view.page_address = event["address"]
                if self._on_page is not None:
                    self._on_page(event["address"])
        for one in self._drones:
            if check:
                one.side.check()
            one.view.elapsed_s = self._elapsed_s
            one.read(REFRESH_S / len(self._drones), self._ground)

    def _print_progress(self, elapsed_s: float) -> None:
        words = [
            f"drone {one.side.system_id} {one.view.phase}, "
            f"{sum(tag.detected for tag in one.view.tags.values())} pulses"
            for one in self._drones
        ]
        if self._console is not None:
            text = f"{elapsed_s:3.0f} s: {'; '.join(words)}; on the ground {self._delivered}"
            self._console.print(text, highlight=False)

    @contextmanager
    def _display(self) -> Iterator[None]:
        if self._console is None or len(self._drones) > 1:
            yield
            return
        with Live(
            get_renderable=lambda: self._drones[0].view.render(time.monotonic()),
            console=self._console,
            refresh_per_second=4,
        ):
            yield

    # ------------------------------------------------------------------ account

    def _summary(self, drone: _Drone) -> DemoSummary:
        scenario = drone.side.scenario
        flight = read_flight(Path(drone.flight_directory))
        # The world goes with the flight, so that bearings and positions can be checked later.
        shutil.copy(drone.side.paths.scenario, drone.flight_directory)
        received = read_ground_pulses(self._ground_directory, self._begun_ns)
        receiver = drone.cpu.counters(RECEIVER)
        recorded = [item.pulse for item in flight.pulse_poses]
        reported = drone.cpu.first_sample_ns, drone.cpu.last_sample_ns
        truth = World(scenario).truth(*sampled_span(*reported, recorded))
        return DemoSummary(
            tags={
                str(tag.tag_id): summarize_tag(
                    tag,
                    truth,
                    recorded,
                    [p.start_time_ns for p in received if p.tag_id == tag.tag_id],
                )
                for tag in scenario.tags
            },
            samples_lost=samples_lost(receiver),
            cpu_seconds=drone.cpu.totals(),
            duration_s=self._duration_s,
            flight_directory=drone.flight_directory,
        )


def not_started(ground: Program, where: str = "") -> UavrtError:
    """Create the error for a ground station that failed to start detection.

    Its last output is part of the error.
    """
    last = ground.last_line()
    return UavrtError(
        f"detection did not start{where}" + (f": {last}" if last else ""),
        remedy=f"Read {ground.log} and the other log files in its folder",
    )


def phase_of(flight: Flight, elapsed_s: float) -> str:
    """Text on what the drone is doing at a time of its flight."""
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
