"""``uavrt experiment resources``."""

import json
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from uavrt.errors import UsageError
from uavrt.experiments.resources import Plan, run_resources, run_shapes
from uavrt.experiments.resources.run import THESIS_MINUTES
from uavrt.supervisor.shapes import SHAPES

WIDTH = 150


def resources(
    *,
    duration: float = THESIS_MINUTES,
    tags: int = 1,
    loads: tuple[int, ...] = Plan().loads,
    shapes: Annotated[bool, Parameter(negative="")] = False,
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Measure CPU and memory of each process in a long flight, beside the thesis's tables.

    Samples come from a stand-in radio program at 3 MS/s. Afterwards, flights with ever more
    tags until real time is lost.

    Parameters
    ----------
    duration
        Minutes of the long flight; the thesis's moments of measurement scale with it.
    tags
        Tags of the long flight; the thesis had one.
    loads
        Numbers of tags to try afterwards.
    shapes
        In place of all this: the same flight with --tags in each shape of the table of
        processes (all stages in one, one for each stage, workers), for --duration together.
    json_summary
        Print one JSON object as the last line.
    """
    if not duration > 0.0 or min((tags, *loads)) < 1:
        raise UsageError(
            f"{duration:g} minutes with {min((tags, *loads))} tags cannot be flown",
            remedy="Give --duration above 0, and --tags and --loads of 1 or more",
        )
    console = Console(stderr=True)
    if shapes:
        _shapes(duration, tags, console, json_summary)
        return
    plan = Plan(minutes=duration, tags=tags, loads=loads)
    report = run_resources(plan, say=lambda line: console.print(line))
    if json_summary:
        print(json.dumps(report.as_dict()))
    else:
        _output().print(report.table())


def _shapes(minutes: float, tags: int, console: Console, json_summary: bool) -> None:
    report = run_shapes(
        tags=tags,
        seconds=60.0 * minutes / len(SHAPES),
        say=lambda line: console.print(line),
    )
    if json_summary:
        print(json.dumps(report.as_dict()))
    else:
        _output().print(report.table())


def _output() -> Console:
    """Standard output; wide when it is no terminal, for tables of thirteen columns."""
    console = Console()
    return console if console.is_terminal else Console(width=WIDTH)
