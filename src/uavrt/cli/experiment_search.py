"""``uavrt experiment search``."""

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from uavrt.cli.kinds import Between, Count, Seed
from uavrt.cli.outputs import check_place

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


def _advanced(progress: "Progress", task: "TaskID", done: int) -> None:
    progress.update(task, completed=done)


def search(
    *,
    runs: Count = 100,
    seed: Seed = 1,
    only: str | None = None,
    baselines: bool = True,
    particles: Annotated[int, Parameter(validator=Between(least=100))] = 10_000,
    workers: Count = 2,
    output: Path | None = None,
    pictures: Path | None = None,
    page: Path | None = None,
) -> None:
    """Search simulated animals with every planner, against the published tables.

    Parameters
    ----------
    runs
        Runs of our planner in each table; the baselines fly a fraction of them, with the same
        seeds.
    seed
        Seed of everything random.
    only
        One table, such as T2.
    baselines
        Also fly the other planners; without, only the one that a bar compares with.
    particles
        Hypotheses per tag.
    workers
        Number of processes.
    output
        Write every figure with its interval to this CSV file; the terminal shows only the
        figures that have a target.
    pictures
        Draw the paths into this folder.
    page
        Put each table into this Markdown page, in place of its earlier one.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    from uavrt.errors import UsageError
    from uavrt_experiments.measured import measured_now
    from uavrt_experiments.result import Row
    from uavrt_experiments.search import (
        SCENARIOS,
        Flown,
        fly_all,
        honesty,
        page_section,
        plan,
        put_section,
        results,
        section,
    )
    from uavrt_experiments.tables import bars_kept, write_rows

    if only is not None and only not in SCENARIOS:
        raise UsageError(
            f"there is no table {only}", remedy=f"Choose from {', '.join(SCENARIOS)}"
        )
    if output is not None:
        check_place(output, overwrite=True)
    if page is not None:
        check_place(page, overwrite=True)
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    sections: list[str] = []
    everything: list[Flown] = []
    columns = "{task.description}", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(file=sys.stderr)) as progress:
        for name in [only] if only is not None else list(SCENARIOS):
            planned = plan(name, runs, seed, particles, baselines=baselines)
            task = progress.add_task(name, total=len(planned))
            advance = partial(_advanced, progress, task)
            flown = fly_all(planned, workers=workers, on_progress=advance)
            own = results(SCENARIOS[name], flown)
            sections.append(section(SCENARIOS[name], own))
            rows += own
            everything += flown
            if page is not None:
                asked = f"--only {name} --runs {runs} --seed {seed} --particles {particles}"
                asked += "" if baselines else " --no-baselines"
                measured = measured_now(("localization", "planning"))
                command = f"uavrt experiment search {asked}"
                text = page_section(SCENARIOS[name], own, command, measured)
                put_section(page, name, text, list(SCENARIOS))
            if pictures is not None:
                from uavrt_experiments.search import draw

                draw(SCENARIOS[name], flown, pictures / f"{name}.png")
    together = honesty(everything)
    sections += [
        f"T9  {one.case}: {one.quantity} {one.figure:.3g} ({one.low:.3g}–{one.high:.3g}), "
        f"asked {one.bar}, {one.n} judged, {one.verdict}"
        for one in together
    ]
    rows += together
    print(*sections, sep="\n\n", end="\n\n")
    print(f"{bars_kept(rows)}, {runs} runs")
    print(measured_now(("localization", "planning")))
    if output is not None:
        write_rows(output, rows)
