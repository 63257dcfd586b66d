"""``uavrt starter``: the ground station in the desktop's menu."""

import sys
from pathlib import Path

from cyclopts import App

from uavrt.cli.examples import examples
from uavrt.core.errors import UsageError
from uavrt.drone.computer.starter import data_home, install_starter, remove_starter

starter = App(name="starter", help="Put the ground station into the desktop's menu (Linux).")


@starter.command(help_epilogue=examples("starter install"))
def install(*, directory: Path | None = None) -> None:
    """Write a starter that opens the ground station, for this user, without sudo.

    Parameters
    ----------
    directory
        Data directory of the desktop, $XDG_DATA_HOME or ~/.local/share; for all users
        /usr/local/share (with sudo).
    """
    if not sys.platform.startswith("linux"):
        raise UsageError(
            "desktop starters exist only on Linux", remedy="Make a shortcut to uavrt ground"
        )
    # Not resolved: the Python of an environment is a link out of it.
    program = Path(sys.executable).with_name("uavrt")
    for path in install_starter(program, directory or data_home()):
        print(f"wrote {path}")


@starter.command
def remove(*, directory: Path | None = None) -> None:
    """Remove the starter; settings and flights stay.

    Parameters
    ----------
    directory
        Data directory given to install.
    """
    removed = remove_starter(directory or data_home())
    for path in removed:
        print(f"removed {path}")
    if not removed:
        print("there is no starter")
