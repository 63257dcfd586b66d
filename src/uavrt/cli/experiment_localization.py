"""``uavrt experiment localization``."""

import csv
import sys
from pathlib import Path

from uavrt.cli.kinds import Seed
from uavrt.cli.outputs import check_place


def localization(
    *, runs: int = 300, seed: Seed = 1, only: str | None = None, output: Path | None = None
) -> None:
    """Measure bearings and positions against their bars and the bounds of theory.

    Parameters
    ----------
    runs
        Simulated turns or surveys for each condition; 300 take ten minutes.
    seed
        Seed of everything random; the same for all methods, so that they see the same.
    only
        One experiment, such as B1 or L4.
    output
        Also write the table to this CSV file.
    """
    from uavrt.errors import UsageError
    from uavrt.experiments.localization import COLUMNS, EXPERIMENTS, Row, cells, table
    from uavrt.experiments.measured import measured_now

    if runs < 1:
        raise UsageError(f"{runs} runs measure nothing", remedy="Give --runs of 1 or more")
    chosen = {
        name: experiment
        for name, experiment in EXPERIMENTS.items()
        if only is None or only in name.split(", ")
    }
    if not chosen:
        known = ", ".join(EXPERIMENTS)
        raise UsageError(f"there is no experiment {only}", remedy=f"Known are {known}")
    if output is not None:
        check_place(output, overwrite=True)
    results: list[Row] = []
    for name, experiment in chosen.items():
        print(f"{name} …", file=sys.stderr)
        results += experiment(runs, seed)
    print(table(results))
    missed = sum(not one.met for one in results)
    barred = sum(one.least is not None or one.most is not None for one in results)
    print(f"{barred - missed} of {barred} bars kept, {runs} runs each")
    print(measured_now(("localization",)))
    if output is not None:
        with output.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            writer.writerows(cells(one) for one in results)
