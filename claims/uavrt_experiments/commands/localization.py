"""The command ``uavrt experiment localization``."""

import sys
from pathlib import Path

from uavrt.cli.options.kinds import Count, Seed
from uavrt.cli.shown.outputs import check_place


def localization(
    *, runs: Count = 300, seed: Seed = 1, only: str | None = None, output: Path | None = None
) -> None:
    """Measure bearings and positions against requirements and theoretical bounds.

    Parameters
    ----------
    runs
        Simulated turns or surveys for each condition; 300 take about half
        an hour of a core.
    seed
        Seed of everything random; all methods get the same flights.
    only
        One experiment, such as B1 or L4.
    output
        Also write the table to this CSV file.
    """
    from uavrt.core.errors import UsageError
    from uavrt_experiments.localization.experiments import EXPERIMENTS
    from uavrt_experiments.measured import measured_now
    from uavrt_experiments.result import Row
    from uavrt_experiments.tables import bars_kept, drawn, write_rows

    chosen = {
        name: experiment
        for name, experiment in EXPERIMENTS.items()
        if only is None or only in name.split(", ")
    }
    if not chosen:
        known = ", ".join(EXPERIMENTS)
        raise UsageError(f"there is no experiment {only}", remedy=f"Choose from {known}")
    if output is not None:
        check_place(output, overwrite=True)
    results: list[Row] = []
    for name, experiment in chosen.items():
        print(f"{name} …", file=sys.stderr)
        results += experiment(runs, seed)
    print(drawn(results))
    print(f"{bars_kept(results)}, {runs} runs each")
    print(measured_now(("localization",)))
    if output is not None:
        write_rows(output, results)
