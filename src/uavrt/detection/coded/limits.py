"""How large a sum must be: false identities in an hour for each code.

The sum of n cells of noise has Erlang's distribution; of the sums tried in an hour only some
are independent: how many was measured (docs/explanation/coded-tags.md).
"""

import math
from functools import lru_cache

from scipy.special import gammainccinv

from uavrt.messages import Tag

FALSE_PER_HOUR = 1e-4
"""Identities that noise may make, of each code."""
_SHARES = {1: 0.4, 3: 0.2}
"""Of the sums of so many bursts; the rest is of the longest."""
_PER_CELL = 60.0
"""Independent sums for each pulse width and its inverse: cells overlap, gaps stretch."""
_PER_INTERVAL = 1.0
"""Independent burst intervals for each pulse width by which the last burst may be off."""


@lru_cache(maxsize=256)
def limit(pulses: int, tests_per_hour: float, false_per_hour: float) -> float:
    """Sum of cells, in noise energies, that noise reaches so often."""
    return float(gammainccinv(pulses, min(0.5, false_per_hour / tests_per_hour)))


def tests_per_hour(tag: Tag, *, bandwidth_hz: float, bursts: int) -> float:
    """Independent sums of so many bursts of one code in an hour."""
    width_s = tag.pulse_width_s
    cells = 3600.0 / width_s * (bandwidth_hz * width_s + 1.0)
    off_s = 2.0 * (bursts - 1) * tag.interval_uncertainty_s
    return _PER_CELL * cells * (1.0 + _PER_INTERVAL * off_s / width_s)


def sum_limit(
    tag: Tag, *, bandwidth_hz: float, bursts: int, pulses: int, false_per_hour: float
) -> float:
    """Least sum that is this tag.

    Parameters
    ----------
    tag : Tag
    bandwidth_hz : float
        That is searched.
    bursts : int
        Summed.
    pulses : int
        Cells in the sum.
    false_per_hour : float
        Identities that noise may make.
    """
    share = _SHARES.get(bursts, 1.0 - sum(_SHARES.values()))
    tests = tests_per_hour(tag, bandwidth_hz=bandwidth_hz, bursts=bursts)
    return limit(pulses, tests, share * false_per_hour)


def longest(tag: Tag, kept_s: float) -> int:
    """Most bursts that are summed: as many as K, and as the kept cells hold to both sides."""
    return max(1, min(tag.k, 1 + math.floor(0.5 * kept_s / tag.pulse_intervals_s[0])))
