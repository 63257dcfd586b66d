"""``uavrt experiment integrate``."""

# isort: off
import uavrt.cli.one_thread  # noqa: F401  before numpy

# isort: on
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from uavrt.cli.kinds import Count, Seed
from uavrt.cli.outputs import check_place

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


def integrate(
    *,
    trials: Count = 100,
    seed: Seed = 1,
    only: str | None = None,
    case: str = "",
    output: Path | None = None,
) -> None:
    """Measure what judging whole flights reaches: false alarms, range, place and cost.

    Exits with 1 when a bar lies beyond the 95 % interval of what was measured.

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
    from uavrt.errors import UsageError
    from uavrt_experiments.integrate.catalogue import EXPERIMENTS, FOLDERS, run_all
    from uavrt_experiments.measured import measured_now
    from uavrt_experiments.tables import bars_kept, drawn, write_rows

    names = list(EXPERIMENTS) if only is None else [one.strip() for one in only.split(",")]
    unknown = [name for name in names if name not in EXPERIMENTS]
    if unknown:
        raise UsageError(
            f"there is no experiment {', '.join(unknown)}",
            remedy=f"Choose from {', '.join(EXPERIMENTS)}",
        )
    if output is not None:
        check_place(output, overwrite=True)
    # Of the code that was loaded: an edit while it runs must not count.
    measured = measured_now(FOLDERS)
    with _progress() as on_progress:
        rows = run_all(
            [EXPERIMENTS[name] for name in names],
            trials=trials,
            seed=seed,
            case=case,
            on_progress=on_progress,
        )
    print(drawn(rows))
    print(f"{bars_kept(rows)}; {trials} trials, seed {seed}")
    print(measured)
    if output is not None:
        write_rows(output, rows)
    sys.exit(1 if any(row.contradicted for row in rows) else 0)


@contextmanager
def _progress() -> "Iterator[Callable[[float, str], None]]":
    """Show how far it is."""
    from rich.console import Console
    from rich.progress import Progress, TimeElapsedColumn, TimeRemainingColumn

    columns = (*Progress.get_default_columns()[:3], TimeRemainingColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("flights", total=1.0)
        yield lambda part, what: bar.update(task, completed=part, description=what)
