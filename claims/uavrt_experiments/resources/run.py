"""The resources experiment: a long flight, then flights with an increasing number of tags."""

import statistics
from collections.abc import Callable
from dataclasses import dataclass

from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.errors import UavrtError
from uavrt_experiments.resources.flight import SHAPES_FLOWN, ShapeFlown, SteadyFlight
from uavrt_experiments.resources.report import (
    RADIO,
    Load,
    Moment,
    ResourceReport,
    Written,
    by_process,
    ours,
)
from uavrt_experiments.resources.shapes import ShapeFlight, ShapesReport
from uavrt_experiments.resources.thesis import MINUTES

THESIS_MINUTES = float(MINUTES[-1])
STRETCH = 0.5
"""Share of the time since the last moment over which CPU use is measured; this leaves out the
start."""

MEMORY_S = 40.0
"""Averaging time of memory [s], with a reading a second: two of the periods after which a
process frees memory (`uavrt.core.runtime.heap`). A detector's memory varies by 1 MB in each."""

SYNCS = "disk_syncs"
"""Name of the recorder's count of fsync; no other process calls it during a flight."""

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Duration and load of the experiment."""

    minutes: float = THESIS_MINUTES
    """Duration of the long flight [min]; the moments of measurement scale with it."""
    tags: int = 1
    loads: tuple[int, ...] = (100, 200, 400, 800, 1600)
    """Numbers of tags to try until real time is lost; empty: no such flights."""
    load_s: float = 40.0
    """Duration of the flight with each number of tags [s]."""


def run_resources(plan: Plan, *, say: Say = lambda _line: None) -> ResourceReport:
    """Run the resources experiment in real time.

    Raises `UavrtError`: the drone side did not start, or ended by itself.
    """
    moments, written, lost = _long_flight(plan, say)
    loads: list[Load] = []
    for tags in plan.loads:
        loads.append(_load(tags, plan.load_s))
        say(f"{tags} tags: {'in real time' if loads[-1].real_time else 'too many'}")
        if not loads[-1].real_time:
            break
    return ResourceReport(
        tags=plan.tags,
        moments=tuple(moments),
        written=written,
        lost_samples=lost,
        loads=tuple(loads),
    )


def run_written(tags: int, minutes: float) -> Written:
    """Fly, and measure the disk writes after the start.

    Raises `UavrtError`: the drone side did not start, or ended by itself.
    """
    with SteadyFlight(tags) as flight:
        flight.upload()
        flight.start()
        flight.wait(
            lambda: flight.counter("recorder", "pulses_recorded") > 0, "the first pulses"
        )
        disk = _DiskMeter(flight)
        _fly_until(flight, monotonic_s() + 60.0 * minutes)
        return disk.read()


def _long_flight(plan: Plan, say: Say) -> tuple[list[Moment], Written, float]:
    with SteadyFlight(plan.tags) as flight:
        flight.upload()
        flight.start()
        began_s = monotonic_s()
        disk = _DiskMeter(flight)
        moments = []
        for thesis_minute in MINUTES:
            due_s = began_s + 60.0 * plan.minutes * thesis_minute / THESIS_MINUTES
            start_s = due_s - STRETCH * max(0.0, due_s - monotonic_s())
            moments.append(_moment(flight, start_s, due_s, began_s))
            say(f"{moments[-1].minute:.1f} min measured")
        return moments, disk.read(), flight.lost_samples()


def _moment(flight: SteadyFlight, start_s: float, end_s: float, began_s: float) -> Moment:
    """Measure all processes between two times."""
    _fly_until(flight, start_s)
    before, before_s = by_process(flight.readings(), "cpu_s"), monotonic_s()
    _fly_until(flight, end_s - MEMORY_S)
    memory = _mean_memory(flight, end_s)
    after, now_s = by_process(flight.readings(), "cpu_s"), monotonic_s()
    return Moment(
        minute=round((now_s - began_s) / 60.0, 2),
        cpu_percent={
            name: 100.0 * (after[name] - before.get(name, 0.0)) / (now_s - before_s)
            for name in after
        },
        pss_mb=memory,
    )


class _DiskMeter:
    """Counts disk writes from its creation on."""

    def __init__(self, flight: SteadyFlight) -> None:
        self._flight = flight
        self._began_s = monotonic_s()
        self._written = by_process(flight.readings(), "written_mb")
        self._syncs = flight.counter("recorder", SYNCS)

    def read(self) -> Written:
        """Disk writes since the start."""
        hours = (monotonic_s() - self._began_s) / 3600.0
        now = by_process(self._flight.readings(), "written_mb")
        before = self._written
        return Written(
            mb_h={name: (now[name] - before.get(name, 0.0)) / hours for name in now},
            syncs_h=(self._flight.counter("recorder", SYNCS) - self._syncs) / hours,
        )


def _mean_memory(flight: SteadyFlight, end_s: float) -> dict[str, float]:
    """Mean memory of each process, measured every second until a time [MB]."""
    readings = [by_process(flight.readings(), "pss_mb")]
    while monotonic_s() < end_s:
        _fly_until(flight, min(monotonic_s() + 1.0, end_s))
        readings.append(by_process(flight.readings(), "pss_mb"))
    return {name: statistics.fmean(r.get(name, 0.0) for r in readings) for name in readings[-1]}


def run_shapes(
    *, tags: int, seconds: float, workers: int = 0, say: Say = lambda _line: None
) -> ShapesReport:
    """Fly the same load in each shape of the table of processes.

    `tags`: number of tags.
    `seconds`: duration of each measurement [s].
    `workers`: number of detectors in the shape that flies; 0: the settings' default.
    `say`: receives a line of progress.
    Raises `UavrtError`: one of them did not start, or found nothing.
    """
    found = []
    for shape in SHAPES_FLOWN:
        found.append(_shape(shape, tags, seconds, workers))
        say(f"{shape}: {found[-1].cpu_percent:.1f} % of a core")
    return ShapesReport(tags=tags, seconds=seconds, shapes=tuple(found))


def _shape(shape: ShapeFlown, tags: int, seconds: float, workers: int) -> ShapeFlight:
    with SteadyFlight(tags, shape=shape, workers=workers) as flight:
        flight.upload()
        start_s = flight.start()
        flight.wait(
            lambda: flight.counter("recorder", "pulses_recorded") > 0, "the first pulses"
        )
        began_s = monotonic_s()
        moment = _moment(flight, began_s, began_s + seconds, began_s)
        latencies_ms = [health.counters["latency_p99_ms"] for health in flight.searching()]
        medians_ms = [health.counters["latency_p50_ms"] for health in flight.searching()]
        names = [name for name in moment.cpu_percent if name != RADIO]
        return ShapeFlight(
            shape=shape,
            processes=len(names),
            start_s=start_s,
            cpu_percent=ours(moment.cpu_percent),
            chain_cpu_percent=sum(moment.cpu_percent[name] for name in names if _chain(name)),
            pss_mb=ours(moment.pss_mb),
            latency_p50_ms=max(medians_ms),
            latency_p99_ms=max(latencies_ms),
            lost_samples=flight.lost_samples(),
            pulses=flight.counter("recorder", "pulses_recorded"),
        )


def _chain(process: str) -> bool:
    """True if a process is between radio and pulses, where the shapes differ."""
    return process.partition("-")[0] in ("receiver", "channelizer", "detector")


def _fly_until(flight: SteadyFlight, end_s: float) -> None:
    while (left_s := end_s - monotonic_s()) > 0:
        flight.listen(min(0.5, left_s))


def _load(tags: int, seconds: float) -> Load:
    clock = Clock.start()
    with SteadyFlight(tags) as flight:
        try:
            flight.upload()
            flight.start()
        except UavrtError:
            return Load(tags=tags, cpu_percent=0.0, behind_s=float("inf"), lost_samples=0.0)
        began_s = monotonic_s()
        moment = _moment(flight, began_s + 0.4 * seconds, began_s + seconds, began_s)
        newest_ns = min(
            health.counters.get("last_sample_ns", 0.0) for health in flight.searching()
        )
        return Load(
            tags=tags,
            cpu_percent=ours(moment.cpu_percent),
            # The health is up to a second old; that is no sign of being late.
            behind_s=max(0.0, (clock.now_ns() - newest_ns) * 1e-9 - 1.0),
            lost_samples=flight.lost_samples(),
        )
