"""``uavrt doctor``: what is wrong with this computer."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.text import Text

from uavrt.cli.run import DEFAULT_CONFIG, settings_from
from uavrt.computer import examine
from uavrt.config.settings import Settings
from uavrt.errors import UavrtError
from uavrt.messages import SystemStatus
from uavrt.monitor import StatusReader, status_socket_path

STATUS_S = 3.0


def doctor(*, config: Annotated[Path, Parameter(alias="-c")] = DEFAULT_CONFIG) -> None:
    """Look at radio, permissions, autopilot, clock, disk, processor and temperature.

    Each line says ok, or what to do. Exits with 1 when something is to be done.

    Parameters
    ----------
    config
        Settings file that would be flown with.
    """
    settings = settings_from(config)
    console = Console()
    good = True
    for finding in examine(settings, running_status(settings)):
        good = good and finding.ok
        mark = Text("ok ", "green") if finding.ok else Text("!! ", "bold red")
        line = Text.assemble(mark, f"{finding.what:<12} ", finding.text)
        if finding.remedy:
            line.append(f". {finding.remedy}", "yellow")
        console.print(line, soft_wrap=True)
    sys.exit(0 if good else 1)


def running_status(settings: Settings) -> SystemStatus | None:
    """Get the state of a system that runs already, if one does."""
    try:
        reader = StatusReader(status_socket_path(settings), 0.0, lambda: None)
    except (UavrtError, OSError):
        return None
    try:
        for _ in range(round(STATUS_S / 0.1)):
            for _, record in reader.read(0.1):
                if isinstance(record, SystemStatus):
                    return record
    finally:
        reader.close()
    return None
