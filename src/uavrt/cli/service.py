"""``uavrt service``: start at boot."""

import getpass
import os
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from uavrt.cli.examples import examples
from uavrt.computer import ServicePlan
from uavrt.computer import install as install_service
from uavrt.computer import remove as remove_service
from uavrt.computer import status as service_status

service = App(
    name="service", help="Start uavrt at boot (systemd), and let it use the radio (udev)."
)

ROOT = Path("/")


@service.command(help_epilogue=examples("service install"))
def install(
    *,
    user: str | None = None,
    directory: Path | None = None,
    config: Annotated[Path | None, Parameter(alias="-c")] = None,
    root: Path = ROOT,
) -> None:
    """Write the unit and the udev rule, enable and start the service. Needs sudo.

    Parameters
    ----------
    user
        Who the service runs as; the user who called sudo if not given.
    directory
        Where it runs, and makes its flights by default; here if not given.
    config
        Settings file; uavrt.toml in the directory if not given.
    root
        Write below another directory than /, and start nothing.
    """
    plan = ServicePlan(
        program=Path(sys.executable).parent / "uavrt",
        user=user or os.environ.get("SUDO_USER") or getpass.getuser(),
        directory=(directory or Path.cwd()).resolve(),
        config=config.resolve() if config is not None else None,
    )
    _print(install_service(plan, root))


@service.command
def status(*, root: Path = ROOT) -> None:
    """Say what is installed, and how the service is.

    Parameters
    ----------
    root
        Another directory than /.
    """
    _print(service_status(root))


@service.command
def remove(*, root: Path = ROOT) -> None:
    """Stop the service, and remove unit and rule. Flights stay. Needs sudo.

    Parameters
    ----------
    root
        Another directory than /.
    """
    _print(remove_service(root))


def _print(lines: list[str]) -> None:
    for line in lines:
        print(line)
