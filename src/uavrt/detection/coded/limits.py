"""Compute the sums required for a given number of false identifications per hour and code.

The sum of n noise cells has an Erlang distribution. Only some of the sums that are tried in an
hour are independent; their number was measured (docs/explanation/coded-tags.md). Several bursts
are tested by the sum of their Rayleigh amplitudes, whose distribution is computed as by
Lugannani and Rice (1980).
"""

import math
from functools import lru_cache

from uavrt.core.messages import Tag
from uavrt.core.runtime.lean_scipy import special
from uavrt.detection.coded.tuning import LIMITS


@lru_cache(maxsize=256)
def limit(pulses: int, tests_per_hour: float, false_per_hour: float) -> float:
    """Sum of cell energies that noise reaches at a given hourly rate [noise energies]."""
    return float(special.gammainccinv(pulses, min(0.5, false_per_hour / tests_per_hour)))


def tests_per_hour(tag: Tag, *, bandwidth_hz: float, bursts: int) -> float:
    """Number of independent sums over several bursts of one code that are tested in an hour."""
    width_s = tag.pulse_width_s
    cells = 3600.0 / width_s * (bandwidth_hz * width_s + 1.0)
    off_s = 2.0 * (bursts - 1) * tag.interval_uncertainty_s
    return LIMITS.per_cell * cells * (1.0 + LIMITS.per_interval * off_s / width_s)


def sum_limit(
    tag: Tag, *, bandwidth_hz: float, bursts: int, pulses: int, false_per_hour: float
) -> float:
    """Minimum sum of cell energies that identifies a tag [noise energies]."""
    share = _share(bursts)
    tests = tests_per_hour(tag, bandwidth_hz=bandwidth_hz, bursts=bursts)
    return limit(pulses, tests, share * false_per_hour)


def amplitude_limit(
    tag: Tag, *, bandwidth_hz: float, bursts: int, pulses: int, false_per_hour: float
) -> float:
    """Minimum sum of amplitudes for several refined bursts; parameters as in `sum_limit`."""
    share = _share(bursts)
    tests = tests_per_hour(tag, bandwidth_hz=bandwidth_hz, bursts=bursts)
    return rayleigh_limit(
        pulses, min(0.1, share * false_per_hour / (LIMITS.per_refinement * tests))
    )


def _share(bursts: int) -> float:
    shares = {1: LIMITS.share_of_one, 3: LIMITS.share_of_three}
    return shares.get(bursts, 1.0 - sum(shares.values()))


@lru_cache(maxsize=256)
def rayleigh_limit(count: int, chance: float) -> float:
    """Sum of amplitudes that noise exceeds with a given probability."""
    low, high = 0.02, 8.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        if _rayleigh_tail(count, middle)[1] > chance:
            low = middle
        else:
            high = middle
    return _rayleigh_tail(count, low)[0]


def _rayleigh_tail(count: int, s: float) -> tuple[float, float]:
    """Saddle point for a sum of amplitudes, and probability that noise exceeds the sum."""
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
    """Maximum number of bursts in a sum: K, or fewer if the stored cells are shorter."""
    return max(1, min(tag.k, 1 + math.floor(0.5 * kept_s / tag.pulse_intervals_s[0])))
