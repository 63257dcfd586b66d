"""``uavrt experiment packets``."""

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from uavrt.cli.kinds import Seed
from uavrt.clock import iso_utc
from uavrt.errors import ConfigError, UsageError
from uavrt.experiments.packets import Match, ModelRow, fly, match_logs, model_rows
from uavrt.recording import require_writable


def packets(
    onboard: Path | None = None,
    ground: Path | None = None,
    *,
    duration: float = 30.0,
    loss: float = 0.0,
    seed: Seed = 1,
    model_only: Annotated[bool, Parameter(name="--model", negative="")] = False,
    flight_dir: Path = Path("flights"),
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Compare the drone's log with the ground's, pulse by pulse (thesis §5.3).

    With two files it compares these. Without, the whole system flies in simulation, once with
    12 ms and once with 20 ms between messages, and the thesis's load runs through simulated
    radios that lose. Exits with 1 when a pulse is missing.

    Parameters
    ----------
    onboard
        A flight directory, or pulse_pose_log.txt.
    ground
        pulses.jsonl of `uavrt ground`, or QGroundControl's text with lines
        "CustomPluginLog: PULSE …".
    duration
        Minutes of each flight; the thesis flew 30.
    loss
        Share of the frames lost by the flights' radio link, each way.
    seed
        Seed of what is random.
    model_only
        Only the simulated radios, in virtual time: some seconds.
    flight_dir
        Where flight directories are made.
    json_summary
        Print one JSON object as the last line.
    """
    console = Console(stderr=True)
    if (onboard is None) != (ground is None):
        raise ConfigError("one log alone says nothing", remedy="Give the ground's log as well")
    if not (duration > 0.0 and 0.0 <= loss < 1.0):
        raise UsageError(
            f"{duration:g} minutes at a loss of {loss:g} cannot be flown",
            remedy="Give --duration above 0 and --loss from 0 to below 1; 0.2 is 20 %",
        )
    if onboard is None and not model_only:
        require_writable(flight_dir)
    flights: dict[str, Match] = {}
    rows: list[ModelRow] = []
    if onboard is not None and ground is not None:
        flights["logs"] = match_logs(onboard, ground)
    else:
        for gap_s in () if model_only else (0.012, 0.020):
            flights[f"{gap_s * 1e3:.0f} ms"] = fly(
                duration * 60.0,
                gap_s,
                loss=loss,
                seed=seed,
                flight_dir=flight_dir,
                say=lambda line: console.print(line),
            )
        rows = model_rows(seed=seed)
    if json_summary:
        found = {name: asdict(match) for name, match in flights.items()}
        print(json.dumps({"flights": found, "model": [asdict(row) for row in rows]}))
    else:
        _show(flights, rows)
    lost = any(match.missing for match in flights.values())
    lost = lost or any(row.received < row.sent for row in rows if row.acknowledged)
    sys.exit(1 if lost else 0)


def _show(flights: dict[str, Match], rows: list[ModelRow]) -> None:
    console = Console()
    table = Table("flight", "logged", "received", "missing", "twice", "unknown")
    for name, match in flights.items():
        missing = len(match.missing)
        numbers = (match.sent, match.received, missing, match.repeated, match.unknown)
        table.add_row(name, *map(str, numbers))
    if flights:
        table.add_row("thesis, 10 ms", "1486", "1482", "4", "", "")
        table.add_row("thesis, 20 ms, repeated", "", "", "0", "", "")
        console.print(table)
    for name, match in flights.items():
        for pulse in match.missing:
            console.print(f"{name}: missing tag {pulse.tag_id} at {iso_utc(pulse.time_ns)}")
    if rows:
        columns = ("ground", "gap ms", "loss", "sent", "received", "sends", "p95 s")
        lost = ("autopilot", "radio buffer", "air")
        table = Table(*columns, *lost, title="Simulated SiK radios; frames lost by hop")
        for row in rows:
            table.add_row(
                "acknowledges" if row.acknowledged else "plain",
                f"{row.gap_s * 1e3:.0f}",
                f"{row.loss:.0%}",
                *map(str, (row.sent, row.received, row.sends)),
                f"{row.p95_s:.2f}",
                *map(str, (row.dropped_by_autopilot, row.dropped_by_radio)),
                str(row.lost_in_the_air),
            )
        console.print(table)
