"""The command ``uavrt experiment constants``."""

import resource
import sys
from pathlib import Path

from uavrt.cli.options.kinds import Count, Seed
from uavrt.cli.shown.outputs import check_place


def constants(
    *,
    runs: Count = 100,
    seed: Seed = 1,
    only: str | None = None,
    judges: str | None = None,
    singly: bool = False,
    output: Path | None = None,
) -> None:
    """Change the tuned constants of localization by 30 % up and down, and compare results.

    The constants of a group are changed together, and those of a group that matters also one
    by one. All changes meet the same simulated flights.

    Parameters
    ----------
    runs
        Size of the simulations; 100 take about two minutes of a core for each group.
    seed
        Seed of everything random.
    only
        Groups, records or constants, e.g. "TRACK;LEVELS, scatter"; by default all.
    judges
        Only simulations whose names begin so, e.g. "turn;six bearings".
    singly
        Change constants one by one from the beginning.
    output
        Also write the tables to this Markdown file.
    """
    from uavrt.core.errors import UsageError
    from uavrt_experiments.constants import screening
    from uavrt_experiments.constants.judges import JUDGES
    from uavrt_experiments.constants.report import kinds_line, table
    from uavrt_experiments.measured import measured_now

    if output is not None:
        check_place(output, overwrite=True)
    asked = None if only is None else [one.strip() for one in only.split(";")]
    for one in asked or ():
        if not screening.chosen([one], singly=singly):
            raise UsageError(
                f"there is no tuned constant {one}",
                remedy=f"Choose from {'; '.join(screening.groups())}",
            )
    chosen = screening.chosen(asked, singly=singly)
    names = () if judges is None else [one.strip() for one in judges.split(";")]
    for one in names:
        if not any(judge.startswith(one) for judge in JUDGES):
            raise UsageError(
                f"there is no simulation whose name begins with {one}",
                remedy=f"Choose from {'; '.join(JUDGES)}",
            )
    measured = measured_now(("localization",))

    def shown(one: screening.Screened) -> None:
        print(f"{one.name}: {one.verdict}", *one.largest(3), sep="\n    ", file=sys.stderr)

    screened = screening.screen(
        chosen,
        runs,
        seed,
        judges=names,
        on_screened=shown,
    )
    if not singly:
        single = {
            path: (path,)
            for one in screened
            if one.matters and len(one.constants) > 1
            for path in one.constants
        }
        screened += screening.screen(
            single,
            runs,
            seed,
            judges=names,
            on_screened=shown,
        )
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    minutes = (used.ru_utime + used.ru_stime) / 60.0
    text = "\n\n".join(
        (
            kinds_line(),
            table(screened),
            f"{runs} runs, seed {seed}; {minutes:.0f} minutes of CPU time.",
            measured,
        )
    )
    print(text)
    if output is not None:
        output.write_text(f"{text}\n", encoding="utf-8")
