"""The command ``uavrt experiment integrate``."""

# isort: off
import uavrt.cli.shown.one_thread  # noqa: F401  before numpy

# isort: on
from pathlib import Path

from uavrt.cli.options.kinds import Count, Seed
from uavrt.cli.shown.outputs import check_place


def integrate(
    *,
    trials: Count = 100,
    seed: Seed = 1,
    only: str | None = None,
    case: str = "",
    output: Path | None = None,
) -> None:
    """Measure the evaluation of whole flights: false alarms, range, place and cost.

    Exits with 1 if a requirement is missed beyond the 95 % interval of the measurement.

    Parameters
    ----------
    trials
        Flights for each curve of detection; everything else in proportion. 100 take about
        a quarter of an hour of a core; the target figures require 600.
    seed
        Seed of everything random.
    only
        Experiments to run, e.g. I1,I4; by default all.
    case
        Only cases with this in their names.
    output
        Also write the table to this CSV file.
    """
    from uavrt_experiments.commands.shared import chosen, finish, part_done
    from uavrt_experiments.integrate.catalogue import EXPERIMENTS, FOLDERS, run_all
    from uavrt_experiments.measured import measured_now

    names = chosen(only, EXPERIMENTS)
    if output is not None:
        check_place(output, overwrite=True)
    # Of the code that was loaded: an edit while it runs must not count.
    measured = measured_now(FOLDERS)
    with part_done("flights") as on_progress:
        rows = run_all(
            [EXPERIMENTS[name] for name in names],
            trials=trials,
            seed=seed,
            case=case,
            on_progress=on_progress,
        )
    finish(rows, f"{trials} trials, seed {seed}", measured, output)
