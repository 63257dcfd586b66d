"""Compare the clocks of logs analysed together, such as a mast's and a drone's."""

from collections.abc import Mapping, Sequence
from datetime import timedelta
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.core.clock import iso_utc
from uavrt.core.units import NANOSECONDS_PER_SECOND

_APART_S = 1800.0
"""Longest pause between logs of one survey [s]; changing a battery takes less."""
_CLOCKS_SINCE_NS = 946_684_800 * NANOSECONDS_PER_SECOND
"""Time before which a log's clock counts as never set [ns since 1970]: 1 January 2000."""
_SAME_PULSE_S = 0.1
"""Longest time between the records of the same pulse in two logs [s]."""
_LEAST_PULSES = 20
"""Least number of a tag's pulses in both logs for their clocks to be compared."""
_LEAST_ALIKE = 0.5
"""Share of pulses with equal times in two logs from which their clocks agree."""
_SAME_INTERVAL = 0.03
"""Largest relative difference between two measurements of the same tag's pulse interval."""
_LEAST_REGULAR = 0.8
"""Minimum share of regular intervals for a comparison; false pulses make them irregular."""


def clock_doubts(logs: Sequence[tuple[str | Path, Sequence[int]]]) -> list[str]:
    """Warnings about logs whose clock was never set or differs much from all others."""
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
                "from the nearest other log: if they were recorded together, a clock is wrong"
            )
    return doubts


def pulse_doubts(logs: Sequence[tuple[str | Path, Mapping[int, Sequence[int]]]]) -> list[str]:
    """Warnings about overlapping logs that give the same tag's pulses different times."""
    trains = [
        (path, {key: np.sort(np.array(times, np.int64)) for key, times in pulses.items()})
        for path, pulses in logs
    ]
    doubts = []
    for (path, pulses), (other_path, others) in combinations(trains, 2):
        apart = [_is_apart(pulses[key], others[key]) for key in pulses.keys() & others.keys()]
        if True in apart and False not in apart:
            doubts.append(
                f"{path} and {other_path} contain the same tag's pulses at different times: "
                f"one of their clocks is wrong, by {_SAME_PULSE_S:g} s or much more"
            )
    return doubts


def _is_apart(one: NDArray[np.int64], other: NDArray[np.int64]) -> bool | None:
    """True if a tag's pulses have different times in two logs; None if undecided."""
    intervals = [interval for each in (one, other) if (interval := _interval_ns(each))]
    if len(intervals) < 2 or abs(intervals[0] / intervals[1] - 1.0) > _SAME_INTERVAL:
        return None
    near = other[np.minimum(np.searchsorted(other, one - intervals[0] / 2), len(other) - 1)]
    apart_ns = np.abs(near - one)
    apart_ns = apart_ns[apart_ns <= intervals[0] / 2]
    if len(apart_ns) < _LEAST_PULSES:
        return None
    alike = np.mean(apart_ns <= _SAME_PULSE_S * NANOSECONDS_PER_SECOND)
    return bool(alike < _LEAST_ALIKE)


def _interval_ns(times_ns: NDArray[np.int64]) -> float | None:
    """Pulse interval [ns]; None for few or irregular pulses, or for rounded times."""
    steps = np.diff(times_ns)
    if len(steps) < _LEAST_PULSES or not np.any(times_ns % (NANOSECONDS_PER_SECOND // 10)):
        return None
    interval_ns = float(np.median(steps))
    beats = steps / interval_ns if interval_ns > 0 else steps
    regular = np.mean(np.abs(beats - np.round(beats)) <= _SAME_INTERVAL)
    return interval_ns if regular >= _LEAST_REGULAR and interval_ns > 0 else None
