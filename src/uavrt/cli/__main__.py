"""Entry point of ``uavrt`` and ``python -m uavrt.cli``.

The imports take most of a second. Nothing has to be shut down during that time, so Ctrl-C ends
the program at once and without a traceback.
"""

import signal
import sys


def main() -> None:
    """Run the ``uavrt`` command line."""
    ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if ours:  # it may be ignored, as in a script's background
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from uavrt.cli.app import run

    try:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        run()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
