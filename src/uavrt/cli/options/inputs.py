"""Check input files and options; options that describe a recording's samples."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cyclopts import Parameter

from uavrt.cli.options.kinds import Hertz, HertzOrZero
from uavrt.core.clock import parse_iso_utc
from uavrt.core.errors import ConfigError, UsageError
from uavrt.core.messages import Tag

_HEAD_BYTES = 65_536


def require_content(paths: Sequence[Path]) -> None:
    """Raise `UsageError` for an empty file, which would look like a flight without pulses."""
    empty = [path for path in paths if path.is_file() and _is_empty(path)]
    if empty and len(empty) == len(paths):
        raise UsageError(
            f"{empty[0]} is empty",
            remedy="Check the file's name, and whether the copy is complete",
        )


def refuse(given: dict[str, bool], sentence: str) -> None:
    """Raise `ConfigError` if one of the options in `given` is set.

    `sentence`: text of the error, with `{}` for the option's name.
    """
    for option, wrong in given.items():
        if wrong:
            raise ConfigError(sentence.format(option), remedy=f"Leave {option} out")


def chosen_tags(known: Sequence[Tag], ids: Sequence[int]) -> list[Tag]:
    """Select tags by their ids, or all; raises `ConfigError` for an unknown id or no tags."""
    missing = sorted(set(ids) - {one.tag_id for one in known})
    if known and missing:
        listed = ", ".join(str(one.tag_id) for one in known)
        raise ConfigError(
            f"the tag list contains no tag {missing[0]}",
            remedy=f"Choose from {listed}, or name another tag file with --tags",
        )
    if not known:
        raise ConfigError(
            "there are no tags to search for", remedy="Name a tag file with --tags"
        )
    return [one for one in known if not ids or one.tag_id in ids]


def _is_empty(path: Path) -> bool:
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    return not head.strip() and len(head) < _HEAD_BYTES


def start_time_ns(text: str | None) -> int | None:
    """Time of --start-time [ns since 1970], None if not given; raises `ConfigError`."""
    if text is None:
        return None
    try:
        return parse_iso_utc(text)
    except ValueError as error:
        raise ConfigError(
            f"--start-time {text!r} is not a time",
            remedy="Write it as 2024-05-01T06:00:00Z, from 1970 to 2261",
        ) from error


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """Options on a recording's samples, where the recording itself does not state them.

    Parameters
    ----------
    format
        cf32, cs16, cu8, ci8, sigmf or wav; by default taken from the file name (cf32 for -).
    sample_rate
        Samples per second, e.g. 3e6, unless the recording states it.
    center_frequency
        Radio frequency in hertz, e.g. 148.7e6, unless the recording states it.
    start_time
        Time of the first sample, ISO 8601, UTC; by default as stated in the recording, else the
        file's modification time minus its duration; for - the time of arrival.
    """

    format: str | None = None
    sample_rate: Hertz | None = None
    center_frequency: HertzOrZero | None = None
    start_time: str | None = None

    def options(self) -> dict[str, Any]:
        """Arguments for `open_recording`; raises `ConfigError` for an invalid start time."""
        return {
            "format_name": self.format,
            "sample_rate_hz": self.sample_rate,
            "center_frequency_hz": self.center_frequency,
            "start_time_ns": start_time_ns(self.start_time),
        }


NOTHING_STATED = Stated()
