"""Run the supervisor: ``python -m uavrt.supervisor SETTINGS_JSON [TAGS_JSON]``.

``uavrt run`` reads ``uavrt.toml`` and replaces itself by this program, so that the libraries
that check the settings do not stay in memory for the flight.
"""

import sys

from uavrt.log import configure_logging
from uavrt.supervisor.launcher import Launcher


def main() -> int:
    """Run the supervisor with the settings and tags of the arguments."""
    configure_logging("supervisor")
    launcher = Launcher()
    launcher.warm_up()
    # Only now: the nursery imports NumPy while this process imports what it needs itself.
    from uavrt.supervisor.program import run

    return run(launcher, *sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
