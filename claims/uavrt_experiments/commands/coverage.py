"""The command ``uavrt experiment coverage``."""

# isort: off
import uavrt.cli.shown.one_thread  # noqa: F401  before numpy

# isort: on
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from uavrt.cli.options.kinds import Count, Seed

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
    """Check coverage maps, and positions from weak pulses, over hills.

    C1: of the areas that a flight reports empty with 0.94 to 0.96, from groups of pulses, which
    share is empty (0.93 to 0.97)? C3: the same for whole flights, evaluated from their samples.
    C2: how far are positions by strength off, with a map of the heights and without, and do
    their 95 % circles contain the tag (0.9)? Exits with 1 if a required value lies beyond the
    95 % interval of the measurement. About a quarter of an hour of a core. Ctrl-C prints the
    results so far.

    Parameters
    ----------
    tags
        Undetected tags, for C1 and for C3.
    worlds
        Different hills and flights over them.
    flights
        Surveys by strength of each kind of ground.
    seed
        Random seed.
    only
        Experiments to run, e.g. C1,C3; by default all.
    kept
        File (.jsonl) of the results of finished flights: the same command continues from it.
    output
        Also write the table to this CSV file.
    json_summary
        Print one JSON object as the last line.
    """
    import uavrt_experiments
    from uavrt.cli.shown.outputs import check_place
    from uavrt.cli.shown.progress_bars import progress_bar
    from uavrt_experiments.commands.shared import chosen, finish
    from uavrt_experiments.coverage.absence import FOLDERS, SILENCES, seek_tags, silence_rows
    from uavrt_experiments.coverage.shadow import shadow_rows, survey_hills
    from uavrt_experiments.kept import KeptOutcomes
    from uavrt_experiments.measured import digest, measured_now

    names = chosen(only, _NAMES)
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
                    with progress_bar(f"{kind.experiment} silent tags", tags) as on_tag:
                        seek_tags(
                            kind, tags, kept=outcomes, flights=worlds, seed=seed, on_tag=on_tag
                        )
            if "C2" in names:
                with progress_bar("C2 surveys over hills", 3 * flights) as on_flight:
                    survey_hills(flights, kept=outcomes, seed=seed, on_flight=on_flight)
        except KeyboardInterrupt:
            stopped = True
        rows = [row for kind in SILENCES for row in silence_rows(kind, outcomes)]
        rows += shadow_rows(outcomes)
    rows = [row for name in names for row in rows if row.experiment == name]
    finish(
        rows, f"seed {seed}", measured, output, as_json=json_summary, stopped=stopped, kept=kept
    )
