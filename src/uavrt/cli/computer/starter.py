"""``uavrt starter``: add the ground station to the desktop's menu."""

import sys
from pathlib import Path

from cyclopts import App

from uavrt.cli.examples import examples
from uavrt.core.errors import UsageError
from uavrt.drone.computer.starter import data_home, install_starter, remove_starter

starter = App(name="starter", help="Add the ground station to the desktop's menu (Linux).")


@starter.command(help_epilogue=examples("starter install"))
def install(*, directory: Path | None = None) -> None:
    """Add an entry to the desktop's menu that opens the ground station. Needs no sudo.

    Parameters
    ----------
    directory
        The data directory of the desktop; by default $XDG_DATA_HOME or ~/.local/share, for this
        user. For all users: /usr/local/share, with sudo.
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
    """Remove the entry from the desktop's menu; settings and flights stay.

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
