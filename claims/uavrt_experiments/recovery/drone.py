"""The drone side under a stand-in for systemd, with its world, ground station and records."""

import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self

import msgspec

from uavrt.config.settings import DetectionSettings
from uavrt.core.clock import monotonic_s
from uavrt.core.errors import UavrtError
from uavrt.core.messages import (
    Health,
    Pulse,
    PulseKey,
    PulsePose,
    Recorded,
    StatusText,
    SystemStatus,
)
from uavrt.drone.status_reader import StatusReader
from uavrt.drone.supervisor.start.usage import descendants_of
from uavrt.flight.logs.pulse_files import read_pulse_file
from uavrt.simulation.demo.demo_programs import DemoPaths
from uavrt.simulation.demo.rig import Rig, starting_in
from uavrt.simulation.scene.scenario import Scenario

START_LEAD_S = 1.0
READY_S = 30.0
POLL_S = 0.02
NURSERY = "nursery"
"""Name of the helper from which processes are forked; it has no row and no health records."""
NURSERY_PID = "nursery_pid"


class ServedDrone:
    """Starts all programs; follows the supervisor's records across restarts.

    `scenario`: the simulated world.
    `flights`: parent of the flight directories.
    `workers`: number of detector processes.
    """

    def __init__(self, scenario: Scenario, flights: Path, *, workers: int = 2) -> None:
        self._stack = ExitStack()
        self._flights = flights
        self._workers = workers
        self.scenario = scenario
        self.health: dict[str, Health] = {}
        self.status: SystemStatus | None = None
        self.detected: set[Pulse] = set()
        """Pulses that a detector reported to the supervisor."""
        self.unpromised: set[Pulse] = set()
        """Pulses not yet confirmed to be on disk when everything was killed at once."""
        self._power_cut = False
        self._of_this_life: set[Pulse] = set()
        """Pulses received since the present supervisor's first record."""
        self.recorded: set[Pulse] = set()
        """Pulses that the recorder confirmed to be on disk."""
        self._on_their_way: dict[PulseKey, Pulse] = {}
        """Newest pulse of each name, because the recorder confirms by name."""
        self.texts: list[str] = []
        self._reader: StatusReader | None = None

    def __enter__(self) -> Self:
        work = Path(
            self._stack.enter_context(
                tempfile.TemporaryDirectory(
                    prefix="uavrt-recovery-", ignore_cleanup_errors=True
                )
            )
        )
        rig = self._stack.enter_context(Rig())
        self.scenario = starting_in(self.scenario, START_LEAD_S)
        drone = rig.drone(
            self.scenario,
            DemoPaths(directory=work, flights=self._flights),
            supervisor=(msgspec.json.encode(self.scenario.tags).decode(),),
            served_by=(
                *("uavrt_experiments.recovery.service_manager", "--"),
                *(sys.executable, "-m", "uavrt.drone.supervisor"),
            ),
            settings=lambda made: replace(
                made, detection=DetectionSettings(workers=self._workers)
            ),
        )
        self._socket = drone.paths.status_socket
        self.autopilot, self.manager = drone.autopilot, drone.supervisor
        self._ground = work / "ground"
        rig.ground(work, drone.ground_port, self._ground, "--headless", "--json")
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._reader is not None:
            self._reader.close()
        self._stack.close()

    def stop(self) -> None:
        """Stop the drone side in an orderly way."""
        self.manager.stop()

    # --------------------------------------------------------------- listening

    def listen(self, wait_s: float = POLL_S) -> None:
        """Read the supervisor's records; reconnect when it has been restarted."""
        self.manager.check()
        if self._reader is None and not self._connect():
            time.sleep(wait_s)
            return
        assert self._reader is not None
        try:
            records = self._reader.read(wait_s)
        except ConnectionError:
            records = []
            self._reader.close()
            self._reader = None
        for _, record in records:
            self._take(record)
        if self._reader is not None and not self._reader.is_open:
            self._reader.close()
            self._reader = None

    def _connect(self) -> bool:
        with suppress(UavrtError):
            self._reader = StatusReader(self._socket, 0.0, self.manager.check)
            if self._power_cut:  # what it still said is read by now
                self.unpromised |= self._of_this_life - self.recorded
            self._power_cut = False
            self._of_this_life.clear()
        return self._reader is not None

    def _take(self, record: object) -> None:
        match record:
            case Pulse():
                self.detected.add(record)
                self._of_this_life.add(record)
            case PulsePose():
                self._on_their_way[record.pulse.key] = record.pulse  # not on disk yet
            case Recorded():
                self.recorded |= {
                    self._on_their_way[key]
                    for key in record.pulses
                    if key in self._on_their_way
                }
            case Health():
                self.health[record.process] = record
            case SystemStatus():
                self.status = record
            case StatusText():
                self.texts.append(record.text)

    def wait(self, condition: Callable[[], bool], timeout_s: float, what: str) -> float:
        """Read records until a condition is true; returns the time taken [s].

        Raises `UavrtError`: it did not become true in time.
        """
        started_s = monotonic_s()
        while not condition():
            if monotonic_s() - started_s > timeout_s:
                raise UavrtError(f"{what} did not come within {timeout_s:.0f} s")
            self.listen()
        return monotonic_s() - started_s

    def pulses_on_ground(self) -> set[tuple[int, int]]:
        """Get tag and start [ns] of the pulses that the ground station has stored so far."""
        with suppress(UavrtError):
            received = read_pulse_file(self._ground / "pulses.jsonl")
            return {(item.pulse.tag_id, item.pulse.start_time_ns) for item in received}
        return set()

    # ------------------------------------------------------------------ killing

    @property
    def flight_directory(self) -> Path | None:
        """Directory of the flight in progress, as last reported."""
        named = self.status.flight_directory if self.status else None
        return Path(named) if named else None

    def pid_of(self, process: str) -> int | None:
        """Process id of a process, as last reported."""
        for item in self.status.processes if self.status else ():
            if item.process == process:
                return item.pid
            if process == NURSERY and NURSERY_PID in item.counters:
                return int(item.counters[NURSERY_PID]) or None
        return None

    def processes(self) -> list[str]:
        """Names of the supervised processes and the nursery."""
        return [p.process for p in self.status.processes] + [NURSERY] if self.status else []

    def signal(self, process: str, number: signal.Signals) -> None:
        """Send a signal to a process of the drone side."""
        pid = self.pid_of(process)
        if pid is None:
            raise UavrtError(f"{process} does not run")
        self.health.pop(process, None)
        with suppress(ProcessLookupError):
            os.kill(pid, number)

    def cut_power(self) -> None:
        """Send SIGKILL to all of the drone side at once."""
        supervisor = self.pid_of("supervisor")
        if supervisor is None:
            raise UavrtError("the supervisor does not run")
        for pid in (*descendants_of(supervisor), supervisor):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.health.clear()
        self._power_cut = True
