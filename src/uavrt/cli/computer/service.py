"""``uavrt service``: start the drone side at boot."""

import getpass
import os
import pwd
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from uavrt.cli.examples import examples
from uavrt.config.loader import load_settings
from uavrt.core.errors import UsageError
from uavrt.drone.computer.service import ServicePlan, check_plan
from uavrt.drone.computer.service import install as install_service
from uavrt.drone.computer.service import remove as remove_service
from uavrt.drone.computer.service import status as service_status
from uavrt.drone.computer.versions import Installation

service = App(
    name="service", help="Start uavrt at boot (systemd) and let it use the radio (udev)."
)

ROOT = Path("/")
SERVICE_USER = "uavrt"
"""User account that deploy/install.sh creates for the service; it owns only the flights."""


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
        User that the service runs as; by default the user uavrt if it exists, else the user who
        called sudo.
    directory
        Working directory, where flights are saved by default; the current directory if not
        given.
    config
        Settings file; uavrt.toml in the directory if not given.
    root
        Write under this directory instead of / and start nothing.
    """
    place = (directory or Path.cwd()).resolve()
    settings = config.resolve() if config is not None else None
    installed = Installation.of(sys.executable)
    environment = Path(sys.executable).parents[1] if installed is None else installed.link
    plan = ServicePlan(
        program=environment / "bin/uavrt",
        user=user or _usual_user(),
        directory=place,
        config=settings,
        writable=_writable(root, place, settings),
        prefix=None if installed is None else installed.prefix,
    )
    check_plan(plan, root)
    print(f"the service runs as {plan.user} in {plan.directory}")
    _print(install_service(plan, root))


@service.command
def status(*, root: Path = ROOT) -> None:
    """Show what is installed and the state of the service.

    Parameters
    ----------
    root
        Look under this directory instead of /.
    """
    _print(service_status(root))


@service.command
def remove(*, root: Path = ROOT) -> None:
    """Stop the service and remove its unit and udev rule. Keeps flights. Needs sudo.

    Parameters
    ----------
    root
        Look under this directory instead of /.
    """
    _print(remove_service(root))


def _usual_user() -> str:
    """Name of the account created for the service, or else of the user who called sudo."""
    with suppress(KeyError):
        return pwd.getpwnam(SERVICE_USER).pw_name
    user = os.environ.get("SUDO_USER") or getpass.getuser()
    if user == "root":
        raise UsageError(
            "the service would run as root",
            remedy=f"Give --user NAME, or create the user {SERVICE_USER} for it: "
            f"sudo useradd --system {SERVICE_USER}",
        )
    return user


def _writable(root: Path, directory: Path, config: Path | None) -> tuple[Path, ...]:
    """Paths in the settings, outside the service's directory, that it must be able to write."""
    path = root / (config or directory / "uavrt.toml").relative_to("/")
    if not path.exists():
        return ()
    settings = load_settings(path)
    named = [settings.recording.directory, settings.recording.save_directory]
    if settings.status_socket is not None:
        named.append(str(Path(settings.status_socket).parent))
    places = (Path(os.path.normpath(directory / name)) for name in named if name)
    outside = (place for place in places if not place.is_relative_to(directory))
    return tuple(dict.fromkeys(outside))


def _print(lines: list[str]) -> None:
    for line in lines:
        print(line)
