"""Find the intervals in a set of pulse times, and the pulses sent at each interval.

The time between any two pulses is a vote for that interval. A tag with interval T causes votes
at T, 2 T, 3 T …; the first strong one is its interval. Steps of 1333 ms also meet every second
pulse of a 2000 ms interval, so a chain of pulses is cut where the interval changes. The pulses
that it does not explain may form another chain.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import exp, lgamma, log

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.beeps.chains import chain_with_switches, longest_chain, tolerance_s
from uavrt.detection.beeps.interval_fit import Beat, fit_beat
from uavrt.detection.beeps.tuning import INTERVALS


@dataclass(frozen=True, slots=True, eq=False)
class FoundBeat:
    """Interval that was found in pulse times, and the pulses sent at this interval."""

    beat: Beat
    members: NDArray[np.intp]
    """(n,) indices of the beat's pulses in the array of pulse times that was searched."""


def find_beats(times_s: NDArray[np.float64], span_s: float, most: int = 3) -> list[FoundBeat]:
    """Find intervals in ascending pulse times (n,) that cover `span_s`, most frequent first."""
    left = np.arange(times_s.size)
    found: list[FoundBeat] = []
    while len(found) < most and left.size >= INTERVALS.fewest_pulses:
        best = _best_beat(times_s[left], span_s)
        if best is None:
            break
        beat, members = best
        found.append(FoundBeat(beat, left[members]))
        left = np.delete(left, members)
    return sorted(found, key=lambda one: -one.members.size)


def _best_beat(
    times_s: NDArray[np.float64], span_s: float
) -> tuple[Beat, NDArray[np.intp]] | None:
    best: tuple[Beat, NDArray[np.intp]] | None = None
    for interval_s in _others(0.0, _candidates(times_s)):
        chain = longest_chain(times_s, interval_s)
        if chain.size < INTERVALS.fewest_pulses:
            continue
        # Votes give the interval to some milliseconds, which breaks chains: repeat with the
        # interval of the first chain.
        again = longest_chain(times_s, fit_beat(times_s[chain], interval_s).interval_s)
        chain = again if again.size > chain.size else chain
        beat = fit_beat(times_s[chain], interval_s)
        if not _sure(beat, times_s.size, span_s):
            continue
        if best is None or _merit(beat) > _merit(best[0]):
            best = beat, chain
    return None if best is None else _at_one_rate(times_s, *best, span_s)


def _at_one_rate(
    times_s: NDArray[np.float64], beat: Beat, chain: NDArray[np.intp], span_s: float
) -> tuple[Beat, NDArray[np.intp]]:
    """Reduce a chain that mixes two rates of a tag to its longest stretch at one rate."""
    low, high = int(chain[0]), int(chain[-1]) + 1
    within_s = times_s[low:high]
    best, kept = -np.inf, (beat, chain)
    for interval_s in _others(beat.interval_s, _candidates(within_s)):
        intervals_s = beat.interval_s, interval_s
        merit, stretches = chain_with_switches(within_s, *intervals_s)
        if merit <= best or len(stretches) < 2:
            continue
        found = [(fit_beat(within_s[at], intervals_s[rate]), at) for rate, at in stretches]
        sure: set[int] = set()
        for (rate, at), (one, _) in zip(stretches, found, strict=True):
            others = sum(other.size for r, other in stretches if r != rate)
            if at.size >= INTERVALS.fewest_at_other_rate and _sure(
                one, times_s.size - others, span_s
            ):
                sure.add(rate)
        if len(sure) == 2:
            longest, members = max(found, key=lambda one: one[1].size)
            members = _without_strays(within_s, members, longest.interval_s)
            best, kept = merit, (fit_beat(within_s[members], longest.interval_s), members + low)
    return kept


def _without_strays(
    times_s: NDArray[np.float64], members: NDArray[np.intp], interval_s: float
) -> NDArray[np.intp]:
    """Remove end pulses of a chain after a gap that contains other pulses.

    Such end pulses were sent at another rate: if the first pulse after a change of rate is
    lost, the chain meets a later one by chance.
    """
    low, high = 0, members.size

    def strays(k: int) -> bool:
        hole = times_s[members[k + 1]] - times_s[members[k]] > 1.5 * interval_s
        return bool(hole and members[k + 1] - members[k] > 1)

    while high - low > INTERVALS.fewest_pulses and strays(high - 2):
        high -= 1
    while high - low > INTERVALS.fewest_pulses and strays(low):
        low += 1
    return members[low:high]


