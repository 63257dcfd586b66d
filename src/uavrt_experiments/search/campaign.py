"""Many runs on a few processes; paired seeds, the same runs from any number of processes."""

import math
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context

from uavrt_experiments.search.catalogue import SCENARIOS
from uavrt_experiments.search.flight import Outcome, fly
from uavrt_experiments.search.scenario import PUBLISHED, THAN_PUBLISHED, Contender
from uavrt_experiments.search.several import FlightOfSeveral
from uavrt_experiments.search.table import Flown


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One run, by names: so it can be sent to another process."""

    scenario: str
    contender: Contender
    seed: int
    particles: int


def plan(
    name: str, runs: int, seed: int, particles: int, *, baselines: bool = True
) -> list[Run]:
    """Runs of a scenario: ours, and of each baseline a share with the same seeds."""
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


def flown(run: Run) -> Outcome:
    """Fly a run; called in whatever process."""
    scenario = SCENARIOS[run.scenario]
    if run.contender.drones > 1:
        return FlightOfSeveral(scenario, run.contender, run.seed, run.particles).flown()
    return fly(scenario, run.contender, run.seed, particles=run.particles)


def fly_all(
    planned: list[Run],
    *,
    workers: int = 1,
    on_progress: Callable[[int], None] = lambda done: None,
) -> list[Flown]:
    """Fly runs, and group them by contender in their order.

    Parameters
    ----------
    planned : list of Run
    workers : int
        Processes; 1 flies in this one.
    on_progress : callable
        Takes the number of runs done.
    """
    outcomes: dict[int, Outcome] = {}
    for number, outcome in _each(planned, workers):
        outcomes[number] = outcome
        on_progress(len(outcomes))
    groups: dict[Contender, list[Outcome]] = {}
    for number, run in enumerate(planned):
        groups.setdefault(run.contender, []).append(outcomes[number])
    return [Flown(contender=who, outcomes=tuple(runs)) for who, runs in groups.items()]


def _each(planned: list[Run], workers: int) -> Iterator[tuple[int, Outcome]]:
    if workers == 1:
        for number, run in enumerate(planned):
            yield number, flown(run)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(flown, run): number for number, run in enumerate(planned)}
        try:
            for done in as_completed(waiting):
                yield waiting[done], done.result()
        finally:
            pool.shutdown(cancel_futures=True)
