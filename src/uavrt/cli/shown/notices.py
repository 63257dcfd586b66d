"""Print lines for the user on stderr, separately from a command's output."""

import sys


def notice(text: object) -> None:
    """Print a line on stderr."""
    print(text, file=sys.stderr)


def warn(text: object) -> None:
    """Print a warning or fault on stderr."""
    notice(f"uavrt: {text}")
