"""The whole drone side in its processes, as in the field: cost, start and stop.

100 tags, a quarter of them beeping, at 3 MS/s from a stand-in radio program, which is not
counted; poses from the simulated autopilot, not counted either. Memory is the proportional set
size, so pages that processes share are counted once in the sum. The guide's is what a search of
the demo tells, pages that it shares included.
"""

import tempfile
import time
from pathlib import Path

from benchmarks.harness import Table
from uavrt.simulation.demo.demo_search import SearchDemo, SearchSummary
from uavrt.simulation.demo.worlds import search_world
from uavrt_experiments.resources.flight import Reading, SteadyFlight
from uavrt_experiments.resources.report import by_process
from uavrt_experiments.resources.run import run_shapes
from uavrt_experiments.resources.shapes import HEADER

TAGS = 100
MINUTES = 5.0
SHAPE_S = 45.0
RADIO = "radio (stand-in)"
SUPERVISOR_CPU, SUPERVISOR_MB = 1.0, 40.0
TOTAL_MB = 350.0
START_S, STOP_S = 2.0, 3.0
SEARCH_S, GUIDE_CPU, GUIDE_MB = 120.0, 5.0, 80.0


def run() -> list[Table]:
    """All tables of this section."""
    with SteadyFlight(TAGS) as flight:
        flight.upload()
        start_s = flight.start()
        settle(flight, 10.0)
        before, began_s = flight.readings(), time.monotonic()
        settle(flight, 60.0 * MINUTES)
        after, ended_s = flight.readings(), time.monotonic()
        lost = flight.lost_samples()
        stop_s = flight.stop()
        end_s = flight.end()
    return [
        costs(before, after, ended_s - began_s, lost),
        Table(
            title="Start and stop",
            header=["", "s", "bar"],
            rows=[
                ["start until all detectors work", f"{start_s:.2f}", bar(start_s, START_S)],
                ["stop until the last pulse is safe", f"{stop_s:.2f}", bar(stop_s, STOP_S)],
                ["SIGTERM until all processes ended", f"{end_s:.2f}", bar(end_s, STOP_S)],
            ],
        ),
        shapes(),
        guide(searched()),
    ]


def searched() -> SearchSummary:
    """Let the demo's drone search for three animals, one of them walking."""
    with tempfile.TemporaryDirectory() as directory:
        return SearchDemo(
            scenario=search_world(None, limit_s=SEARCH_S, seed=None, coded=False),
            limit_s=SEARCH_S,
            flight_dir=Path(directory),
            say=lambda line: None,
        ).run()


def guide(search: SearchSummary) -> Table:
    cpu, memory = search.guide_cpu_percent, search.guide_memory_mb
    return Table(
        title=f"The guide in a search for {len(search.tags)} animals",
        header=["", "guide", "bar"],
        rows=[
            ["CPU % of a core", f"{cpu:.2f}", f"≤ {GUIDE_CPU:g} %: {met(cpu <= GUIDE_CPU)}"],
            ["memory, MB", f"{memory:.1f}", f"≤ {GUIDE_MB:g} MB: {met(memory <= GUIDE_MB)}"],
        ],
        notes=[f"{search.decisions} decisions in {search.duration_s:.0f} s."],
    )


def shapes() -> Table:
    report = run_shapes(tags=TAGS, seconds=SHAPE_S)
    return Table(
        title=f"Shapes of the table of processes: {TAGS} tags, {SHAPE_S:g} s each",
        header=HEADER,
        rows=report.rows(),
        notes=[
            "Chain: the processes between radio and pulses. p50, p99: age of a radio block's "
            "last sample when it had been searched; a block is 87 ms long."
        ],
    )


def settle(flight: SteadyFlight, seconds: float) -> None:
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        flight.listen(0.5)


def costs(before: list[Reading], after: list[Reading], seconds: float, lost: float) -> Table:
    cpu_before, cpu_after = by_process(before, "cpu_s"), by_process(after, "cpu_s")
    memory = by_process(after, "pss_mb")
    percent = {
        name: 100.0 * (cpu_after[name] - cpu_before.get(name, 0.0)) / seconds
        for name in cpu_after
    }
    rows = [[name, f"{percent[name]:.2f}", f"{memory[name]:.1f}", ""] for name in memory]
    for row in rows:
        if row[0] == "supervisor":
            row[3] = (
                f"≤ {SUPERVISOR_CPU:g} %: {met(percent['supervisor'] <= SUPERVISOR_CPU)}, "
                f"≤ {SUPERVISOR_MB:g} MB: {met(memory['supervisor'] <= SUPERVISOR_MB)}"
            )
    total_cpu = sum(value for name, value in percent.items() if name != RADIO)
    total_mb = sum(value for name, value in memory.items() if name != RADIO)
    rows.append(["sum without the radio", f"{total_cpu:.2f}", f"{total_mb:.1f}"])
    rows[-1].append(f"≤ {TOTAL_MB:g} MB: {met(total_mb <= TOTAL_MB)}")
    return Table(
        title=f"A flight with {TAGS} tags, {MINUTES:g} minutes",
        header=["process", "CPU % of a core", "PSS MB", "bar"],
        rows=rows,
        notes=[f"Samples lost: {lost:.0f}. One viewer on the status socket."],
    )


def bar(value: float, most: float) -> str:
    return f"≤ {most:g} s: {met(value <= most)}"


def met(good: bool) -> str:
    return "met" if good else "NOT met"
