"""``uavrt demo``: the whole system on this machine."""

import json
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from uavrt.cli.kinds import Port, Seed
from uavrt.cli.outputs import check_place
from uavrt.cli.screen import has_page, has_screen
from uavrt.demo import run_demo


def demo(
    *,
    duration: float = 120.0,
    seed: Seed = 1,
    flight_dir: Path = Path("flights"),
    port: Port = 0,
    browser: bool = True,
    headless: Annotated[bool, Parameter(negative="")] = False,
    picture: Path | None = None,
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Fly the whole system on this machine, with simulated animals, radio and autopilot.

    The receiver, the detectors, the link and the ground station are the real ones; each is a
    process of its own, as in the field. The page shows the flight while it goes on; afterwards
    `uavrt ground -o FLIGHTS/ground` shows it again.

    Parameters
    ----------
    duration
        Length of the flight in seconds, at least 40.
    seed
        Seed of everything random in the simulated world.
    flight_dir
        Where the flight's directory is made.
    port
        Port of the ground station's page; any free one if not given.
    browser
        Open the page in a browser, where this computer has a screen.
    headless
        Show nothing while it runs, neither page nor terminal view.
    picture
        Save the live view's last state as an SVG file.
    json_summary
        Print one JSON object as the last line.
    """
    if picture is not None:
        check_place(picture, overwrite=True)
    console = None if headless else Console(stderr=json_summary)
    summary = run_demo(
        duration_s=duration,
        seed=seed,
        flight_dir=flight_dir,
        console=console,
        picture=picture,
        page_port=port if not headless and has_page() else None,
        on_page=_opener(browser, console),
    )
    if json_summary:
        print(json.dumps(summary.as_dict(), allow_nan=False))
    else:
        out = Console()
        out.print(summary.table())
        out.print(f"samples lost: {summary.samples_lost}")
        out.print(f"flight: {summary.flight_directory}", soft_wrap=True)


def _opener(browser: bool, console: Console | None) -> Callable[[str], None]:
    """Open the page where there is a screen; tell its address in any case."""

    def show(address: str) -> None:
        if console is not None:
            console.print(f"The ground station's page is at [bold]{address}[/bold]")
        if browser and has_screen():
            webbrowser.open(address)

    return show
