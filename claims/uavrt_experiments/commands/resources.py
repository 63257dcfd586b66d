"""The command ``uavrt experiment resources``."""

from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from uavrt.cli.options.kinds import Count, Counts, Minutes
from uavrt.cli.shown.outputs import print_json
from uavrt.drone.supervisor.tree.process_shapes import SHAPES
from uavrt_experiments.resources.run import THESIS_MINUTES, Plan, run_resources, run_shapes

LOADS = Plan().loads
"""Numbers of tags of the flights that search for the largest possible number."""


def resources(
    *,
    duration: Minutes = THESIS_MINUTES,
    tags: Count = 1,
    loads: Counts = LOADS,
    shapes: Annotated[bool, Parameter(negative="")] = False,
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Measure CPU and memory of each process in a long flight, with the thesis's tables.

    Samples come from a stand-in radio program at 3 MS/s. Then it flies with more and more
    tags until the system cannot keep up.

    Parameters
    ----------
    duration
        Length of the long flight in minutes; the thesis's times of measurement scale with it.
    tags
        Number of tags in the long flight; the thesis had one.
    loads
        Numbers of tags to try afterwards.
    shapes
        Instead of all this, fly the same flight with --tags in each shape of the process table
        (all stages in one process, one process per stage, workers), for --duration in total.
    json_summary
        Print one JSON object as the last line.
    """
    console = Console(stderr=True)
    if shapes:
        _shapes(duration, tags, console, json_summary)
        return
    plan = Plan(minutes=duration, tags=tags, loads=loads)
    report = run_resources(plan, say=lambda line: console.print(line))
    if json_summary:
        print_json(report.as_dict())
    else:
        print(report.table())


def _shapes(minutes: float, tags: int, console: Console, json_summary: bool) -> None:
    report = run_shapes(
        tags=tags, seconds=60.0 * minutes / len(SHAPES), say=lambda line: console.print(line)
    )
    if json_summary:
        print_json(report.as_dict())
    else:
        print(report.table())
