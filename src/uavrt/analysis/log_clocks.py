"""Checks of the clocks of logs that are combined: a mast's, a person's, a drone's."""

from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path

from uavrt.clock import iso_utc
from uavrt.units import NANOSECONDS_PER_SECOND

_APART_S = 1800.0
"""Longest pause between logs of one survey [s]; a battery is changed in less."""
_CLOCKS_SINCE_NS = 946_684_800 * NANOSECONDS_PER_SECOND
"""1 January 2000: earlier times come from a clock that was never set."""


def clock_doubts(logs: Sequence[tuple[str | Path, Sequence[int]]]) -> list[str]:
    """Warnings about logs whose clock was never set, or differs from the others' by far.

    `logs`: each with the times of its data [ns, UTC].
    """
    spans = [(path, min(times), max(times)) for path, times in logs if times]
    doubts = []
    for number, (path, first_ns, last_ns) in enumerate(spans):
        others = [span for other, span in enumerate(spans) if other != number]
        if not others:
            continue
        if last_ns < _CLOCKS_SINCE_NS:
            doubts.append(
                f"the clock of {path} was not set ({iso_utc(first_ns)[:10]}): its times cannot "
                "be compared with those of the others"
            )
            continue
        gap_s = min(
            max(first_ns - other_last_ns, other_first_ns - last_ns) / NANOSECONDS_PER_SECOND
            for _, other_first_ns, other_last_ns in others
        )
        if gap_s > _APART_S:
            doubts.append(
                f"{path} begins {iso_utc(first_ns)[:16]}, {timedelta(minutes=gap_s // 60)} "
                "from the nearest other one: if they were recorded together, a clock is wrong"
            )
    return doubts
