"""The recovery experiment: kills each process in turn, at random, in bursts; the supervisor;
everything at once.

A pulse that a detector has reported to the supervisor must reach the flight's database, its log
and the ground station, whatever is killed. Only pulses that were not yet confirmed on disk when
everything was killed at once may be lost.

*Resumed* means that the new process has processed its first live block with its tags restored:

- the receiver: a radio block later than the kill;
- a detector: a block of its channels that is not from the backlog, with as many tags as before;
- the connection: poses on the autopilot's time again;
- the recorder: the flight open again;
- the supervisor, or everything: all of these, with the same tags;
- the nursery, from which processes are forked: a new one runs, and no other process has ended.
"""

import random
import signal
from bisect import bisect_left
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from uavrt.config.settings import Settings
from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.commands import SystemState
from uavrt.core.errors import UavrtError
from uavrt.core.messages import Health, Pose, Pulse
from uavrt.core.units import ns_from_s
from uavrt.drone.supervisor.start.launcher import PING_S, SILENCE_S
from uavrt.drone.supervisor.start.restarts import FLIGHT_RESTARTS
from uavrt.drone.supervisor.start.usage import descendants_of
from uavrt.drone.supervisor.tree.process_shapes import rows_for
from uavrt.drone.supervisor.tree.table import PROCESSES
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.logs.pulse_pose_log import read_pulse_pose_log
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.scenario import Scenario
from uavrt_experiments.recovery.drone import NURSERY, READY_S, ServedDrone
from uavrt_experiments.recovery.report import Kill, RecoveryReport
from uavrt_experiments.resources.usage import is_alive

