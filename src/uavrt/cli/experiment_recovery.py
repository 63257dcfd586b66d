"""``uavrt experiment recovery``."""

import json
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from uavrt.cli.kinds import Seed
from uavrt.errors import UsageError
from uavrt.experiments.recovery import Plan, run_recovery
from uavrt.recording import require_writable


def recovery(
    *,
    kills: int = 50,
    stops: int = 3,
    bursts: int = 3,
    supervisor_kills: int = 5,
    power_cuts: int = 100,
    seed: Seed = 1,
    flight_dir: Path = Path("flights"),
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Kill every process of a simulated flight: how fast is it back, is a pulse lost?

    A pulse that was detected must be in the flight's database, in its log and on the ground.
    Exits with 1 when a limit is not met. In real time: about 20 minutes by default.

    Parameters
    ----------
    kills
        Of single processes: each by SIGKILL and by SIGSTOP, then at random.
    stops
        Of the connection, by SIGSTOP, one after the other.
    bursts
        Times that one process is killed six times, each time as soon as it runs again.
    supervisor_kills
        Of the supervisor, under a stand-in for systemd.
    power_cuts
        Everything killed at once, at a random moment.
    seed
        Seed of what is random.
    flight_dir
        Where the flight's directory is made.
    json_summary
        Print one JSON object as the last line.
    """
    if min(kills, stops, bursts, supervisor_kills, power_cuts) < 0:
        raise UsageError(
            "nothing is killed less than no times",
            remedy="Give --kills, --stops, --bursts, --supervisor-kills and --power-cuts of 0 "
            "or more",
        )
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
        print(json.dumps(report.as_dict()))
    else:
        Console().print(report.table())
    sys.exit(0 if report.ok else 1)
