"""Entry point of ``uavrt`` and ``python -m uavrt.cli``. During the imports, which take most of
a second, Ctrl-C ends the program at once and without a traceback.
"""

import os
import signal
import sys
import threading

RESEND_S = 0.01
"""Delay after which a discarded Ctrl-C is sent again [s], when the code that discarded it has
returned."""


def _send_again(discarded: "sys.UnraisableHookArgs") -> None:
    """Send a discarded Ctrl-C again.

    Python discards exceptions in finalizers, and in the lock of an import by another thread.
    The program would continue as if Ctrl-C had not been pressed.
    """
    if not issubclass(discarded.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(discarded)
        return
    while True:
        try:
            threading.Timer(RESEND_S, os.kill, (os.getpid(), signal.SIGINT)).start()
        except KeyboardInterrupt:
            continue  # a busy computer sent it before this function returned: discarded again
        except RuntimeError:
            return  # Python is ending already
        else:
            return


def main() -> None:
    """Run the ``uavrt`` command line."""
    ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if ours:  # it may be ignored, as in a script's background
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        sys.unraisablehook = _send_again
    from uavrt.cli.app import run

    try:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        run()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