def _others(interval_s: float, candidates_s: Iterable[float]) -> list[float]:
    others: list[float] = []
    for one in candidates_s:
        new = all(abs(one - other) > 0.5 * INTERVALS.tolerance_s for other in others)
        if new and abs(one - interval_s) > 2.0 * tolerance_s(interval_s):
            others.append(one)
    return others


def _sure(beat: Beat, bursts: int, span_s: float) -> bool:
    return (
        _jitter_s(beat) <= INTERVALS.tolerance_s
        and _chance(beat, bursts, span_s) <= INTERVALS.most_false
    )


def _jitter_s(beat: Beat) -> float:
    """Scatter of a beat's pulse times about a curve that follows temperature drift [s]."""
    degree = min(beat.numbers.size // 20, INTERVALS.most_bends)
    if not degree:
        return beat.scatter_s
    curve = np.polynomial.Polynomial.fit(beat.numbers, beat.residuals_s, degree)
    return float(np.std(beat.residuals_s - curve(beat.numbers)))


def _merit(beat: Beat) -> float:
    """Number of pulses at an interval, minus half the number of missing pulses.

    Without this deduction, half of the true interval would score as much.
    """
    steps = int(beat.numbers[-1]) + 1
    return beat.numbers.size - 0.5 * max(0, steps - beat.numbers.size)


def _candidates(times_s: NDArray[np.float64]) -> list[float]:
    """Intervals to try [s]: the most frequent time differences between pulses, best first."""
    step_s = 0.25 * INTERVALS.tolerance_s
    votes = np.zeros(int((INTERVALS.longest_s + 1.0) / step_s), dtype=np.float64)
    for shift in range(1, min(times_s.size, 200)):
        distance = times_s[shift:] - times_s[:-shift]
        distance = distance[distance <= INTERVALS.longest_s]
        if not distance.size:
            break
        np.add.at(votes, np.round(distance / step_s).astype(np.int64), 1.0)
    smooth = np.convolve(votes, np.ones(5), mode="same")
    smooth[: int(INTERVALS.shortest_s / step_s)] = 0.0
    # Random times vote for all distances alike.
    by_chance = times_s.size**2 / max(float(np.ptp(times_s)), 1e-9) * 5.0 * step_s
    least = max(3.0, by_chance + 4.0 * by_chance**0.5)
    candidates = []
    for _ in range(8):
        at = int(np.argmax(smooth))
        if smooth[at] < least:
            break
        near = slice(max(0, at - 3), at + 4)
        center = float((votes[near] * np.arange(votes.size)[near]).sum() / votes[near].sum())
        # With pulses missing, twice or three times the interval may have more votes.
        parts = (center * step_s / part for part in (1.0, 2.0, 3.0))
        candidates += [interval_s for interval_s in parts if interval_s >= INTERVALS.shortest_s]
        smooth[max(0, at - 5) : at + 6] = 0.0
    return candidates


def _chance(beat: Beat, bursts: int, span_s: float) -> float:
    """Expected number of equally good chains of pulses among `bursts` random pulse times.

    Two pulses set the interval; each later time has a pulse with the probability density ×
    tolerance. This is multiplied by the ways to choose the first two and the missing pulses.
    """
    density = bursts / max(span_s, 1e-9)
    hit = min(1.0, 2.0 * tolerance_s(beat.interval_s) * density)
    count, places = beat.numbers.size, int(beat.numbers[-1]) + 1
    pairs = bursts * density * (INTERVALS.longest_s - INTERVALS.shortest_s)
    # Binomial tail, by its largest term: choice of the positions with a pulse.
    ways = lgamma(places - 1) - lgamma(count - 1) - lgamma(max(places - count, 0) + 1)
    exponent = log(max(pairs, 1e-9)) + ways + (count - 2) * log(hit)
    return exp(min(exponent, 50.0))
