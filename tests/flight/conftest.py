"""A drone side as in the field, against a simulated radio and autopilot."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import made
import msgspec
import pytest
from some import some

from uavrt.config.settings import Settings
from uavrt.core.clock import Clock
from uavrt.core.messages import SystemStatus, Tag
from uavrt.drone.status_reader import StatusReader
from uavrt.drone.supervisor.start.usage import descendants_of
from uavrt.simulation.demo.demo_programs import DemoPaths, Program
from uavrt.simulation.demo.rig import Rig, starting_in
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.scenario import Radio, Scenario
from uavrt_experiments.resources.usage import is_alive

THESIS_TAG = made.simulated_tag(
    interval_uncertainty_s=0.06,
    interval_jitter_s=0.01,
    k=3,
    false_alarm_probability=0.005,
    north_m=150.0,
    east_m=60.0,
    erp_dbm=-30.0,
)


FLIGHT_RATE_HZ = 250_000.0
"""Sample rate of flights that do not test the load of 3 MS/s: a twelfth of its work."""


def hovering_scenario(
    duration_s: float = 120.0, sample_rate_hz: float = FLIGHT_RATE_HZ
) -> Scenario:
    """Simulate the thesis's tag, and a drone that turns on the spot."""
    return Scenario(
        duration_s=duration_s,
        radio=Radio(center_frequency_hz=148_705_000.0, sample_rate_hz=sample_rate_hz),
        tag=(THESIS_TAG,),
        flight=Flight(
            height_m=40.0,
            leg=(Leg(duration_s=2.0), Leg(duration_s=duration_s - 4.0, turn_deg=720.0)),
        ),
    )


@dataclass
class Drone:
    """A running drone side with its simulated world."""

    scenario: Scenario
    settings: Settings
    supervisor: Program
    autopilot: Program
    status: StatusReader
    ground_port: int
    directory: Path

    def status_when(
        self, wanted: Callable[[SystemStatus], object], timeout_s: float = 60.0
    ) -> SystemStatus:
        """Wait for a status of the supervisor that is as wanted."""
        last, deadline_s = None, time.monotonic() + timeout_s
        while time.monotonic() < deadline_s:
            for _, record in self.status.read(0.2):
                if isinstance(record, SystemStatus):
                    last = record
                    if wanted(record):
                        return record
        raise AssertionError(f"never came; last: {last}")

    def status_now(self, name: str = "supervisor") -> SystemStatus:
        """The next status in which a process runs; what was sent before now is passed over."""
        now_ns = Clock.start().now_ns()
        return self.status_when(
            lambda one: one.time_ns > now_ns and process(one, name).pid is not None
        )

    def pid_of(self, name: str) -> int:
        return int(process(self.status_now(name), name).pid)

    def end(self) -> None:
        """SIGTERM ends it in good order, with all that it has started."""
        family = descendants_of(self.supervisor.pid)
        self.supervisor.stop()
        assert self.supervisor.exit_code == 0
        assert not any(map(is_alive, family))
        assert not Path(some(self.settings.status_socket)).exists()


def process(status: SystemStatus, name: str) -> Any:
    """Status of one process; that of none where the table has no such row now."""
    rows = {one.process: one for one in status.processes}
    return rows.get(name, made.process_status(name, "not there", running=False, pid=None))


class DroneBay(Rig):
    """Starts drones below a directory; ends everything it started."""

    def __init__(self, directory: Path) -> None:
        super().__init__()
        self._directory = directory

    def launch(
        self,
        scenario: Scenario,
        *,
        tags: Sequence[Tag] = (),
        flies: bool = False,
        autopilot_options: tuple[str, ...] = (),
        **changes: object,
    ) -> Drone:
        """Start a drone; with tags it detects at once."""

        def changed(settings: Settings) -> Settings:
            """Replace tables, each by one or by what a function makes of it."""
            made = {
                name: change(getattr(settings, name)) if callable(change) else change
                for name, change in changes.items()
            }
            return replace(settings, **made)  # type: ignore[arg-type]

        number = 1 + sum(1 for _ in self._directory.glob("drone*"))
        work = self._directory / f"drone{number}"
        work.mkdir()
        drone = self.drone(
            starting_in(scenario, 1.0),
            DemoPaths(directory=work, flights=work / "flights"),
            flies=flies,
            autopilot=autopilot_options,
            supervisor=[msgspec.json.encode(tags).decode()] if tags else [],
            settings=changed,
        )
        return Drone(
            scenario=drone.scenario,
            settings=drone.settings,
            supervisor=drone.supervisor,
            autopilot=drone.autopilot,
            status=self.reader(drone, 20.0),
            ground_port=drone.ground_port,
            directory=work,
        )


@pytest.fixture
def drone_bay(tmp_path: Path) -> Iterator[DroneBay]:
    bay = DroneBay(tmp_path)
    yield bay
    bay.close()


@pytest.fixture
def thesis_scenario() -> Scenario:
    return hovering_scenario()


@pytest.fixture
def full_rate_scenario() -> Scenario:
    """Simulate the same at 3 MS/s."""
    return hovering_scenario(sample_rate_hz=3_000_000.0)


@pytest.fixture
def quiet_radio() -> Iterator[Callable[[int, int], Any]]:
    """Radios between autopilots and ground stations, given the ports of both."""
    from quiet_radio import QuietRadio

    with ExitStack() as stack:
        yield lambda port, ground: stack.enter_context(QuietRadio(port, ground))
