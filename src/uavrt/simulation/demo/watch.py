"""Measure the CPU time of the demo's processes."""

from collections.abc import Mapping, Sequence

from uavrt.core.clock import cpu_s, monotonic_s
from uavrt.core.messages import ProcessStatus, SystemStatus
from uavrt.drone.supervisor.start.usage import children_of, usage_of
from uavrt.simulation.demo.demo_programs import Program

RADIO = "radio (simulated)"
AUTOPILOT = "autopilot (simulated)"
GROUND = "ground"
VIEW = "demo's view"
RECEIVER = "receiver"


def samples_lost(counters: Mapping[str, float]) -> int:
    """Number of samples lost by the radio or between the radio and the detectors."""
    names = ("samples_lost", "channel_samples_dropped")
    return int(sum(counters.get(name, 0.0) for name in names))


class Cpu:
    """CPU time of each process of the demo.

    The simulated radio program is a child of the receiver. The supervisor measures both
    together, and this class separates them.
    """

    def __init__(self) -> None:
        self.first_sample_ns = self.last_sample_ns = 0
        """Times of the flight's first and last sample [ns, UTC], of this receiver only."""
        self._totals: dict[str, float] = {}
        self._radio_s = 0.0
        self._before: dict[str, float] = {}
        self._before_s = monotonic_s()
        self._processes: dict[str, ProcessStatus] = {}

    def take(self, status: SystemStatus, programs: Sequence[Program]) -> None:
        """Read CPU times from a drone's status report, and measure the other programs."""
        for process in status.processes:
            self._processes[process.process] = process
            if process.process == RECEIVER:
                first_ns = int(process.counters.get("first_sample_ns", 0))
                last_ns = int(process.counters.get("last_sample_ns", 0))
                self.first_sample_ns = self.first_sample_ns or first_ns
                self.last_sample_ns = max(self.last_sample_ns, last_ns)
            cpu = process.cpu_s
            if process.process == RECEIVER:
                if process.pid is not None:
                    live_s = sum(usage_of(pid).cpu_s for pid in children_of(process.pid))
                    self._radio_s = max(self._radio_s, live_s)
                self._totals[RADIO] = self._radio_s
                cpu -= self._radio_s
            self._totals[process.process] = max(cpu, self._totals.get(process.process, 0.0))
        names = (AUTOPILOT, None, GROUND)[: len(programs)]
        for program, name in zip(programs, names, strict=True):
            if name is not None:
                used_s = max(program.cpu_s, usage_of(program.pid).cpu_s)
                self._totals[name] = max(used_s, self._totals.get(name, 0.0))
        self._totals[VIEW] = cpu_s()

    def percents(self) -> dict[str, float]:
        """CPU use of each process since the last call [% of one core]."""
        now_s = monotonic_s()
        span_s = max(0.1, now_s - self._before_s)
        percents = {
            name: 100.0 * (total - self._before.get(name, 0.0)) / span_s
            for name, total in self._totals.items()
        }
        self._before, self._before_s = dict(self._totals), now_s
        return percents

    def totals(self) -> dict[str, float]:
        """CPU time of each process since its start [s]."""
        return {name: round(total, 3) for name, total in self._totals.items()}

    def counters(self, process: str) -> dict[str, float]:
        """Last reported counters of one of the drone's processes."""
        known = self._processes.get(process)
        return dict(known.counters) if known is not None else {}
