"""Many runs on several processes, with paired seeds; any number of processes gives the same
runs.
"""

import math
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import active_children, get_context
from pathlib import Path

import msgspec

import uavrt_experiments
from uavrt_experiments.kept import KeptOutcomes
from uavrt_experiments.measured import digest
from uavrt_experiments.search.bounds import least_time_s
from uavrt_experiments.search.catalogue import SCENARIOS
from uavrt_experiments.search.drones import FlightOfDrones, starts_of
from uavrt_experiments.search.flight import Outcome, flown_case, fly
from uavrt_experiments.search.scenario import PUBLISHED, THAN_PUBLISHED, Contender
from uavrt_experiments.search.table import Flown

FOLDERS = ("localization", "planning")
"""Folders of the package whose code the figures depend on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One run, described by names, so that it can be sent to another process."""

    scenario: str
    contender: Contender
    seed: int
    particles: int


def plan(
    name: str, runs: int, seed: int, particles: int, *, baselines: bool = True
) -> list[Run]:
    """Runs of a scenario: ours, and a share for each baseline with the same seeds."""
    scenario = SCENARIOS[name]
    planned = []
    for contender in scenario.contenders:
        ours = contender.planner == "mi_rate"
        asked_for = contender == PUBLISHED and scenario.asks(THAN_PUBLISHED)
        if not (ours or baselines or asked_for):
            continue
        count = runs if ours else max(1, math.ceil(runs * scenario.baseline_share))
        planned += [
            Run(
                scenario=name, contender=contender, seed=seed * 100_000 + n, particles=particles
            )
            for n in range(count)
        ]
    return planned


def made_with() -> str:
    """Digest of the code that stored outcomes depend on."""
    ours = digest(("search",), Path(uavrt_experiments.__file__).parent)
    theirs = digest(
        (
            "ground",
            "guidance",
            "drone/processes",
            "simulation",
            "localization/terrain",
            *FOLDERS,
        )
    )
    return f"code {theirs} and {ours}"


def flown(run: Run) -> Outcome:
    """Fly a run and compute the bound of its time, in any process."""
    scenario, who = SCENARIOS[run.scenario], run.contender
    case = flown_case(scenario, who)
    if who.as_drones:
        outcome = FlightOfDrones(case, who, run.seed).flown()
    else:
        outcome = fly(scenario, who, run.seed, particles=run.particles)
    stop = case.paper_stop if who.stop == "paper" else case.our_stop
    starts = list(starts_of(case, who).values())
    return replace(outcome, least_time_s=least_time_s(case, stop, run.seed, starts))


def fly_all(
    planned: list[Run],
    *,
    kept: KeptOutcomes | None = None,
    workers: int = 1,
    on_progress: Callable[[int], None] = lambda done: None,
) -> list[Flown]:
    """Fly runs, and group them by planner in their order.

    `kept`: stored runs are not flown again, and each flown one is stored at once.
    `workers`: number of processes; 1 flies in this one.
    `on_progress`: receives the number of runs done.
    """
    kept = KeptOutcomes() if kept is None else kept
    to_fly = [run for run in planned if _name(run) not in kept]
    done = len(planned) - len(to_fly)
    on_progress(done)
    for run, outcome in _each(to_fly, workers):
        kept.take(_name(run), partial(msgspec.to_builtins, outcome))
        done += 1
        on_progress(done)
    return so_far(planned, kept)


def so_far(planned: list[Run], kept: KeptOutcomes) -> list[Flown]:
    """Stored runs grouped by planner, in their order."""
    groups: dict[Contender, list[Outcome]] = {}
    for run in planned:
        for stored in kept.of(_name(run)):
            outcome = msgspec.convert(stored, Outcome)
            groups.setdefault(run.contender, []).append(outcome)
    return [Flown(contender=who, outcomes=tuple(runs)) for who, runs in groups.items()]


def _name(run: Run) -> str:
    return f"{run.scenario}; {run.contender}; {run.seed}; {run.particles};"


def _each(planned: list[Run], workers: int) -> Iterator[tuple[Run, Outcome]]:
    if workers == 1:
        for run in planned:
            yield run, flown(run)
        return
    others = set(active_children())
    with ProcessPoolExecutor(
        workers, mp_context=get_context("spawn"), initializer=_leave_interrupts
    ) as pool:
        waiting = {pool.submit(flown, run): run for run in planned}
        try:
            for done in as_completed(waiting):
                yield waiting[done], done.result()
        except BaseException:
            # A run may take minutes: do not wait for those in flight.
            for child in set(active_children()) - others:
                child.terminate()
            raise
        finally:
            pool.shutdown(cancel_futures=True)


def _leave_interrupts() -> None:
    """Ignore Ctrl-C, which reaches all processes of a terminal; the main process ends the
    others.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
