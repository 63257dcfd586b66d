"""Bounds that a detector of K pulses cannot pass, and the published figures of the original.

All by reference/detector.md §9: noncoherent square law, Pd = Q_K(sqrt(2 K ENR), sqrt(2 x)) with
x the threshold of a sum of K unit exponentials.
"""

import math

ORIGINAL_PD = {6: 0.018, 7: 0.068, 8: 0.138, 9: 0.333, 10: 0.590, 11: 0.843, 12: 0.965}
"""Pd of the original at pf 1 %, thesis tag, K = 3, by ENR in dB."""
EFFECTIVE_CELLS = {1: 1.5e4, 2: 3.7e5, 3: 9e5, 5: 6e6, 8: 3e7, 12: 7e8}
"""Effective hypotheses of the original's search, by K (the middle of the range given)."""
ENR_HALF_DB = {1: 11.4, 2: 9.8, 3: 8.5, 5: 7.2, 8: 6.0, 12: 5.2}
"""ENR for Pd .5 of the table of theory, by K: aligned pulses, full search."""


def erlang_tail(k: int, x: float) -> float:
    """Chance that a sum of k unit exponentials passes x."""
    term = total = 1.0
    for i in range(1, k):
        term *= x / i
        total += term
    return math.exp(-x) * total


def erlang_threshold(k: int, probability: float) -> float:
    """Threshold that a sum of k unit exponentials passes with a probability."""
    low, high = 0.0, 1000.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        if erlang_tail(k, middle) > probability:
            low = middle
        else:
            high = middle
    return high


def detection_probability(k: int, enr_db: float, threshold: float) -> float:
    """Marcum's Q_K: chance that k pulses of an ENR pass a threshold.

    A noncentral chi-square is a Poisson mixture of Erlang sums.
    """
    mean = k * 10.0 ** (enr_db / 10.0)
    weight = math.exp(-mean)
    total = 0.0
    for extra in range(int(mean + 12.0 * math.sqrt(mean) + 30.0)):
        if extra:
            weight *= mean / extra
        total += weight * erlang_tail(k + extra, threshold)
    return total


def genie(k: int, enr_db: float, false_alarms: float = 0.01) -> float:
    """Pd when time, frequency and interval are known beforehand."""
    return detection_probability(k, enr_db, erlang_threshold(k, false_alarms))


def union_bound(k: int, enr_db: float, false_alarms: float = 0.01) -> float:
    """Pd of perfectly aligned pulses at the threshold of the original's full search."""
    return detection_probability(
        k, enr_db, erlang_threshold(k, false_alarms / EFFECTIVE_CELLS[k])
    )


def wilson_interval(hits: int, trials: int) -> tuple[float, float]:
    """95 % interval of a probability (Wilson's score)."""
    if trials == 0:
        return 0.0, 1.0
    z = 1.96
    share = hits / trials
    middle = (share + z * z / (2 * trials)) / (1.0 + z * z / trials)
    half = z * math.sqrt(share * (1.0 - share) / trials + z * z / (4.0 * trials * trials))
    half /= 1.0 + z * z / trials
    return max(0.0, middle - half), min(1.0, middle + half)


def poisson_interval(count: int) -> tuple[float, float]:
    """95 % interval of the mean of a Poisson count (Wilson and Hilferty's approximation)."""
    low = 0.0
    if count:
        low = count * (1.0 - 1.0 / (9.0 * count) - 1.96 / (3.0 * math.sqrt(count))) ** 3
    more = count + 1
    high = more * (1.0 - 1.0 / (9.0 * more) + 1.96 / (3.0 * math.sqrt(more))) ** 3
    return low, high
