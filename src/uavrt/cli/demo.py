"""``uavrt demo``: the whole system on this machine."""

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from uavrt.demo import run_demo


def demo(
    *,
    duration: float = 120.0,
    seed: int = 1,
    flight_dir: Path = Path("flights"),
    port: int | None = None,
    headless: Annotated[bool, Parameter(negative="")] = False,
    picture: Path | None = None,
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Fly the whole system on this machine, with simulated animals, radio and autopilot.

    The receiver, the detectors, the link and the ground station are the real ones; each is a
    process of its own, as in the field.

    Parameters
    ----------
    duration
        Length of the flight in seconds, at least 40.
    seed
        Seed of everything random in the simulated world.
    flight_dir
        Where the flight's directory is made.
    port
        UDP port of the ground station on this machine; a free one if not given.
    headless
        Show nothing while it runs.
    picture
        Save the live view's last state as an SVG file.
    json_summary
        Print one JSON object as the last line.
    """
    console = None if headless else Console(stderr=json_summary)
    summary = run_demo(
        duration_s=duration,
        seed=seed,
        flight_dir=flight_dir,
        ground_port=port,
        console=console,
        picture=picture,
    )
    if json_summary:
        print(json.dumps(summary.as_dict(), allow_nan=False))
    else:
        out = Console()
        out.print(summary.table())
        out.print(f"samples lost: {summary.samples_lost}")
        out.print(f"flight: {summary.flight_directory}", soft_wrap=True)
