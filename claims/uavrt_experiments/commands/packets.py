"""The command ``uavrt experiment packets``."""

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from uavrt.cli.options.kinds import Minutes, Seed, Share
from uavrt.cli.shown.outputs import print_json
from uavrt.core.clock import iso_utc
from uavrt.core.errors import ConfigError, UsageError
from uavrt.flight.flight_layout import require_writable
from uavrt_experiments.packets.flight import fly
from uavrt_experiments.packets.matching import Match, match_logs
from uavrt_experiments.packets.model import ModelRow, model_rows
from uavrt_experiments.tables import drawn


def packets(
    onboard: Path | None = None,
    ground: Path | None = None,
    *,
    duration: Minutes = 30.0,
    loss: Share = 0.0,
    seed: Seed = 1,
    model_only: Annotated[bool, Parameter(name="--model", negative="")] = False,
    flight_dir: Path = Path("flights"),
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Compare the drone's log with the ground's, pulse by pulse (thesis §5.3).

    With two files it compares these. Without, the whole system flies in simulation, once with
    12 ms and once with 20 ms between messages, and the thesis's load runs through simulated
    lossy radios. Exits with 1 when a pulse is missing.

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
        Fraction of the frames lost on the radio link, each way.
    seed
        Random seed.
    model_only
        Only the simulated radios, in virtual time; takes a few seconds.
    flight_dir
        Directory in which flight directories are created.
    json_summary
        Print one JSON object as the last line.
    """
    console = Console(stderr=True)
    if (onboard is None) != (ground is None):
        raise ConfigError(
            "one log alone cannot be compared", remedy="Give the ground's log as well"
        )
    if loss == 1.0:
        raise UsageError(
            "a loss of 100 % leaves nothing to measure",
            remedy="Give --loss below 1; 0.2 is 20 %",
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
    results = [match.result(name) for name, match in flights.items()]
    results += [row.result for row in rows]
    if json_summary:
        found = {name: asdict(match) for name, match in flights.items()}
        print_json({"flights": found, "model": rows})
    else:
        print(drawn(results))
        for name, match in flights.items():
            for pulse in match.missing:
                print(f"{name}: missing tag {pulse.tag_id} at {iso_utc(pulse.time_ns)}")
    sys.exit(0 if all(row.met for row in results) else 1)
