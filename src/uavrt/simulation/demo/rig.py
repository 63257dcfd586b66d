"""Start simulated drones and their ground station on this computer, as in the field.

Each program runs in its own process and writes a log file. All programs end with the `Rig` that
started them.
"""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import msgspec

from uavrt.config.settings import Settings
from uavrt.core.clock import Clock
from uavrt.core.units import ns_from_s
from uavrt.drone.status_reader import StatusReader, status_socket_path
from uavrt.simulation.demo.demo_programs import (
    DemoPaths,
    Program,
    drone_settings,
    free_udp_port,
)
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.scene.scenario_file import write_scenario
from uavrt.simulation.vehicle.airframe import Flavour


def starting_in(scenario: Scenario, seconds: float) -> Scenario:
    """Copy a world with a start time `seconds` from now; programs need 1.5 s to be ready."""
    return scenario.starting_at(Clock.start().now_ns() + ns_from_s(seconds))


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedDrone:
    """A drone's running software with its simulated radio and autopilot."""

    scenario: Scenario
    settings: Settings
    paths: DemoPaths
    autopilot: Program
    supervisor: Program
    system_id: int
    ground_port: int
    """UDP port of the ground station, to which the autopilot sends messages."""

    def check(self) -> None:
        """Raise `UavrtError` if a program of this drone has ended."""
        self.autopilot.check()
        self.supervisor.check()

    def stop(self) -> None:
        """End the drone's software, then its autopilot."""
        self.supervisor.stop()
        self.autopilot.stop()


class Rig:
    """Starts programs, and ends them all when its `with` block ends.

    `flavour`: kind of autopilot that the drones simulate.
    """

    def __init__(self, flavour: Flavour = "px4") -> None:
        self._stack, self._flavour = ExitStack(), flavour

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all programs, the last started program first."""
        self._stack.close()

    def program(
        self, directory: Path, name: str, *arguments: str, module: str = "uavrt.cli"
    ) -> Program:
        """Start a Python module as a program; its log file is in `directory`."""
        program = Program(name, (module, *arguments), directory / f"{name}.log")
        self._stack.callback(program.stop)
        return program

    def drone(
        self,
        scenario: Scenario,
        paths: DemoPaths,
        *,
        system_id: int = 1,
        ground_port: int | None = None,
        flies: bool = False,
        autopilot: Sequence[str] = (),
        supervisor: Sequence[str] = (),
        served_by: Sequence[str] = ("uavrt.drone.supervisor",),
        settings: Callable[[Settings], Settings] = lambda made: made,
    ) -> SimulatedDrone:
        """Start a drone's software and its simulated autopilot.

        `scenario`: world of the drone, with the start time. `paths`: files of the drone, in a
        directory that exists. `ground_port`: port of the ground station; None: a free port.
        `flies`: True if the drone obeys commands, False if it flies the path in the scenario.
        `autopilot`, `supervisor`: further arguments of the two programs. `served_by`: module
        that runs the drone's software, and its first arguments. `settings`: function that
        changes the drone's settings.
        """
        write_scenario(scenario, paths.scenario)
        companion_port = free_udp_port()
        ground_port = free_udp_port() if ground_port is None else ground_port
        own = settings(drone_settings(scenario, paths, companion_port, flies=flies))
        return SimulatedDrone(
            scenario=scenario,
            settings=own,
            paths=paths,
            system_id=system_id,
            ground_port=ground_port,
            autopilot=self.program(
                paths.directory,
                "autopilot",
                *("--scenario", str(paths.scenario), "--system-id", str(system_id)),
                *("--flavour", self._flavour),
                *("--companion", f"127.0.0.1:{companion_port}"),
                *("--ground", f"127.0.0.1:{ground_port}"),
                *(("--flies", "--path", str(paths.flown)) if flies else ()),
                *autopilot,
                module="uavrt.simulation.autopilot",
            ),
            supervisor=self.program(
                paths.directory,
                "supervisor",
                *(*served_by[1:], msgspec.json.encode(own).decode(), *supervisor),
                module=served_by[0],
            ),
        )

    def ground(
        self, directory: Path, port: int, flights: Path, *options: str, vehicles: int = 1
    ) -> Program:
        """Start a ground station for drones 1 to `vehicles` that stores in `flights`."""
        further = [word for n in range(2, 1 + vehicles) for word in ("--vehicle", str(n))]
        return self.program(
            directory,
            "ground",
            *("ground", "--mavlink", f"udpin://127.0.0.1:{port}", "-o", str(flights)),
            *(*options, *further),
        )

    def reader(self, drone: SimulatedDrone, timeout_s: float) -> StatusReader:
        """Connect to the drone's supervisor as soon as it is ready."""
        reader = StatusReader(status_socket_path(drone.settings), timeout_s, drone.check)
        self._stack.callback(reader.close)
        return reader
