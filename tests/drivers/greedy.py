"""Functions that take too much, for the process that reads what others made."""

import time

from uavrt.core.errors import TagFileError, UsageError


def spin(seconds: float) -> str:
    """Use the CPU."""
    begun_s = time.process_time()
    while time.process_time() - begun_s < seconds:
        pass
    return "done"


def fill(size: int) -> int:
    """Use memory."""
    return len(bytearray(size))


def refuse(kind: str) -> None:
    """Raise an error."""
    if kind == "tags":
        raise TagFileError("tags.toml", ["line 1: wrong", "line 2: wrong"])
    if kind == "fault of ours":
        raise ZeroDivisionError
    raise UsageError("wrong", remedy="Do it right")
