"""The command ``uavrt experiment recovery``."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from uavrt.cli.options.kinds import Seed, Tally
from uavrt.cli.shown.outputs import print_json
from uavrt.flight.flight_layout import require_writable
from uavrt_experiments.recovery.run import Plan, run_recovery
from uavrt_experiments.tables import drawn


def recovery(
    *,
    kills: Tally = 50,
    stops: Tally = 3,
    bursts: Tally = 3,
    supervisor_kills: Tally = 5,
    power_cuts: Tally = 100,
    seed: Seed = 1,
    flight_dir: Path = Path("flights"),
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Kill every process of a simulated flight, and measure recovery times and lost pulses.

    A pulse that was detected must be in the flight's database, in its log and on the ground.
    Exits with 1 when a limit is not met. In real time: about 20 minutes by default.

    Parameters
    ----------
    kills
        Number of single processes to kill: each by SIGKILL and by SIGSTOP, then at random.
    stops
        Number of times to stop the connection by SIGSTOP, one after the other.
    bursts
        Number of bursts in which one process is killed six times, each time as soon as it runs
        again.
    supervisor_kills
        Number of times to kill the supervisor, under a stand-in for systemd.
    power_cuts
        Number of times to kill everything at once, at a random moment.
    seed
        Random seed.
    flight_dir
        Directory in which the flight directory is created.
    json_summary
        Print one JSON object as the last line.
    """
    require_writable(flight_dir)
    console = Console(stderr=True)
    plan = Plan(
        kills=kills,
        stops=stops,
        bursts=bursts,
        supervisor_kills=supervisor_kills,
        power_cuts=power_cuts,
        seed=seed,
    )
    report = run_recovery(plan, flight_dir, say=lambda line: console.print(line))
    if json_summary:
        print_json(report.as_dict())
    else:
        print("\n".join((drawn(report.rows()), *report.faults)))
    sys.exit(0 if report.ok else 1)
