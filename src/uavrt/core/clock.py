"""The only module that reads clocks.

Time in uavrt is an ``int``: nanoseconds UTC. The value is the monotonic clock plus an offset
that is fixed at the start of a flight and passed to every process. A step of the wall clock in
flight (GNSS fix, NTP, a user) therefore changes nothing.
"""

import time
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from uavrt.core.units import NANOSECONDS_PER_SECOND

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
_BEYOND = datetime(2262, 1, 1, tzinfo=UTC)
"""Earliest time that is rejected [ns since 1970], in 2262: times must fit into 64 bits."""


@dataclass(frozen=True, slots=True)
class Clock:
    """A monotonic clock in nanoseconds UTC, which no change of the wall clock affects.

    `offset_ns`: UTC minus CLOCK_MONOTONIC [ns], fixed for a flight.
    """

    offset_ns: int

    @classmethod
    def start(cls) -> "Clock":
        """Create a clock with the offset of the wall clock at this moment."""
        before = time.monotonic_ns()
        wall = time.time_ns()
        after = time.monotonic_ns()
        return cls(wall - (before + after) // 2)

    def now_ns(self) -> int:
        """Present time [ns, UTC]."""
        return time.monotonic_ns() + self.offset_ns

    def wall_correction_ns(self) -> int:
        """Time by which the wall clock was set forward since the start of the flight [ns]."""
        return time.time_ns() - self.now_ns()


def monotonic_s() -> float:
    """Seconds of the monotonic clock, for timeouts and intervals only."""
    return time.monotonic()


def wall_ns() -> int:
    """Wall-clock time [ns, UTC]. It may jump, so it is used only for log lines."""
    return time.time_ns()


def cpu_s() -> float:
    """CPU time used by this process so far [s]."""
    return time.process_time()


def iso_utc(time_ns: int) -> str:
    """Write a time as ISO 8601 UTC with microseconds.

    >>> iso_utc(1_700_205_419_230_494_976)
    '2023-11-17T07:16:59.230494Z'
    """
    seconds, nanoseconds = divmod(time_ns, NANOSECONDS_PER_SECOND)
    stamp = datetime.fromtimestamp(seconds, tz=UTC)
    return f"{stamp:%Y-%m-%dT%H:%M:%S}.{nanoseconds // 1000:06d}Z"


def utc_text(time_ns: int) -> str:
    """Format a time for people, to the second.

    >>> utc_text(1_700_205_419_230_494_976)
    '2023-11-17 07:16:59 UTC'
    """
    return f"{iso_utc(time_ns)[:19].replace('T', ' ')} UTC"


def parse_iso_utc(text: str) -> int:
    """Parse an ISO 8601 time to [ns, UTC]; a time without a zone is UTC.

    Raises `ValueError` if `text` is not an ISO 8601 time from 1970 to 2261; nanoseconds are
    kept in 64 bits.

    >>> parse_iso_utc("2023-11-17T07:16:59.5Z")
    1700205419500000000
    """
    stamp = datetime.fromisoformat(text)
    if stamp.tzinfo is None:
        stamp = stamp.replace(tzinfo=UTC)
    epoch = datetime(1970, 1, 1, tzinfo=UTC)
    if not epoch <= stamp < _BEYOND:
        raise ValueError(f"{text} is not a time from 1970 to 2261")
    delta = stamp - epoch
    return ((delta.days * 86400 + delta.seconds) * 1_000_000 + delta.microseconds) * 1000


def iso_intervals(stretches: Iterable[tuple[int, int]]) -> str:
    """Format time spans as ISO 8601 intervals, separated by spaces.

    >>> iso_intervals([(1_700_205_419_000_000_000, 1_700_205_420_000_000_000)])
    '2023-11-17T07:16:59.000000Z/2023-11-17T07:17:00.000000Z'
    """
    return " ".join(f"{iso_utc(begin)}/{iso_utc(end)}" for begin, end in stretches)


def parse_iso_intervals(text: str) -> tuple[tuple[int, int], ...]:
    """Parse the text of `iso_intervals`: (start, end) of each [ns]; raises `ValueError`."""
    pairs = (one.split("/") for one in text.split())
    return tuple((parse_iso_utc(begin), parse_iso_utc(end)) for begin, end in pairs)


def flight_stamp(time_ns: int) -> str:
    """Format a time [ns, UTC] for a flight directory's name: ``YYYY-mm-dd_HH-MM-SS``."""
    return (
        f"{datetime.fromtimestamp(time_ns // NANOSECONDS_PER_SECOND, tz=UTC):%Y-%m-%d_%H-%M-%S}"
    )


def boot_id() -> str:
    """Identifier of this boot of the computer; CLOCK_MONOTONIC restarts at each boot."""
    try:
        return _BOOT_ID.read_text().strip()
    except OSError:
        return "unknown"
