"""``uavrt experiment coverage``."""

# isort: off
import uavrt.cli.one_thread  # noqa: F401  before numpy

# isort: on
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from uavrt.cli.kinds import Count, Seed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_NAMES = ("C1", "C2", "C3")


def coverage(
    *,
    tags: Count = 1200,
    worlds: Count = 8,
    flights: Count = 40,
    seed: Seed = 1,
    only: str | None = None,
    kept: Path | None = None,
    output: Path | None = None,
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Check what silence and weak pulses say over hills.

    C1: of areas said to be empty with .94 to .96 by a flight that listens to groups of pulses,
    how many are (.93 to .97)? C3: the same by whole flights, judged from their samples. C2: how
    far are positions by strength off, with a map of the heights and without, and do their
    circles of 95 % hold (.9)? Exits with 1 when a bar lies beyond the 95 % interval of what was
    measured. About a quarter of an hour of a core. Ctrl-C prints what there is so far.

    Parameters
    ----------
    tags
        Tags that are not heard, for C1 and for C3.
    worlds
        Different hills and flights over them.
    flights
        Surveys by strength of each kind of ground.
    seed
        Seed of what is random.
    only
        Experiments to run, e.g. C1,C3; by default all.
    kept
        File (.jsonl) of what every finished flight brought: the same command with it goes on
        where it was stopped.
    output
        Also write the table to this CSV file.
    json_summary
        Print one JSON object as the last line.
    """
    import uavrt_experiments
    from uavrt.cli.outputs import check_place, print_json
    from uavrt.errors import UsageError
    from uavrt_experiments.coverage.absence import FOLDERS, SILENCES, seek_tags, silence_rows
    from uavrt_experiments.coverage.shadow import shadow_rows, survey_hills
    from uavrt_experiments.kept import KeptOutcomes
    from uavrt_experiments.measured import digest, measured_now
    from uavrt_experiments.tables import bars_kept, drawn, write_rows

    names = _NAMES if only is None else tuple(one.strip() for one in only.split(","))
    unknown = [name for name in names if name not in _NAMES]
    if unknown:
        raise UsageError(
            f"there is no experiment {', '.join(unknown)}",
            remedy=f"Choose from {', '.join(_NAMES)}",
        )
    for place in (kept, output):
        if place is not None:
            check_place(place, overwrite=True)
    # Of the code that was loaded: an edit while it runs must not count.
    measured = measured_now(FOLDERS)
    ours = digest(("coverage",), Path(uavrt_experiments.__file__).parent)
    made_with = f"seed {seed}, code {digest(FOLDERS)} and {ours}"
    stopped = False
    with KeptOutcomes(kept, made_with=made_with) as outcomes:
        try:
            for kind in SILENCES:
                if kind.experiment in names:
                    with _progress(f"{kind.experiment} silent tags", tags) as on_tag:
                        seek_tags(
                            kind, tags, kept=outcomes, flights=worlds, seed=seed, on_tag=on_tag
                        )
            if "C2" in names:
                with _progress("C2 surveys over hills", 3 * flights) as on_flight:
                    survey_hills(flights, kept=outcomes, seed=seed, on_flight=on_flight)
        except KeyboardInterrupt:
            stopped = True
        rows = [row for kind in SILENCES for row in silence_rows(kind, outcomes)]
        rows += shadow_rows(outcomes)
    rows = [row for name in names for row in rows if row.experiment == name]
    if json_summary:
        print_json(rows)
    else:
        print(drawn(rows))
        print(f"{bars_kept(rows)}; seed {seed}")
        print(measured)
    if output is not None:
        write_rows(output, rows)
    if stopped:
        goes_on = "the rest is lost without --kept" if kept is None else "repeat it to go on"
        print(f"stopped before its end: {goes_on}", file=sys.stderr)
        sys.exit(130)
    sys.exit(1 if any(row.contradicted for row in rows) else 0)


@contextmanager
def _progress(what: str, total: int) -> "Iterator[Callable[[int], None]]":
    """Show how many are done."""
    from rich.console import Console
    from rich.progress import Progress, TimeElapsedColumn, TimeRemainingColumn

    columns = (*Progress.get_default_columns()[:3], TimeRemainingColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)
