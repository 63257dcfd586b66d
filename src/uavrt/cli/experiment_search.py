"""``uavrt experiment search``."""

import csv
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from annotated_types import Ge

from uavrt.cli.kinds import Seed
from uavrt.cli.outputs import check_place

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


def _advanced(progress: "Progress", task: "TaskID", done: int) -> None:
    progress.update(task, completed=done)


def search(
    *,
    runs: Annotated[int, Ge(1)] = 100,
    seed: Seed = 1,
    only: str | None = None,
    baselines: bool = True,
    particles: Annotated[int, Ge(100)] = 10_000,
    workers: Annotated[int, Ge(1)] = 2,
    output: Path | None = None,
    pictures: Path | None = None,
) -> None:
    """Search simulated animals with every planner, against the published tables.

    Parameters
    ----------
    runs
        Of our planner in each table; the baselines fly a share of them, with the same seeds.
    seed
        Seed of everything random.
    only
        One table, such as T2.
    baselines
        Fly the other planners, too.
    particles
        Hypotheses of each tag.
    workers
        Processes.
    output
        Also write the table to this CSV file.
    pictures
        Draw the paths into this folder.
    """
    from rich.console import Console
    from rich.progress import Progress

    from uavrt.errors import UsageError
    from uavrt.experiments.figures import COLUMNS, cells, table
    from uavrt.experiments.measured import measured_now
    from uavrt.experiments.result import Row
    from uavrt.experiments.search import SCENARIOS, fly_all, plan, results

    if only is not None and only not in SCENARIOS:
        raise UsageError(
            f"there is no table {only}", remedy=f"Known are {', '.join(SCENARIOS)}"
        )
    if output is not None:
        check_place(output, overwrite=True)
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    with Progress(console=Console(file=sys.stderr)) as progress:
        for name in [only] if only is not None else list(SCENARIOS):
            planned = plan(name, runs, seed, particles, baselines=baselines)
            task = progress.add_task(f"{name}: {SCENARIOS[name].title}", total=len(planned))
            advance = partial(_advanced, progress, task)
            flown = fly_all(planned, workers=workers, on_progress=advance)
            rows += results(SCENARIOS[name], flown)
            if pictures is not None:
                from uavrt.experiments.search.pictures import draw

                draw(SCENARIOS[name], flown, pictures / f"{name}.png")
    print(table(rows))
    barred = [one for one in rows if one.least is not None or one.most is not None]
    print(f"{sum(one.met for one in barred)} of {len(barred)} bars kept, {runs} runs")
    print(measured_now(("localization", "planning")))
    if output is not None:
        with output.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            writer.writerows(cells(one) for one in rows)
