"""``uavrt demo``: run the whole system on this machine, with a simulated world."""

import sys
import webbrowser
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from uavrt.cli.options.kinds import Between, Port, Seconds, Seed
from uavrt.cli.shown.notices import notice
from uavrt.cli.shown.outputs import check_place, print_json
from uavrt.cli.shown.screen import has_page, has_screen
from uavrt.core.errors import UsageError
from uavrt.simulation.demo.demo_run import Demo
from uavrt.simulation.demo.demo_search import SearchDemo, SearchSummary
from uavrt.simulation.demo.search_together import TogetherDemo, TogetherSummary
from uavrt.simulation.demo.worlds import flight_world, search_world
from uavrt.simulation.scene.demo_world import fleet_scenarios
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.vehicle.airframe import Flavour

SEARCH_S = 600.0


def demo(
    *,
    search: Annotated[bool, Parameter(negative="")] = False,
    drones: Annotated[int, Parameter(validator=Between(least=1, most=4))] = 1,
    scenario: Path | None = None,
    coded: Annotated[bool, Parameter(negative="")] = False,
    duration: Seconds | None = None,
    seed: Seed | None = None,
    autopilot: Flavour = "px4",
    flight_dir: Path = Path("flights"),
    port: Port = 0,
    browser: bool = True,
    headless: Annotated[bool, Parameter(negative="")] = False,
    picture: Path | None = None,
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Fly the whole system on this machine, with simulated animals, radio and autopilot.

    The receiver, the detectors, the link and the ground station are the real ones, each in its
    own process, as in the field. The page shows the flight live; afterwards
    `uavrt ground -o FLIGHTS/ground` shows it again.

    Parameters
    ----------
    search
        The drone finds three animals by itself, one of them walking, without any command from
        a person; its decisions are printed as it takes them. Exits with 1 unless all are found.
    drones
        Number of drones, up to four, that fly side by side, each with its own receiver; one
        ground station has a page for each. Two take about half of a core. With --search they
        search together, each deciding by itself.
    scenario
        A scenario file (TOML) whose world is flown in instead of the built-in one, along its
        own flight; with --search the drone hovers over its home at first.
    coded
        Two more animals, with coded tags that share a frequency; with --search two of the
        three have such tags, the walking one, too.
    duration
        Length of the flight in seconds, at least 40; 120 unless given, or the scenario
        file's. With --search, the time after which the drone returns; 600 unless given.
    seed
        Seed of everything random in the simulated world; 1 unless given, or the scenario
        file's.
    autopilot
        Autopilot that the simulated one behaves like.
    flight_dir
        Directory in which the flight directory is created.
    port
        Port of the ground station's page; by default any free one.
    browser
        Open the page in a browser if this computer has a screen.
    headless
        Show neither page nor terminal view while it runs.
    picture
        Save the live view's last state as an SVG file.
    json_summary
        Print one JSON object as the last line.
    """
    if drones > 1 and picture is not None:
        raise UsageError(
            "--picture does not work with --drones", remedy="Leave one of them out"
        )
    if search:
        limit_s = duration or SEARCH_S
        world = search_world(scenario, limit_s=limit_s, seed=seed, coded=coded)
        _search(drones, world, limit_s, flight_dir, autopilot, json_summary=json_summary)
        return
    world = flight_world(scenario, duration_s=duration, seed=seed, coded=coded)
    if picture is not None:
        check_place(picture, overwrite=True)
    console = None if headless else Console(stderr=json_summary)
    if headless:
        notice(f"Flying for {world.duration_s:.0f} s without a display; then the result.")
    flown = Demo(
        scenarios=[world] if drones == 1 else fleet_scenarios(drones, world),
        flight_dir=flight_dir,
        console=console,
        page_port=port if drones > 1 or (not headless and has_page()) else None,
        on_page=_opener(browser, console),
        on_ros_domain=_print_domain if headless else None,
        autopilot=autopilot,
    ).run(picture)
    if json_summary:
        print_json({"drones": flown} if drones > 1 else flown[1])
        return
    screen = Console()
    for number, summary in flown.items():
        if drones > 1:
            screen.print(f"[bold]drone {number}[/bold]", summary.table())
        else:
            screen.print(summary.table())
        screen.print(f"samples lost: {summary.samples_lost}")
        screen.print(f"flight: {summary.flight_directory}", soft_wrap=True)


def _search(
    drones: int,
    world: Scenario,
    limit_s: float,
    flight_dir: Path,
    autopilot: Flavour,
    *,
    json_summary: bool,
) -> None:
    """Run a search with one or more simulated drones; exit with 1 unless all are found."""
    out = sys.stderr if json_summary else sys.stdout
    say = partial(print, file=out, flush=True)
    kind = partial(TogetherDemo, drones=drones) if drones > 1 else SearchDemo
    summary: SearchSummary | TogetherSummary = kind(
        scenario=world, limit_s=limit_s, flight_dir=flight_dir, say=say, autopilot=autopilot
    ).run()
    if json_summary:
        print_json(summary)
    else:
        _print_search(summary)
    if not summary.complete:
        sys.exit(1)


def _print_search(summary: SearchSummary | TogetherSummary) -> None:
    screen = Console()
    if isinstance(summary, SearchSummary):
        screen.print(summary.table())
        cpu, memory = summary.guide_cpu_percent, summary.guide_memory_mb
        screen.print(f"guide: {cpu:.1f} % of a core, {memory:.0f} MB")
        screen.print(f"flight: {summary.flight_directory}", soft_wrap=True)
        return
    for number, one in summary.drones.items():
        screen.print(f"[bold]drone {number}[/bold]", one.table())
        screen.print(f"flight: {one.flight_directory}", soft_wrap=True)
    screen.print(
        f"{len(summary.found)} found, after {summary.duration_s:.0f} s; "
        f"never less than {summary.apart_m:.0f} m apart"
    )


def _print_domain(domain: int) -> None:
    notice(f"ROS 2: ROS_DOMAIN_ID={domain} ros2 topic list")


def _opener(browser: bool, console: Console | None) -> Callable[[str], None]:
    """Function that prints the page's address, and opens it if `browser` and on a screen."""

    def show(address: str) -> None:
        if console is not None:
            console.print(f"The ground station's page is at [bold]{address}[/bold]")
        if browser and has_screen():
            webbrowser.open(address)

    return show
