"""Follow the pulses of one sender, at one interval or alternating between two."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.beeps.tuning import INTERVALS


def tolerance_s(interval_s: float) -> float:
    """Maximum deviation of a pulse from its expected time after the previous pulse [s]."""
    return INTERVALS.tolerance_s + 0.005 * interval_s


def longest_chain(times_s: NDArray[np.float64], interval_s: float) -> NDArray[np.intp]:
    """Indices of the longest chain of pulses at one interval; empty if fewer than three."""
    members, _ = _best_chain(times_s, (interval_s,), INTERVALS.missing_cost)
    return members if members.size >= 3 else members[:0]


def chain_with_switches(
    times_s: NDArray[np.float64], first_s: float, second_s: float
) -> tuple[float, list[tuple[int, NDArray[np.intp]]]]:
    """Find the best chain of pulses of a tag that switches between two known intervals.

    `times_s` (n,): pulse times, ascending. Returns (merit, stretches). `merit`: number of
    pulses minus the cost of missing pulses and switches. `stretches`: the interval (0 or 1) and
    the pulses of each part, in order of time; a pulse at a switch is in both parts.
    """
    members, rates = _best_chain(times_s, (first_s, second_s), INTERVALS.missing_or_switch_cost)
    cuts = np.flatnonzero(np.diff(rates)) + 1
    edges = [0, *cuts.tolist(), rates.size]
    stretches = [
        (int(rates[low]), members[low : high + 1])
        for low, high in pairwise(edges)
        if high > low
    ]
    steps = np.round(np.diff(times_s[members]) / np.array((first_s, second_s))[rates])
    holes = float(np.maximum(0.0, steps - 1.0).sum())
    return (
        members.size
        - INTERVALS.missing_or_switch_cost * holes
        - INTERVALS.switch_cost * cuts.size,
        stretches,
    )


def _best_chain(
    times_s: NDArray[np.float64], intervals_s: tuple[float, ...], hole: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices of the best chain's pulses, and of the interval before each but the first."""
    count, rates = times_s.size, len(intervals_s)
    score = np.ones((count, rates))
    before = np.full((count, rates), -1, dtype=np.intp)  # burst · rates + rate
    switch = INTERVALS.switch_cost * (1.0 - np.eye(rates))
    for k in range(1, count):
        for rate, interval_s in enumerate(intervals_s):
            reach_s = (INTERVALS.most_missing + 1.5) * interval_s
            first = int(np.searchsorted(times_s, times_s[k] - reach_s))
            distance = times_s[k] - times_s[first:k]
            steps = np.maximum(1.0, np.round(distance / interval_s))
            error = np.abs(distance - steps * interval_s) / tolerance_s(interval_s)
            fits = error <= 1.0
            if not fits.any():
                continue
            # Prefer long chains without missing pulses, then the better fit.
            cost = hole * (steps - 1.0) + 0.1 * error
            merit = score[first:k] - switch[rate] - cost[:, np.newaxis]
            merit[~fits] = -np.inf
            pick = int(np.argmax(merit))
            if merit.flat[pick] > 0.0:
                score[k, rate] = merit.flat[pick] + 1.0
                before[k, rate] = first * rates + pick
    members: list[int] = []
    reached: list[int] = []
    place = int(np.argmax(score)) if count else -1
    while place >= 0:
        members.append(place // rates)
        reached.append(place % rates)
        place = int(before.flat[place])
    return (np.array(members[::-1], dtype=np.intp), np.array(reached[::-1][1:], dtype=np.intp))
