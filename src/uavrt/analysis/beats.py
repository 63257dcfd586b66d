"""Intervals in a set of burst times: which of them are a tag, and how it beats.

Every pair of bursts votes for its distance. A beat of interval T makes votes at T, 2 T, 3 T …;
the first strong one is its interval. Chance makes as many votes at any distance, which says
what strong means. What a beat explains is taken away, and the rest may hold another: the
second rate of the tag, or another tag.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.interval_fit import Beat, fit_beat

SHORTEST_S: Final = 0.25
LONGEST_S: Final = 6.0
"""Intervals of the tags that are sold lie between 0.5 and 4 s."""
TOLERANCE_S: Final = 0.022
"""A pulse so far from its place belongs to the beat: jitter of ± 20 ms, and our own error."""
FEWEST: Final = 5
"""Pulses that make a beat."""
LONGEST_HOLE: Final = 6
"""Missing pulses in a row that a chain passes over."""
HIGHEST_CHANCE: Final = 1e-4
"""Chance at which noise alone would make such a beat somewhere in the recording."""


@dataclass(frozen=True, slots=True, eq=False)
class FoundBeat:
    """A beat and the bursts that make it."""

    beat: Beat
    members: NDArray[np.intp]
    """(n,) places of its bursts among the times that were given."""


def find_beats(times_s: NDArray[np.float64], span_s: float, most: int = 3) -> list[FoundBeat]:
    """Find beats, the one with the most pulses first.

    Parameters
    ----------
    times_s : (n,) float64 array
        Bursts at one frequency, ascending.
    span_s : float
        Length of the recording.
    most : int
        How many to look for.
    """
    left = np.arange(times_s.size)
    found: list[FoundBeat] = []
    while len(found) < most and left.size >= FEWEST:
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
    for interval_s in _candidates(times_s):
        chain = _longest_chains(times_s, interval_s)
        if chain.size < FEWEST:
            continue
        # Votes tell the interval to some milliseconds, which breaks chains: once more with
        # what the first chain says.
        again = _longest_chains(times_s, fit_beat(times_s[chain], interval_s).interval_s)
        chain = again if again.size > chain.size else chain
        beat = fit_beat(times_s[chain], interval_s)
        if beat.scatter_s > TOLERANCE_S or _chance(beat, times_s.size, span_s) > HIGHEST_CHANCE:
            continue
        if best is None or _merit(beat) > _merit(best[0]):
            best = beat, chain
    return best


def _merit(beat: Beat) -> float:
    """Pulses there less pulses missing: half the interval would explain as many pulses."""
    steps = int(beat.numbers[-1]) + 1
    return beat.numbers.size - 0.5 * max(0, steps - beat.numbers.size)


def _candidates(times_s: NDArray[np.float64]) -> list[float]:
    """Distances for which many pairs vote, most votes first."""
    step_s = 0.25 * TOLERANCE_S
    votes = np.zeros(int((LONGEST_S + 1.0) / step_s), dtype=np.float64)
    for shift in range(1, min(times_s.size, 200)):
        distance = times_s[shift:] - times_s[:-shift]
        distance = distance[distance <= LONGEST_S]
        if not distance.size:
            break
        np.add.at(votes, np.round(distance / step_s).astype(np.int64), 1.0)
    smooth = np.convolve(votes, np.ones(5), mode="same")
    smooth[: int(SHORTEST_S / step_s)] = 0.0
    candidates = []
    for _ in range(8):
        at = int(np.argmax(smooth))
        if smooth[at] < 3.0:
            break
        near = slice(max(0, at - 3), at + 4)
        center = float((votes[near] * np.arange(votes.size)[near]).sum() / votes[near].sum())
        # With pulses missing, twice or three times the interval may have more votes.
        parts = (center * step_s / part for part in (1.0, 2.0, 3.0))
        candidates += [interval_s for interval_s in parts if interval_s >= SHORTEST_S]
        smooth[max(0, at - 5) : at + 6] = 0.0
    return candidates


def _longest_chains(times_s: NDArray[np.float64], interval_s: float) -> NDArray[np.intp]:
    """Bursts that follow each other at the interval; chains of at least three, all together."""
    tolerance_s = TOLERANCE_S + 0.005 * interval_s
    score = np.ones(times_s.size)
    before = np.full(times_s.size, -1, dtype=np.intp)
    for k in range(1, times_s.size):
        first = int(np.searchsorted(times_s, times_s[k] - (LONGEST_HOLE + 1.5) * interval_s))
        distance = times_s[k] - times_s[first:k]
        steps = np.maximum(1.0, np.round(distance / interval_s))
        error = np.abs(distance - steps * interval_s)
        fits = error <= tolerance_s
        if fits.any():
            # Prefer long chains without holes, then the better fit.
            merit = score[first:k] - 0.3 * (steps - 1.0) - 0.1 * error / tolerance_s
            merit[~fits] = -np.inf
            pick = int(np.argmax(merit))
            if merit[pick] > 0.0:
                score[k] = merit[pick] + 1.0
                before[k] = first + pick
    used = np.zeros(times_s.size, dtype=bool)
    chains: list[int] = []
    for end in np.argsort(-score, kind="stable"):
        chain, k = [], int(end)
        while k >= 0 and not used[k]:
            chain.append(k)
            k = int(before[k])
        if len(chain) >= 3:
            used[chain] = True
            chains += chain
            break
    return np.array(sorted(chains), dtype=np.intp)


def _chance(beat: Beat, bursts: int, span_s: float) -> float:
    """Expected number of such beats among bursts that fall at random.

    After two pulses that set the interval, each further place is hit by one of the bursts with
    probability p = density × tolerance; the first two can be chosen in so many ways. Places
    that were missed give more ways yet.
    """
    density = bursts / max(span_s, 1e-9)
    hit = min(1.0, 2.0 * (TOLERANCE_S + 0.005 * beat.interval_s) * density)
    count, places = beat.numbers.size, int(beat.numbers[-1]) + 1
    pairs = bursts * density * (LONGEST_S - SHORTEST_S)
    # Binomial tail, by its largest term: choose which of the places are hit.
    from scipy.special import gammaln

    ways = gammaln(places - 1) - gammaln(count - 1) - gammaln(max(places - count, 0) + 1)
    exponent = np.log(max(pairs, 1e-9)) + ways + (count - 2) * np.log(hit)
    return float(np.exp(min(exponent, 50.0)))
