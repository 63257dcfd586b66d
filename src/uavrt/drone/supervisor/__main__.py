"""Run the supervisor: ``python -m uavrt.drone.supervisor SETTINGS_JSON [TAGS_JSON]``.

``uavrt run`` reads ``uavrt.toml`` and replaces itself by this program, so that the libraries
that check the settings do not stay in memory for the flight.
"""

import signal

# First: until the supervisor handles signals, Ctrl-C ends it without a traceback. `uavrt run`
# holds the signal back over the exec.
signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})

import sys  # noqa: E402

from uavrt.core.log import configure_logging  # noqa: E402
from uavrt.drone.supervisor.start.launcher import Launcher  # noqa: E402


def main() -> int:
    """Run the supervisor with settings and tags given as JSON arguments."""
    configure_logging("supervisor")
    launcher = Launcher()
    launcher.warm_up()
    # Only now: the nursery imports NumPy while this process imports what it needs itself.
    from uavrt.drone.supervisor.supervisor_program import run

    return run(launcher, *sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
