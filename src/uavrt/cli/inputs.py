"""Checks of inputs and options, and the time of a first sample."""

from collections.abc import Sequence
from pathlib import Path

from uavrt.clock import parse_iso_utc
from uavrt.errors import ConfigError, UsageError

_HEAD_BYTES = 65_536


def require_content(paths: Sequence[Path]) -> None:
    """Reject empty files, which would look like flights without pulses: `UsageError`."""
    empty = [path for path in paths if path.is_file() and _is_empty(path)]
    if empty and len(empty) == len(paths):
        raise UsageError(
            f"{empty[0]} is empty", remedy="Check its name, and that it was copied whole"
        )


def refuse(given: dict[str, bool], why: str) -> None:
    """Reject options that would be ignored; raises `ConfigError`."""
    for option, wrong in given.items():
        if wrong:
            raise ConfigError(f"{option} {why}", remedy=f"Leave {option} out")


def _is_empty(path: Path) -> bool:
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    return not head.strip() and len(head) < _HEAD_BYTES


def start_time_ns(text: str | None) -> int | None:
    """Read --start-time; raises `ConfigError` if it is no time."""
    if text is None:
        return None
    try:
        return parse_iso_utc(text)
    except ValueError as error:
        raise ConfigError(
            f"--start-time {text!r} is not a time",
            remedy="Write it as 2024-05-01T06:00:00Z, from 1970 to 2261",
        ) from error
