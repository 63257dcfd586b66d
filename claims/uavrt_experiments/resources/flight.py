"""A flight with many tags at 3 MS/s, whose processes are measured from outside."""

import sys
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

from uavrt.config.settings import DetectionSettings, RadioSettings, Settings
from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.commands import SystemState
from uavrt.core.errors import UavrtError
from uavrt.core.messages import Command, CommandReply, Health, SystemStatus, Tag
from uavrt.drone.supervisor.start.usage import children_of, descendants_of
from uavrt.simulation.demo.demo_programs import DemoPaths
from uavrt.simulation.demo.rig import Rig
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt_experiments.resources.steady_radio import steady_tags
from uavrt_experiments.resources.usage import own_cpu_s, pss_mb, written_mb

CENTER_HZ = 148_700_000.0
TIMEOUT_S = 60.0
ShapeFlown = Literal["workers", "stages", "one"]
_SUPERVISORS: dict[ShapeFlown, str] = {
    "workers": "uavrt.drone.supervisor",
    "stages": "uavrt_experiments.resources.stages",
    "one": "uavrt.drone.supervisor",
}
SHAPES_FLOWN = tuple(_SUPERVISORS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Measurement of one process at one moment, without its children."""

    process: str
    cpu_s: float
    """CPU time since the process started [s]."""
    pss_mb: float
    """Proportional set size [MB]: the process's memory, with its part of shared pages."""
    written_mb: float
    """Data written to disks since the process started [MB]; NaN if the kernel does not count
    it."""


class SteadyFlight:
    """The real drone side and a ground station, with a simulated radio and autopilot.

    `tags`: number of tags.
    `workers`: number of detector processes; 0: the settings' default.
    `flights`: parent of the flight directories; by default a temporary folder.
    `shape`: stages by process; one of `SHAPES_FLOWN`.
    """

    def __init__(
        self,
        tags: int,
        *,
        workers: int = 0,
        flights: Path | None = None,
        shape: ShapeFlown = "workers",
    ) -> None:
        self.tags = steady_tags(tags, CENTER_HZ)
        self._detection = DetectionSettings(
            workers=workers, shape="one" if shape == "one" else "workers"
        )
        self._shape = shape
        self._flights = flights
        self._stack = ExitStack()
        self._requests = 0
        self.health: dict[str, Health] = {}
        self.status: SystemStatus | None = None
        self._replies: dict[int, CommandReply] = {}

    def __enter__(self) -> Self:
        work = Path(
            self._stack.enter_context(
                tempfile.TemporaryDirectory(prefix="uavrt-flight-", ignore_cleanup_errors=True)
            )
        )
        rig = self._stack.enter_context(Rig())
        drone = rig.drone(
            demo_scenario(7200.0).starting_at(Clock.start().now_ns()),
            DemoPaths(directory=work, flights=self._flights or work / "flights"),
            settings=self._settings,
            served_by=(_SUPERVISORS[self._shape],),
        )
        # It takes the pulses, as in the field; without it they would gather in memory.
        rig.ground(work, drone.ground_port, work / "ground", "--headless", "--json")
        self.supervisor = drone.supervisor
        self._reader = rig.reader(drone, TIMEOUT_S)
        return self

    def _settings(self, made: Settings) -> Settings:
        """Settings of a drone whose radio receives all the tags, if possible."""
        radio = RadioSettings(
            program=(
                *(sys.executable, "-m", "uavrt_experiments.resources.steady_radio"),
                *("--tags", str(len(self.tags))),
                *("--center-frequency-hz", str(CENTER_HZ)),
            ),
            center_frequency_hz=CENTER_HZ,
        )
        return replace(made, radio=radio, detection=self._detection)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._stack.close()

    # ----------------------------------------------------------------- operating

    def upload(self) -> None:
        """Send the tags, and wait until the permanent processes run."""
        self._command("start_tags")
        for tag in self.tags:
            self._command("add_tag", tag)
        self._command("end_tags")
        self.wait(
            lambda: {"recorder", "connection"} <= self.health.keys(), "recorder and connection"
        )

    def start(self) -> float:
        """Start detecting; get the time until every detector works on samples [s]."""
        started_s = monotonic_s()
        self._command("start_detection")
        self.wait(self._detecting, "detection")
        return monotonic_s() - started_s

    def _detecting(self) -> bool:
        searching = self.searching()
        serving = sum(health.counters["detectors"] for health in searching)
        processes = self.status.processes if self.status else ()
        # The supervisor's own list follows; until then a detector is a nameless helper.
        named = {one.process for one in processes if one.pid is not None}
        return serving == len(self.tags) and all(
            health.status in ("detecting", "receiving") and health.process in named
            for health in searching
        )

    def searching(self) -> list[Health]:
        """Last health records of the processes with detectors."""
        return [health for health in self.health.values() if "detectors" in health.counters]

    def stop(self) -> float:
        """Stop detecting; get the time until the last pulse is safe [s]."""
        started_s = monotonic_s()
        self._command("stop_detection")
        self.wait(
            lambda: self.status is not None and self.status.state is SystemState.HAS_TAGS,
            "the end of the flight",
        )
        return monotonic_s() - started_s

    def end(self) -> float:
        """End the drone side by SIGTERM; get the time that took [s]."""
        started_s = monotonic_s()
        self.supervisor.stop()
        return monotonic_s() - started_s

    def _command(self, name: str, tag: Tag | None = None) -> None:
        self._requests += 1
        request = self._requests
        command = Command(
            name=name,  # type: ignore[arg-type]
            request_id=request,
            tag=tag,
            source="experiment",
        )
        self._reader.send("command", command)
        self.wait(lambda: request in self._replies, f"the reply to {name}")
        reply = self._replies[request]
        if not reply.accepted:
            raise UavrtError(f"{name} was refused: {reply.message}")

    # ----------------------------------------------------------------- measuring

    def listen(self, wait_s: float) -> None:
        """Read the supervisor's records."""
        self.supervisor.check()
        for _, record in self._reader.read(wait_s):
            match record:
                case Health():
                    self.health[record.process] = record
                case SystemStatus():
                    self.status = record
                case CommandReply():
                    self._replies[record.request_id] = record

    def wait(self, condition: Callable[[], bool], what: str) -> None:
        """Read records until a condition is true.

        Raises `UavrtError`: it did not become true in time.
        """
        deadline_s = monotonic_s() + TIMEOUT_S
        while not condition():
            if monotonic_s() > deadline_s:
                raise UavrtError(f"{what} did not come within {TIMEOUT_S:.0f} s")
            self.listen(0.02)

    def counter(self, process: str, name: str) -> float:
        """Last value of a process's counter."""
        health = self.health.get(process)
        return health.counters.get(name, 0.0) if health else 0.0

    def lost_samples(self) -> float:
        """Samples lost anywhere between the radio's program and the detectors."""
        return sum(
            self.counter(name, counter)
            for name in self.health
            for counter in ("samples_lost", "channel_samples_dropped")
        )

    def readings(self) -> list[Reading]:
        """Measure the supervisor, its processes and helpers, without the radio stand-in."""
        names = {self.supervisor.pid: "supervisor"}
        for process in self.status.processes if self.status else ():
            if process.pid is not None:
                names[process.pid] = process.process
            names[int(process.counters.get("nursery_pid", 0))] = "nursery"
        radio = next((pid for pid, name in names.items() if name == "receiver"), None)
        for pid in children_of(radio) if radio is not None else ():
            names[pid] = "radio (stand-in)"
        family = (self.supervisor.pid, *descendants_of(self.supervisor.pid))
        return [
            Reading(
                process=names.get(pid, f"helper {pid}"),
                cpu_s=own_cpu_s(pid),
                pss_mb=pss_mb(pid),
                written_mb=written_mb(pid),
            )
            for pid in family
        ]
