"""Theoretical bounds for a detector of K pulses.

Noncoherent square law, Pd = Q_K(sqrt(2 K ENR), sqrt(2 x)) with x the threshold of a sum of K
unit exponentials.
"""

import math
from functools import lru_cache

EFFECTIVE_CELLS = {1: 1.5e4, 2: 3.7e5, 3: 9e5, 5: 6e6, 8: 3e7, 12: 7e8}
"""Effective number of hypotheses of the original's search, by K (the middle of the stated
range)."""
EFFECTIVE_CELLS_TRACKER = 2.3e6
"""Effective number of hypotheses for the default tag of the original's ground
station, K = 3."""
ENR_HALF_DB = {1: 11.4, 2: 9.8, 3: 8.5, 5: 7.2, 8: 6.0, 12: 5.2}
"""Theoretical ENR [dB] for Pd 0.5, by K: aligned pulses, full search."""
GENIE_HALF_DB = {1: 6.1, 2: 4.1, 3: 2.9, 5: 1.5, 8: 0.2, 12: -0.8}
"""Theoretical ENR [dB] for Pd 0.5 with time, frequency and interval known, by K."""
LONG_HALF_DB = {20: 1.2, 40: -0.5}
"""Bound of the ENR [dB] for Pd 0.5 of the long integration without jitter, by K."""


def erlang_tail(k: int, x: float) -> float:
    """Probability that a sum of k unit exponentials exceeds x."""
    term = total = 1.0
    for i in range(1, k):
        term *= x / i
        total += term
    return math.exp(-x) * total


@lru_cache(maxsize=256)
def erlang_threshold(k: int, probability: float) -> float:
    """Threshold that a sum of k unit exponentials exceeds with a given probability."""
    low, high = 0.0, 1000.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        if erlang_tail(k, middle) > probability:
            low = middle
        else:
            high = middle
    return high


def detection_probability(k: int, enr_db: float, threshold: float) -> float:
    """Marcum's Q_K: probability that k pulses of an ENR exceed a threshold.

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
    """Pd if time, frequency and interval are known."""
    return detection_probability(k, enr_db, erlang_threshold(k, false_alarms))


def union_bound(
    k: int, enr_db: float, false_alarms: float = 0.01, cells: float | None = None
) -> float:
    """Pd of perfectly aligned pulses at the threshold of the original's full search."""
    cells = EFFECTIVE_CELLS[k] if cells is None else cells
    return detection_probability(k, enr_db, erlang_threshold(k, false_alarms / cells))


def single_pulse(enr_db: float, false_alarms: float = 0.01) -> float:
    """Pd of an energy detector that decides on each pulse by itself, with the same false
    alarms.
    """
    return union_bound(1, enr_db, false_alarms)


def snr_error_db(enr_db: float) -> float:
    """Standard deviation of a pulse's measured ENR [dB] in known noise.

    The energy |sqrt(E) + n|^2 of a matched filter has the variance 2 E + 1.
    """
    energy = math.pow(10.0, enr_db / 10.0)
    return 10.0 / math.log(10.0) * math.sqrt(2.0 * energy + 1.0) / energy


def frequency_bound_hz(enr_db: float, pulse_width_s: float) -> float:
    """Cramér-Rao bound of the frequency of one rectangular pulse [Hz]."""
    return math.sqrt(6.0 / math.pow(10.0, enr_db / 10.0)) / (2.0 * math.pi * pulse_width_s)