SIGKILL_LIMIT_S = 2.0
STOP_SPARE_S = 2.0
"""Time allowed after SIGSTOP in addition to the row's silence limit [s]."""
SUPERVISOR_LIMIT_S = 10.0
BURST, BURST_LIMIT_S = 6, FLIGHT_RESTARTS.delays_s[-1] + SIGKILL_LIMIT_S
"""Number of kills of one process in a burst; time allowed after the last [s], when the restart
policy waits its longest."""
BURST_NAMES = ("connection", "recorder")
TO_GROUND_S = 40.0
"""Longest wait at the end for the ground station to receive everything [s]."""
SAME_PULSE_NS = 2_000
"""Largest difference of a pulse's start in two logs [ns]; on the link it is a double, exact to
a microsecond."""
GIVE_UP_S = 40.0
LAST_HOPE_S = 120.0
"""Time after which a process counts as lost [s]."""
ORPHAN_LIMIT_S = 1.0
LONGEST_CUT_WAIT_S = 2.5
HEIGHT_M = 40.0
TURN_DEG_S = 12.0
SECONDS_EACH = 12.0
"""Time planned for each kill [s]; determines the length of the simulated flight."""

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Number of kills of each kind."""

    kills: int = 50
    """Kills of single processes: each by SIGKILL and by SIGSTOP, then at random."""
    stops: int = 3
    """Number of times that the connection is stopped (SIGSTOP) until it is replaced."""
    bursts: int = 3
    """Number of bursts of six kills of one process, each as soon as it runs again."""
    supervisor_kills: int = 5
    power_cuts: int = 100
    seed: int = 1
    sample_rate_hz: float = 3_000_000.0


class Recovery:
    """One run of the recovery experiment."""

    def __init__(self, drone: ServedDrone, plan: Plan, say: Say) -> None:
        self._drone = drone
        self._plan = plan
        self._say = say
        self._random = random.Random(plan.seed)
        self._clock = Clock.start()
        self._resumed_at_s: dict[str, float] = {}
        self._detectors: dict[str, float] = {}
        self._tags = {tag.tag_id for tag in drone.scenario.tags}
        self.kills: list[Kill] = []
        self.faults: list[str] = []
        self.orphans = 0
        self.directories: set[Path] = set()

    def run(self) -> None:
        """Execute the plan's kills."""
        self._wait_whole(READY_S)
        self._drone.wait(lambda: len(self._drone.recorded) >= 3, READY_S, "the first pulses")
        names = [name for name in self._drone.processes() if name != "supervisor"]
        self._detectors = {
            name: self._drone.health[name].counters["detectors"]
            for name in names
            if name.startswith("detector")
        }
        turns = [(n, s) for s in (signal.SIGKILL, signal.SIGSTOP) for n in names]
        for number in range(max(self._plan.kills, 0)):
            name, how = (
                turns[number]
                if number < len(turns)
                else (
                    self._random.choice(names),
                    self._random.choice((signal.SIGKILL, signal.SIGSTOP)),
                )
            )
            self._go_on_after(partial(self._kill_one, name, how))
        for _ in range(self._plan.stops):
            self._go_on_after(partial(self._kill_one, "connection", signal.SIGSTOP))
        for number in range(self._plan.bursts):
            name = BURST_NAMES[number % len(BURST_NAMES)]
            self._go_on_after(partial(self._kill_again_and_again, name))
        for _ in range(self._plan.supervisor_kills):
            self._go_on_after(self._kill_supervisor)
        for _ in range(self._plan.power_cuts):
            self._go_on_after(self._cut_power)

    def _go_on_after(self, kill: Callable[[], None]) -> None:
        """Kill one process; if it does not resume in time, note a fault and continue
        the run.
        """
        try:
            kill()
        except UavrtError as error:
            self.faults.append(str(error))
            self._say(str(error))
            self._wait_whole(LAST_HOPE_S)

    # ---------------------------------------------------------------- one kill

    def _kill_one(self, name: str, number: signal.Signals) -> None:
        """Kill a process that has run long enough to be restarted at once."""
        settled_s = (
            self._resumed_at_s.get(name, -FLIGHT_RESTARTS.settled_s)
            + FLIGHT_RESTARTS.settled_s
            + 0.5
        )
        self._drone.wait(lambda: monotonic_s() >= settled_s, GIVE_UP_S, "a quiet moment")
        limit_s = SIGKILL_LIMIT_S
        if number is signal.SIGSTOP:
            limit_s = self._silence_limit_s(name) + STOP_SPARE_S
        if name == NURSERY:
            self._kill_nursery(number, limit_s)
        else:
            self._drone.signal(name, number)
            self._await(name, number.name, limit_s, lambda kill: self._is_back(name, kill))
        self._wait_whole(GIVE_UP_S)
        self._resumed_at_s[name] = monotonic_s()

    def _kill_again_and_again(self, name: str) -> None:
        """Kill a process repeatedly, as soon as it runs; let it recover after the last time."""
        for number in range(BURST):
            before = self._drone.pid_of(name)
            self._drone.signal(name, signal.SIGKILL)
            if number < BURST - 1:
                self._drone.wait(
                    partial(self._is_another, name, before), GIVE_UP_S, f"{name} in a burst"
                )
        self._await(name, "6 SIGKILL", BURST_LIMIT_S, lambda kill: self._is_back(name, kill))
        self._wait_whole(GIVE_UP_S)
        self._resumed_at_s[name] = monotonic_s()

    def _is_another(self, name: str, before: int | None) -> bool:
        return self._drone.pid_of(name) not in (None, before)

    def _silence_limit_s(self, name: str) -> float:
        if name == NURSERY:
            return PING_S + SILENCE_S
        return next(
            row.silence_limit_s for row in PROCESSES if row.name == name.partition("-")[0]
        )

    def _kill_nursery(self, number: signal.Signals, limit_s: float) -> None:
        """Kill the helper; no other process may be affected."""
        others = {name: self._drone.pid_of(name) for name in self._detectors}
        old = self._drone.pid_of(NURSERY)
        self._drone.signal(NURSERY, number)
        self._await(
            NURSERY,
            number.name,
            limit_s,
            lambda _: self._drone.pid_of(NURSERY) not in (None, old),
        )
        if others != {name: self._drone.pid_of(name) for name in self._detectors}:
            self.faults.append("a detector ended with the nursery")

    def _kill_supervisor(self) -> None:
        self._pause(1.0 + self._random.random())
        pid = self._drone.pid_of("supervisor")
        family = descendants_of(pid) if pid is not None else ()
        self._drone.signal("supervisor", signal.SIGKILL)
        self._drone.health.clear()
        self._pause(ORPHAN_LIMIT_S)
        self.orphans += sum(is_alive(member) for member in family)
        self._await("supervisor", "SIGKILL", SUPERVISOR_LIMIT_S, self._all_back, ORPHAN_LIMIT_S)

    def _cut_power(self) -> None:
        self._pause(LONGEST_CUT_WAIT_S * self._random.random())
        self._drone.cut_power()
        self._await("power", "SIGKILL", SUPERVISOR_LIMIT_S, self._all_back)

    def _await(
        self,
        name: str,
        how: str,
        limit_s: float,
        back: Callable[[int], bool],
        waited_s: float = 0.0,
    ) -> None:
        """Wait until `back` is true; store the time since the kill, which was
        `waited_s` ago.
        """
        kill_ns = self._clock.now_ns() - ns_from_s(waited_s)
        took_s = waited_s + self._drone.wait(
            lambda: back(kill_ns), GIVE_UP_S, f"{name} after {how}"
        )
        self.kills.append(Kill(process=name, how=how, resumed_s=took_s, limit_s=limit_s))
        self._say(f"{len(self.kills):4d}  {name:<12} {how}  resumed after {took_s:.2f} s")

    # ------------------------------------------------------------ back or not?

    def _is_back(self, name: str, kill_ns: int) -> bool:
        health = self._drone.health.get(name)
        if health is None or health.time_ns <= kill_ns or not health.ok:
            return False
        return self._works(name, health, kill_ns)

    def _works(self, name: str, health: Health, kill_ns: int) -> bool:
        kind = name.partition("-")[0]
        if kind in ("receiver", "detector"):
            live = health.counters.get("last_sample_ns", 0.0) > kill_ns
            tags = health.counters.get("detectors", 0.0) >= self._detectors.get(name, 0.0)
            return health.status in ("receiving", "detecting") and live and tags
        if kind == "connection":
            return health.status in ("waiting for ground station", "ready")
        return kind != "recorder" or health.status == "recording"

    def _all_back(self, kill_ns: int) -> bool:
        status = self._drone.status
        if status is None or status.time_ns <= kill_ns:
            return False
        same = {tag.tag_id for tag in status.tags} == self._tags
        names = [p.process for p in status.processes if p.process != "supervisor"]
        whole = len(names) >= len(rows_for(Settings())) and set(self._detectors) <= set(names)
        return (
            same
            and whole
            and status.state is SystemState.DETECTING
            and all(self._is_back(name, kill_ns) for name in names)
        )

    def _wait_whole(self, timeout_s: float) -> None:
        """Wait until everything works; store the flight's directory."""
        now_ns = self._clock.now_ns()
        self._drone.wait(lambda: self._all_back(now_ns), timeout_s, "a whole system")
        directory = self._drone.flight_directory
        if directory is not None:
            self.directories.add(directory)

    def _pause(self, seconds: float) -> None:
        end_s = monotonic_s() + seconds
        self._drone.wait(lambda: monotonic_s() >= end_s, seconds + 1.0, "the end of a pause")


