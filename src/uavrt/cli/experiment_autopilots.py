"""``uavrt experiment autopilots``."""

import json
import signal
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter
from rich.console import Console

from uavrt.cli.kinds import Seed, Tally
from uavrt.errors import UsageError
from uavrt.recording import require_writable

COUNTS = ("surveys", "searches", "takeoffs", "others", "phases")


def autopilots(
    *,
    px4: Path | None = None,
    arducopter: Path | None = None,
    simulated: tuple[Literal["px4", "ardupilot"], ...] = (),
    surveys: Tally = 20,
    searches: Tally = 10,
    takeoffs: Tally = 20,
    others: Tally = 10,
    phases: Tally = 5,
    quick: Annotated[bool, Parameter(negative="")] = False,
    only: str = "",
    seed: Seed = 1,
    output: Path = Path("autopilots"),
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Rehearse every order and every takeover on the autopilots that will fly.

    Give the builds: uavrt starts each in simulation, one at a time, with the drone's real
    processes on its companion link, and a pilot of its own who arms, takes off and takes over.
    In real time: about eight hours for an autopilot, half an hour with --quick. Ctrl-C keeps
    what there is; the same command goes on. Exits with 1 when an order ends without its
    arrival, or a takeover does not end an order at once.

    Parameters
    ----------
    px4
        Directory of PX4's sources with a build of px4_sitl_default, or of that build.
    arducopter
        ArduCopter's program for the board sitl.
    simulated
        Our own simulated autopilots, to compare with.
    surveys, searches, takeoffs
        How many of these orders.
    others
        How many of each other order.
    phases
        At how many instants each takeover comes.
    quick
        One of each.
    only
        Only flights with this in their names, as "survey" or "pause by 193".
    seed
        Seed of places and instants.
    output
        Directory for the table, the outcomes, the programs' logs and every frame of each
        flight's companion link (.tlog).
    json_summary
        Print one JSON object as the last line.
    """
    from uavrt_experiments.autopilots import (
        Asked,
        arducopter_build,
        as_json,
        as_page,
        px4_build,
        rehearse,
        simulated_build,
    )
    from uavrt_experiments.kept import KeptOutcomes

    builds = [] if px4 is None else [px4_build(px4)]
    builds += [] if arducopter is None else [arducopter_build(arducopter)]
    builds += [simulated_build(one) for one in simulated]
    if not builds:
        raise UsageError("no autopilot is given", remedy="Give --px4 or --arducopter")
    require_writable(output)
    output.mkdir(parents=True, exist_ok=True)
    counts = (surveys, searches, takeoffs, others, phases)
    many = dict(zip(COUNTS, (1,) * 5 if quick else counts, strict=True))
    asked = Asked(**many, only=only, seed=seed)
    console = Console(stderr=True)
    stopped, failed = False, list[dict[str, Any]]()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with KeptOutcomes(output / "outcomes.jsonl", made_with=f"seed {seed}") as kept:
        try:
            rehearse(
                builds,
                asked,
                output,
                kept,
                failed,
                lambda line: console.print(line, markup=False, highlight=False),
            )
        except KeyboardInterrupt:
            stopped = True
        outcomes = [*kept.of(""), *failed]
    page = as_page(outcomes)
    (output / "table.md").write_text(page)
    summary = as_json(outcomes)
    (output / "table.json").write_text(json.dumps(summary, indent=1) + "\n")
    print(json.dumps(summary) if json_summary else page)
    if stopped:
        print("stopped before its end: repeat it to go on", file=sys.stderr)
        sys.exit(130)
    sys.exit(1 if summary["faults"] else 0)
