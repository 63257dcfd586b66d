"""The command ``uavrt experiment autopilots``."""

import json
import signal
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter
from rich.console import Console

from uavrt.cli.options.kinds import Seed, Tally
from uavrt.core.errors import UsageError
from uavrt.flight.flight_layout import require_writable

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

    uavrt starts each given build in simulation, one at a time, and connects the drone's real
    processes to its companion link. A simulated pilot arms, takes off and takes over. This
    takes about eight hours for each autopilot, half an hour with --quick. Ctrl-C keeps the
    finished flights; the same command continues with the missing ones. The exit status is 1
    when an order ends before its arrival, or a command follows a takeover.

    Parameters
    ----------
    px4
        Directory of PX4's sources with a build of px4_sitl_default, or the build's directory.
    arducopter
        ArduCopter program that was built for the board sitl.
    simulated
        Fly uavrt's own simulated autopilots too, for comparison.
    surveys, searches, takeoffs
        Number of surveys, searches and take-offs for each autopilot.
    others
        Number of each other order (goto, turn, hold, return).
    phases
        Number of random instants at which each takeover is flown.
    quick
        Fly one of each.
    only
        Fly only flights whose name contains this text, such as "survey" or "pause by 193".
    seed
        Random seed of the places and instants.
    output
        Directory for the table, the outcomes, the programs' logs and each flight's
        companion-link frames (.tlog).
    json_summary
        Print one JSON object as the last line.
    """
    from uavrt_experiments.autopilots.builds import arducopter_build, px4_build, simulated_build
    from uavrt_experiments.autopilots.flights import Asked, rehearse
    from uavrt_experiments.autopilots.table import as_json, as_page
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
        print("stopped; the same command continues", file=sys.stderr)
        sys.exit(130)
    sys.exit(1 if summary["faults"] else 0)