def run_recovery(
    plan: Plan, flights: Path, *, say: Say = lambda _line: None, workers: int = 2
) -> RecoveryReport:
    """Run the recovery experiment in real time.

    `plan`: number of kills.
    `flights`: parent of the flight directory.
    `say`: receives a line of progress.
    `workers`: number of detector processes.
    Raises `UavrtError`: the system did not start.
    """
    count = plan.kills + plan.supervisor_kills + plan.power_cuts
    count += plan.stops + 2 * plan.bursts
    scenario = turning_scenario(60.0 + SECONDS_EACH * count, plan.seed, plan.sample_rate_hz)
    faults: list[str] = []
    with ServedDrone(scenario, flights.resolve(), workers=workers) as drone:
        recovery = Recovery(drone, plan, say)
        try:
            recovery.run()
        except UavrtError as error:
            if not recovery.kills:
                raise
            faults.append(str(error))
        on_ground = _wait_for_ground(drone)
        drone.stop()
        recorded = frozenset(drone.recorded)
        promised = frozenset(drone.detected - drone.unpromised | recorded)
    stored = _stored(recovery.directories)
    return RecoveryReport(
        seed=plan.seed,
        kills=tuple(recovery.kills),
        pulses_recorded=len(recorded),
        pulses_detected=len(drone.detected),
        pulses_promised=len(promised),
        without_pose=sum(pose is None for pose in stored.values()),
        lost_from_database=len(promised - stored.keys()),
        lost_from_log=len(_keys(promised) - _in_logs(recovery.directories)),
        lost_on_ground=len(_not_among(_keys(promised), on_ground)),
        orphans=recovery.orphans,
        flights=len(recovery.directories),
        faults=(*recovery.faults, *faults),
    )


def turning_scenario(duration_s: float, seed: int, sample_rate_hz: float) -> Scenario:
    """The demo's animals, and a drone that turns above them from the first second."""
    scenario = demo_scenario(60.0, seed)
    turn = Leg(duration_s=duration_s, turn_deg=TURN_DEG_S * duration_s)
    return replace(
        scenario,
        duration_s=duration_s,
        radio=replace(scenario.radio, sample_rate_hz=sample_rate_hz),
        flight=Flight(height_m=HEIGHT_M, leg=(turn,)),
    )


def _wait_for_ground(drone: ServedDrone) -> set[tuple[int, int]]:
    """Wait until the last pulses reach the ground; returns its pulses."""
    drone.health.clear()
    promised = _keys(drone.detected - drone.unpromised)
    deadline_s = monotonic_s() + TO_GROUND_S
    while _not_among(promised, drone.pulses_on_ground()) and monotonic_s() < deadline_s:
        for _ in range(50):
            drone.listen()
    return drone.pulses_on_ground()


def _not_among(
    wanted: set[tuple[int, int]], received: set[tuple[int, int]]
) -> set[tuple[int, int]]:
    """Pulses that were not received, by tag and start."""
    starts: dict[int, list[int]] = {}
    for tag_id, start_ns in sorted(received):
        starts.setdefault(tag_id, []).append(start_ns)
    missing = set()
    for tag_id, start_ns in wanted:
        there = starts.get(tag_id, [])
        place = bisect_left(there, start_ns - SAME_PULSE_NS)
        if place == len(there) or there[place] > start_ns + SAME_PULSE_NS:
            missing.add((tag_id, start_ns))
    return missing


def _stored(directories: set[Path]) -> dict[Pulse, Pose | None]:
    return {i.pulse: i.pose for path in directories for i in read_flight(path).pulse_poses}


def _in_logs(directories: set[Path]) -> set[tuple[int, int]]:
    logs = [FlightLayout(path).pulse_pose_log for path in directories]
    return _keys(item.pulse for log in logs for item in read_pulse_pose_log(log))


def _keys(pulses: Iterable[Pulse]) -> set[tuple[int, int]]:
    return {(pulse.tag_id, pulse.start_time_ns) for pulse in pulses}
