"""Count groups at intervals that no tag has, to adapt the threshold to the present noise.

Thresholds are computed for white noise. Other noise (mains bursts, a keyed transmitter, hum)
forms more groups. Their excess is counted at intervals that are shorter than the tag's by more
than the interval's uncertainty. The only assumption is that the noise is unrelated to the tag's
interval.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.search.tuning import GROUPS, NULL

_WHITE_K = np.log(NULL.ks)
Lows = NDArray[np.intp]
"""(places, K - 1) columns from an anchor to the range of each other pulse of its group."""
Test = Callable[[Lows, int], bool]
"""Function that tests whether the present strong cells form a group at an interval shorter than
the tag's. Arguments: `lows`, the first columns of the ranges of the group's other pulses, and
the reduction of the interval [columns]."""


class NullLattices:
    """Counts the groups of one search at intervals that no tag has.

    `lows` (places, k - 1): columns from an anchor to the range of each other pulse, for the
    anchor in each place of the group. `expected_per_column`: number of groups in white noise,
    at one interval and at `NULL.counted_share` of the threshold. `threshold`: of a sum.
    `limit`: of a cell in a sum.
    """

    def __init__(
        self,
        *,
        lows: NDArray[np.intp],
        interval: float,
        expected_per_column: float,
        threshold: float,
        limit: float,
    ) -> None:
        k = len(lows)
        places = np.arange(k)
        apart = np.stack([np.delete(places, p) - p for p in range(k)])
        shares = np.linspace(NULL.shortest_share, NULL.longest_share, NULL.lattices)
        shorter = [round((1.0 - share) * interval) for share in shares.tolist()]
        self._lattices = [(np.ascontiguousarray(lows - apart * n), n) for n in shorter]
        white = float(np.interp(math.log(k), _WHITE_K, NULL.white_ratios))
        self._white_per_column = white * expected_per_column
        self.coloured = False
        """True while the noise is coloured: it forms more groups than white noise."""
        self._awaited = 0.0
        """Expected number of counted groups since the noise became coloured, times a margin."""
        self._k = k
        self._most = max(0.0, NULL.most_share * k * limit - threshold)
        self._more = 0.0
        """Rise of the threshold by counted groups [noise powers], including that by chance."""

    def count(self, columns: int, test: Test | None) -> None:
        """Count the groups completed by new columns, and adjust the threshold."""
        seen = 0 if test is None else sum(test(*lattice) for lattice in self._lattices)
        tolerated = NULL.tolerated_coloured_ratio if self.coloured else NULL.tolerated_ratio
        awaited = tolerated * NULL.lattices * columns * self._white_per_column
        self._awaited = self._awaited + awaited if self.coloured else 0.0
        gain = (
            max(NULL.gain, NULL.eager_gain / (NULL.eager_groups + self._awaited))
            if self.coloured
            else NULL.gain
        )
        more = self._more + gain * (seen - awaited)
        self._more = min(max(0.0, more), self._most + NULL.by_chance)

    def factor(self, threshold: float) -> float:
        """Factor on a threshold with which the noise forms as many groups as white noise."""
        return 1.0 + max(0.0, self._more - NULL.by_chance) / threshold

    def least(self, threshold: float) -> float:
        """Minimum sum of powers for a group to be counted [noise powers]."""
        return NULL.counted_share * threshold * self.factor(threshold)

    def cell_limit(self, threshold: float) -> float:
        """Limit on a cell's power in counted groups at a threshold [noise powers]."""
        return counted_cell_limit(self._k, threshold * self.factor(threshold))


def counted_cell_limit(k: int, threshold: float) -> float:
    """Limit on a cell's power in the groups counted at null intervals [noise powers].

    It is lower than the limit in the search. Otherwise a single pulse of a weak tag would form
    such groups together with noise, and raise the threshold for its own tag.
    """
    share = NULL.cell_share + (1.0 - NULL.cell_share) / k
    return min(GROUPS.cell_limit, share * threshold)
