"""Compute the chance that pulses of two independent transmitters coincide."""

import math

import numpy as np

from uavrt.detection.track.tuning import GHOSTS


def by_chance(
    together: int, pulses: int, *, near_s: float, interval_s: float, uncertainty_s: float
) -> float:
    """Probability that `together` of a tag's `pulses` coincide by chance with another tag's.

    There are two cases. Either the two trains drift past each other slowly, with any phase and
    any difference of intervals within the uncertainty; or their pulses coincide one by one.
    """
    window_s = min(2.0 * near_s, interval_s)
    single = window_s / interval_s
    one_by_one = _at_least(together, pulses, single)
    # No run of this number that is steeper fits into the window.
    steepest_s = window_s / (together - 1)
    reach_s = min(uncertainty_s, steepest_s)
    drift_s = (np.arange(GHOSTS.drift_steps) + 0.5) / GHOSTS.drift_steps * reach_s
    phase_s = window_s - (together - 1) * drift_s
    phase_s = phase_s + (pulses - together) * np.minimum(drift_s, phase_s)
    share = reach_s / uncertainty_s if uncertainty_s > 0.0 else 1.0
    return min(1.0, one_by_one + share * float(phase_s.mean()) / interval_s)


def of_ghosts(together: int, pulses: int) -> float:
    """Probability that at most `together` of a ghost's `pulses` coincide with its source's."""
    return 1.0 - _at_least(together + 1, pulses, GHOSTS.coincident_share)


def _at_least(count: int, of: int, chance: float) -> float:
    return sum(
        math.comb(of, n) * chance**n * (1.0 - chance) ** (of - n) for n in range(count, of + 1)
    )
