"""How often the noise at hand makes groups: the same search on lattices that no tag has.

Thresholds are calculated for white noise. Noise of another kind (bursts of the mains, a
neighbour that is keyed, hum) makes more groups; how many more is counted on intervals shorter
than the tag's by more than it may err. Nothing is assumed of the noise but that it does not
know the tag's interval.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

LEVEL = 0.93
"""Share of the threshold in force at which groups are counted: often enough to be counted in
some ten seconds, and so near the threshold that they come as those that reach it. At 0.85
sparks that vary made 1.5 times the false groups asked for: their tail falls slowly."""
_SHORTEST, _LONGEST = 0.58, 0.86
"""Intervals of the lattices over the tag's: two of the shortest are no interval of the tag."""
_LATTICES = 12
_GAIN = 0.08
"""Noise powers that a group adds to the count."""
_EAGER, _EAGER_FOR = 1.6, 3.0
"""Noise powers that a group adds while coloured noise is new, over the groups awaited since it
began and a few: the steps of stochastic approximation. The first is the mean excess of a group
in such noise; with `_GAIN` from the start the first 10 s made 6.5 times the false groups."""
_CHANCE = 0.4
"""Count that white noise reaches by chance: only what is more raises the threshold."""
_MOST_SHARE = 0.85
"""Most of the largest sum, K cells at their limit, that is asked for: strong pulses of other
transmitters are counted as well, and must not hide a strong tag."""
_TOLERATED = 1.6
"""Groups counted over those of white noise that leave the threshold where it is."""
_TOLERATED_COLOURED = 1.2
"""The same while the noise is known not to be white: then an excess is hardly chance."""
_WHITE_K = np.log(np.array([2.0, 3.0, 5.0, 8.0]))
_WHITE = np.array([0.51, 0.68, 1.03, 1.09])
"""Groups counted in white noise over those that the tail of a sum says, by K: measured. An
anchor is a Kth of the threshold, and a step counts once on a lattice."""
Test = Callable[[NDArray[np.intp], int], bool]
"""Whether anchors at hand make a group at the level on a lattice: `lows` of its other pulses,
and columns by which its interval is shorter than the tag's."""


class NullLattices:
    """Counts the groups of one search that lie on lattices of no tag.

    `lows` (places, k - 1): columns from an anchor in each place to the stretches where the
    other pulses may lie.
    `expected_per_column`: groups of white noise at `LEVEL` of the threshold, on one lattice.
    `threshold`, `limit`: of a sum and of a cell in it, in noise powers.
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
        shares = np.linspace(_SHORTEST, _LONGEST, _LATTICES)
        shorter = [round((1.0 - share) * interval) for share in shares.tolist()]
        self._lattices = [(np.ascontiguousarray(lows - apart * n), n) for n in shorter]
        white = float(np.interp(math.log(k), _WHITE_K, _WHITE))
        self._white_per_column = white * expected_per_column
        self.coloured = False
        """Whether the noise is known not to be white."""
        self._awaited = 0.0
        """Groups tolerated since it is."""
        self._most = max(0.0, _MOST_SHARE * k * limit - threshold)
        self._more = 0.0
        """Noise powers counted, the first few by chance."""

    def count(self, columns: int, test: Test | None) -> None:
        """Count the groups that new columns complete, and move the threshold.

        `test`: None: there are no anchors.
        """
        seen = 0 if test is None else sum(test(*lattice) for lattice in self._lattices)
        tolerated = _TOLERATED_COLOURED if self.coloured else _TOLERATED
        awaited = tolerated * _LATTICES * columns * self._white_per_column
        self._awaited = self._awaited + awaited if self.coloured else 0.0
        gain = max(_GAIN, _EAGER / (_EAGER_FOR + self._awaited)) if self.coloured else _GAIN
        more = self._more + gain * (seen - awaited)
        self._more = min(max(0.0, more), self._most + _CHANCE)

    def factor(self, threshold: float) -> float:
        """What to multiply a threshold by for as many false groups as in white noise."""
        return 1.0 + max(0.0, self._more - _CHANCE) / threshold
