"""The command line run in this process, as its own program would."""

import sys

from uavrt.cli.app import run


def uavrt(*arguments: str) -> int:
    """Run `uavrt` with arguments; its exit status."""
    before = sys.argv
    sys.argv = ["uavrt", *arguments]
    try:
        run()
    except SystemExit as end:
        return int(end.code or 0)
    finally:
        sys.argv = before
    return 0
