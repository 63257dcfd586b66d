"""The command ``uavrt experiment detection``."""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

import uavrt
import uavrt.cli.shown.one_thread  # before numpy is imported
from uavrt.cli.options.kinds import Count, Seed
from uavrt.cli.shown.outputs import make_directory, print_json
from uavrt.core.errors import UsageError

if TYPE_CHECKING:
    from uavrt_experiments.detection.tables import Results


def detection(
    *,
    only: str | None = None,
    case: str = "",
    trials: Count = 50,
    seed: Seed = 1,
    workers: Count | None = None,
    output_dir: Path = Path("detection-experiment"),
    plots: bool = True,
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Measure the pulse detector against requirements, the original, and theoretical bounds.

    Prints the table and writes it (results.json, results.csv, results.md) with the curves
    (pd.png, pulses-summed.png, tracking.png, false-alarms.png). Experiments that are not run
    keep their rows of an earlier run in the same directory. Exits with 1 if a requirement
    is missed beyond the 95 % interval of the measurement.

    Parameters
    ----------
    only
        Experiments to run, e.g. E3,E8; by default all.
    case
        Only cases with this in their names; their rows are shown and not written.
    trials
        Decisions for each point of a Pd curve; everything else scales with it. 50 take eight
        minutes on two idle cores; the target figures require 600.
    seed
        Seed of all signals.
    workers
        Number of processes; by default one per core.
    output_dir
        Where to write.
    plots
        Draw the curves (needs the extra uavrt[analysis]).
    json_summary
        Print one JSON object as the last line instead of the table.
    """
    from uavrt_experiments.commands.shared import chosen, part_done
    from uavrt_experiments.detection.campaign import run_experiments
    from uavrt_experiments.detection.catalogue import EXPERIMENTS
    from uavrt_experiments.detection.plots import draw_all, require_matplotlib
    from uavrt_experiments.detection.tables import (
        FOLDERS,
        RESULTS,
        Origin,
        Results,
        as_json,
        read_results,
        write_results,
    )
    from uavrt_experiments.measured import measured_now

    wanted = [EXPERIMENTS[name] for name in chosen(only, EXPERIMENTS)]
    if case and not any(case in one.name for each in wanted for one in each.cases):
        raise UsageError(
            f'no case has "{case}" in its name',
            remedy="Choose from: "
            + "; ".join(one.name for each in wanted for one in each.cases),
        )
    if plots and not case:
        require_matplotlib()
    if not case:
        make_directory(output_dir, "--output-dir")
    earlier = read_results(output_dir / RESULTS)
    # Of the code that was loaded: an edit while the campaign runs must not count.
    measured = measured_now(FOLDERS)
    with part_done("detector") as on_progress:
        rows = run_experiments(
            wanted,
            trials=trials,
            seed=seed,
            workers=workers or os.cpu_count() or 1,
            case=case,
            on_progress=on_progress,
        )
    origin = Origin(version=uavrt.__version__, seed=seed, trials=trials, measured=measured)
    new = Results(rows=tuple(rows), origins={e.name: origin for e in wanted})
    paths: list[Path] = []
    if not case:
        results = earlier.merged(new)
        paths += write_results(output_dir, results)
        if plots:
            paths += draw_all(output_dir, results.rows)
    if json_summary:
        print_json(as_json(new))
    else:
        _show(new)
    if paths and not json_summary:
        print("Written: " + ", ".join(str(path) for path in paths))
    sys.exit(1 if any(row.contradicted for row in new.rows) else 0)


def _show(results: "Results") -> None:
    from uavrt_experiments.detection.catalogue import EXPERIMENTS
    from uavrt_experiments.tables import bars_kept, drawn

    for name in results.origins:
        rows = [row for row in results.rows if row.experiment == name]
        print(drawn(rows, f"{name}: {EXPERIMENTS[name].title}"), end="\n\n")
    print(bars_kept(results.rows))
