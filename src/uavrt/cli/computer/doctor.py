"""``uavrt doctor``: check this computer for problems."""

import logging
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.text import Text

from uavrt.cli.computer.bench import bench_findings
from uavrt.cli.system.run import DEFAULT_CONFIG, settings_from
from uavrt.config.settings import Settings
from uavrt.core.errors import UsageError
from uavrt.core.log import configure_logging
from uavrt.core.messages import SystemStatus
from uavrt.drone.computer.autopilot_setup import examine_autopilot
from uavrt.drone.computer.computer_checks import examine
from uavrt.drone.computer.finding import Finding, failed
from uavrt.drone.status_reader import running_status, status_socket_path
from uavrt.link.mavlink.links.address import parse_address


def doctor(
    *,
    config: Annotated[Path, Parameter(alias="-c")] = DEFAULT_CONFIG,
    flight: Annotated[bool, Parameter(negative="")] = False,
    autopilot: Annotated[bool, Parameter(negative="")] = False,
    fix: Annotated[bool, Parameter(negative="")] = False,
    port: str | None = None,
    mavlink: str | None = None,
) -> None:
    """Check radio, permissions, autopilot, clock, disk, card, processor and temperature.

    Each line shows ok or a remedy. Exits with status 1 if a check has failed.

    Parameters
    ----------
    config
        Settings file for the flight.
    flight
        Go through the checklist before a first flight: observe the running system for
        half a minute, with a tag on the bench. The page has the same list under Check.
    autopilot
        Check only the autopilot's parameters for the link between drone and ground.
    fix
        With --autopilot: correct what is wrong. Nothing is ever changed without this option.
    port
        The autopilot's port that this computer is connected to; by default TELEM2.
    mavlink
        Link to the autopilot instead of the one in the settings, e.g. over USB:
        serial:///dev/ttyACM0:57600.
    """
    settings = settings_from(config)
    if fix and not autopilot:
        raise UsageError("--fix has no effect without --autopilot", remedy="Add --autopilot")
    if mavlink is not None:
        parse_address(mavlink)
    if port is not None and not autopilot:
        raise UsageError("--port has no effect without --autopilot", remedy="Add --autopilot")
    if flight and mavlink is not None:
        raise UsageError(
            "--flight checks the running system over its own link, so --mavlink has no effect",
            remedy="Leave --mavlink out, or leave out --flight",
        )
    if flight and autopilot:
        raise UsageError(
            "--flight and --autopilot select different checklists",
            remedy="Give only one of them",
        )
    configure_logging("doctor", level=logging.ERROR)  # the findings say it in words
    running = running_status(status_socket_path(settings))
    findings = (
        autopilot_findings(settings, running, port=port, mavlink=mavlink, fix=fix)
        if autopilot
        else bench_findings(settings)
        if flight
        else examine(settings, running, mavlink=mavlink)
    )
    console = Console()
    good = True
    for finding in findings:
        good = good and (finding.ok or finding.open)
        mark = Text("?  ", "yellow") if finding.open else Text("!! ", "bold red")
        mark = Text("ok ", "green") if finding.ok else mark
        line = Text.assemble(mark, f"{finding.what:<12} ", finding.text)
        if finding.remedy:
            line.append(f". {finding.remedy}", "yellow")
        console.print(line, soft_wrap=True)
    sys.exit(0 if good else 1)


def autopilot_findings(
    settings: Settings,
    running: SystemStatus | None,
    *,
    port: str | None,
    mavlink: str | None,
    fix: bool,
) -> Iterable[Finding]:
    """Check the autopilot's parameters, and correct them if `fix`; fails while uavrt runs."""
    address = mavlink or settings.mavlink.address
    if not address:
        raise UsageError("no autopilot is configured", remedy="Give its link with --mavlink")
    if running is not None and mavlink is None:
        text = "uavrt runs and holds the link to the autopilot"
        remedy = "Stop it first: sudo systemctl stop uavrt"
        return [failed("autopilot", text, remedy)]
    flown = parse_address(settings.mavlink.address) if settings.mavlink.address else None
    if port is None and flown is not None and flown.device:
        port = "TELEM2"
    baud = flown.baud if flown is not None and flown.device else None
    return examine_autopilot(address, port=port, baud=baud, fix=fix)
