"""A drone side as in the field, against a simulated radio and autopilot."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import made
import msgspec
import pytest

from uavrt.clock import Clock
from uavrt.config.settings import Settings
from uavrt.demo.programs import DemoPaths, Program, drone_settings, free_udp_port
from uavrt.monitor import StatusReader, status_socket_path
from uavrt.simulation import Scenario, write_scenario
from uavrt.simulation.flight import Flight, Leg
from uavrt.simulation.scenario import Radio

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


class DroneBay:
    """Starts drones; ends everything it started."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._stack = ExitStack()
        self._number = 0

    def launch(
        self,
        scenario: Scenario,
        *arguments: str,
        autopilot_options: tuple[str, ...] = (),
        **changes: object,
    ) -> Drone:
        self._number += 1
        work = self._directory / f"drone{self._number}"
        work.mkdir()
        paths = DemoPaths(directory=work, flights=work / "flights")
        scenario = scenario.starting_at(Clock.start().now_ns() + 1_000_000_000)
        write_scenario(scenario, paths.scenario)
        companion_port, ground_port = free_udp_port(), free_udp_port()
        flies = "--flies" in autopilot_options
        if flies:
            autopilot_options += ("--path", str(paths.flown))
        settings = drone_settings(scenario, paths, companion_port, flies=flies)
        # A table as such, or made from the one for this place.
        made = {
            name: change(getattr(settings, name)) if callable(change) else change
            for name, change in changes.items()
        }
        settings = replace(settings, **made)  # type: ignore[arg-type]
        autopilot = self._program(
            work,
            "autopilot",
            "uavrt.simulation.autopilot",
            *("--scenario", str(paths.scenario)),
            *("--companion", f"127.0.0.1:{companion_port}"),
            *("--ground", f"127.0.0.1:{ground_port}"),
            *autopilot_options,
        )
        supervisor = self._program(
            work,
            "supervisor",
            "uavrt.supervisor",
            msgspec.json.encode(settings).decode(),
            *arguments,
        )
        status = StatusReader(status_socket_path(settings), 20.0, supervisor.check)
        self._stack.callback(status.close)
        return Drone(
            scenario=scenario,
            settings=settings,
            supervisor=supervisor,
            autopilot=autopilot,
            status=status,
            ground_port=ground_port,
            directory=work,
        )

    def _program(self, work: Path, name: str, *arguments: str) -> Program:
        program = Program(name, arguments, work / f"{name}.log")
        self._stack.callback(program.stop)
        return program

    def close(self) -> None:
        self._stack.close()


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
