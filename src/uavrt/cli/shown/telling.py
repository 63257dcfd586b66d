"""Lines for the user beside a command's output, on stderr."""

import sys


def tell(text: object) -> None:
    """Print a line beside the command's output."""
    print(text, file=sys.stderr)


def warn(text: object) -> None:
    """Print a warning or fault beside the command's output."""
    tell(f"uavrt: {text}")
