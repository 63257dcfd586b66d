"""Required sums for a given number of false identifications per hour and code.

The sum of n cells of noise has Erlang's distribution; of the sums tried in an hour only some
are independent, a number that was measured (docs/explanation/coded-tags.md). Several bursts are
judged by the sum of amplitudes, Rayleigh's, whose tail is that of Lugannani and Rice (1980).
"""

import math
from functools import lru_cache

from uavrt.lean_scipy import special
from uavrt.messages import Tag

FALSE_PER_HOUR = 1e-4
"""False identifications allowed from noise, per code."""
_SHARES = {1: 0.4, 3: 0.2}
"""Shares of the false alarms for sums of one burst and of three; the rest is for the
longest."""
_PER_CELL = 60.0
"""Independent sums for each pulse width and its inverse: cells overlap, gaps stretch."""
_PER_INTERVAL = 1.0
"""Independent burst intervals per pulse width of the last burst's uncertainty."""
_PER_LOOK = 14.0
"""Independent sums in a refinement."""


@lru_cache(maxsize=256)
def limit(pulses: int, tests_per_hour: float, false_per_hour: float) -> float:
    """Sum of cells, in noise energies, that noise reaches at this rate."""
    return float(special.gammainccinv(pulses, min(0.5, false_per_hour / tests_per_hour)))


def tests_per_hour(tag: Tag, *, bandwidth_hz: float, bursts: int) -> float:
    """Number of independent sums of several bursts of one code in an hour."""
    width_s = tag.pulse_width_s
    cells = 3600.0 / width_s * (bandwidth_hz * width_s + 1.0)
    off_s = 2.0 * (bursts - 1) * tag.interval_uncertainty_s
    return _PER_CELL * cells * (1.0 + _PER_INTERVAL * off_s / width_s)


def sum_limit(
    tag: Tag, *, bandwidth_hz: float, bursts: int, pulses: int, false_per_hour: float
) -> float:
    """Least sum that identifies a tag.

    `pulses`: cells in the sum. `false_per_hour`: allowed identifications from noise.
    """
    share = _SHARES.get(bursts, 1.0 - sum(_SHARES.values()))
    tests = tests_per_hour(tag, bandwidth_hz=bandwidth_hz, bursts=bursts)
    return limit(pulses, tests, share * false_per_hour)


def amplitude_limit(
    tag: Tag, *, bandwidth_hz: float, bursts: int, pulses: int, false_per_hour: float
) -> float:
    """Least sum of amplitudes of several refined bursts; otherwise as `sum_limit`."""
    share = _SHARES.get(bursts, 1.0 - sum(_SHARES.values()))
    tests = tests_per_hour(tag, bandwidth_hz=bandwidth_hz, bursts=bursts)
    return rayleigh_limit(pulses, min(0.1, share * false_per_hour / (_PER_LOOK * tests)))


@lru_cache(maxsize=256)
def rayleigh_limit(count: int, chance: float) -> float:
    """Sum of the amplitudes of noise cells that is reached with a given probability."""
    low, high = 0.02, 8.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        if _rayleigh_tail(count, middle)[1] > chance:
            low = middle
        else:
            high = middle
    return _rayleigh_tail(count, low)[0]


def _rayleigh_tail(count: int, s: float) -> tuple[float, float]:
    """A sum, by its saddle point, and the chance that noise exceeds it."""
    half_root_pi = 0.5 * math.sqrt(math.pi)
    h = math.exp(0.25 * s * s) * (1.0 + float(special.erf(0.5 * s)))
    slope = 0.5 * s * h + 1.0 / math.sqrt(math.pi)
    # The moment generating function and its derivatives.
    m = 1.0 + half_root_pi * s * h
    first = half_root_pi * (h + s * slope)
    second = half_root_pi * (2.0 * slope + s * (0.5 * h + 0.5 * s * slope))
    mean = first / m
    total = count * mean
    w = math.sqrt(2.0 * (s * total - count * math.log(m)))
    u = s * math.sqrt(count * (second / m - mean * mean))
    density = math.exp(-0.5 * w * w) / math.sqrt(2.0 * math.pi)
    return total, float(special.ndtr(-w)) + density * (1.0 / u - 1.0 / w)


def longest(tag: Tag, kept_s: float) -> int:
    """Most bursts that are summed: at most K, and within the kept cells on both sides."""
    return max(1, min(tag.k, 1 + math.floor(0.5 * kept_s / tag.pulse_intervals_s[0])))
