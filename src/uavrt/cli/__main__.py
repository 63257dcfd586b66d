"""Entry point of ``uavrt`` and ``python -m uavrt.cli``.

The command line takes most of a second to import. Nothing has to be shut down in that time, so
Ctrl-C ends the program at once, without a traceback of the imports.
"""

import signal
import sys


def main() -> None:
    """Run ``uavrt``."""
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
