"""The command ``uavrt experiment search``."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from uavrt.cli.options.kinds import Between, Count, Seed
from uavrt.cli.shown.outputs import check_place
from uavrt.cli.shown.progress_bars import progress_bar, progress_bars

if TYPE_CHECKING:
    from uavrt_experiments.kept import KeptOutcomes
    from uavrt_experiments.result import Row
    from uavrt_experiments.search.table import Flown


def search(
    *,
    runs: Count = 100,
    seed: Seed = 1,
    only: str | None = None,
    baselines: bool = True,
    particles: Annotated[int, Parameter(validator=Between(least=100))] = 10_000,
    workers: Count = 2,
    processes: Count | None = None,
    kept: Path | None = None,
    output: Path | None = None,
    pictures: Path | None = None,
    page: Path | None = None,
) -> None:
    """Search simulated animals with every planner, against the published tables.

    Each table is flown by our planner and by the others, with the same animals and the same
    fading; a run that does not find every animal counts as failed, with its time limit. The
    tables also give bounds that no planner can beat.

    A run of our planner takes 2 s (T3), 5 s (T2), 11 s (T4) or half a minute (T8) of a core. It
    takes longer over several square kilometres (T5, T6), and for planners that do not find all
    animals in time. So 100 runs take from ten minutes (T3) to hours: begin with --runs 10.
    Ctrl-C prints the finished runs.

    With --processes, it flies a few searches by the real processes instead: supervisor,
    receiver, detectors, guide and connection as in a flight. Radio and autopilot are simulated.

    Parameters
    ----------
    runs
        Runs of our planner in each table; the baselines fly a fraction of them, with the same
        seeds.
    seed
        Seed of everything random; with --processes that of the first search.
    only
        Fly only this table, such as T2.
    baselines
        Also fly the other planners; without, only the one that a requirement compares with.
    particles
        Hypotheses per tag for planners under a paper's stop rule; drones use their own number.
    workers
        Number of processes that share the runs.
    processes
        Number of searches by the real processes, one after another, four to ten minutes
        each; no table is flown.
    kept
        File (.jsonl) of the results of finished runs; the same command continues from it.
    output
        Write every figure with its interval and its bound to this CSV file; the terminal shows
        only the figures that have a target.
    pictures
        Draw the paths into this folder.
    page
        Put each table into this Markdown page, in place of its earlier one.
    """
    from uavrt.core.errors import UsageError
    from uavrt_experiments.commands.shared import stop_early
    from uavrt_experiments.kept import KeptOutcomes
    from uavrt_experiments.search.campaign import made_with
    from uavrt_experiments.search.catalogue import SCENARIOS
    from uavrt_experiments.tables import bars_kept, write_rows

    if only is not None and only not in SCENARIOS:
        raise UsageError(
            f"there is no table {only}", remedy=f"Choose from {', '.join(SCENARIOS)}"
        )
    if processes is not None and (only is not None or pictures is not None):
        raise UsageError(
            "--processes flies no table and draws no picture",
            remedy="Leave out --processes, or --only and --pictures",
        )
    for place in (output, page, kept):
        if place is not None:
            check_place(place, overwrite=True)
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
    with KeptOutcomes(kept, made_with=made_with()) as outcomes:
        if processes is not None:
            rows, stopped = _through_processes(processes, seed, outcomes, page)
        else:
            asked = _Asked(
                runs=runs, seed=seed, particles=particles, workers=workers, baselines=baselines
            )
            names = [only] if only is not None else list(SCENARIOS)
            rows, stopped = _through_tables(names, asked, outcomes, page, pictures)
    print(f"{bars_kept(rows)}, {processes or runs} runs")
    if output is not None:
        write_rows(output, rows)
    if stopped:
        stop_early(kept)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Asked:
    """Options of the search experiment's runs."""

    runs: int
    seed: int
    particles: int
    workers: int
    baselines: bool

    def command(self, name: str) -> str:
        """Command that repeats a table, without the number of processes."""
        words = f"--only {name} --runs {self.runs} --seed {self.seed}"
        words += f" --particles {self.particles}" + (
            "" if self.baselines else " --no-baselines"
        )
        return f"uavrt experiment search {words}"


def _through_tables(
    names: Sequence[str],
    asked: _Asked,
    kept: "KeptOutcomes",
    page: Path | None,
    pictures: Path | None,
) -> "tuple[list[Row], bool]":
    """Fly tables and print them; returns all rows, and True if it was stopped early."""
    from uavrt_experiments.measured import measured_now
    from uavrt_experiments.search.campaign import FOLDERS, fly_all, plan, so_far
    from uavrt_experiments.search.catalogue import SCENARIOS
    from uavrt_experiments.search.page import page_section, put_section
    from uavrt_experiments.search.pictures import draw
    from uavrt_experiments.search.table import honesty, results, section

    # Of the code that was loaded: an edit while it runs must not count.
    code = measured_now(FOLDERS)
    rows: list[Row] = []
    sections: list[str] = []
    everything: list[Flown] = []
    stopped = False
    with progress_bars() as add_bar:
        for name in names:
            scenario = SCENARIOS[name]
            planned = plan(
                name, asked.runs, asked.seed, asked.particles, baselines=asked.baselines
            )
            advance = add_bar(name, len(planned))
            try:
                flown = fly_all(planned, kept=kept, workers=asked.workers, on_progress=advance)
            except KeyboardInterrupt:
                flown, stopped = so_far(planned, kept), True
            own = results(scenario, flown)
            sections += [section(scenario, own)] if flown else []
            rows += own
            everything += flown
            if page is not None and not stopped:
                text = page_section(scenario, own, asked.command(name), code)
                put_section(page, name, text)
            if pictures is not None and flown:
                draw(scenario, flown, pictures / f"{name}.png")
            if stopped:
                break
    together = honesty(everything)
    sections += [
        f"T9  {one.case}: {one.quantity} {one.figure:.3g} ({one.low:.3g}–{one.high:.3g}), "
        f"asked {one.bar}, {one.n} judged, {one.verdict}"
        for one in together
    ]
    print(*sections, sep="\n\n", end="\n\n")
    print(code)
    return rows + together, stopped


def _through_processes(
    flights: int, seed: int, kept: "KeptOutcomes", page: Path | None
) -> "tuple[list[Row], bool]":
    """Fly searches by the real processes and print them; returns as `_through_tables`."""
    from uavrt_experiments.measured import measured_now
    from uavrt_experiments.search.page import put_section
    from uavrt_experiments.search.processes import (
        PROCESS_FOLDERS,
        PROCESSES,
        flights_so_far,
        fly_for_real,
        process_page,
        process_rows,
        process_section,
    )

    code = measured_now(PROCESS_FOLDERS)
    stopped = False
    with progress_bar(PROCESSES, flights) as advance:
        try:
            fly_for_real(
                flights,
                seed,
                kept=kept,
                say=partial(print, file=sys.stderr),
                on_progress=advance,
            )
        except KeyboardInterrupt:
            stopped = True
    flown = flights_so_far(flights, seed, kept)
    rows = process_rows(flown)
    print(process_section(flown, rows), end="\n\n")
    print(code)
    if page is not None and not stopped:
        command = f"uavrt experiment search --processes {flights} --seed {seed}"
        put_section(page, PROCESSES, process_page(flown, rows, command, code))
    return rows, stopped
