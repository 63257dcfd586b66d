"""Measure how often the present noise makes groups, on lattices that no tag has.

Thresholds are computed for white noise. Other noise (mains bursts, a keyed transmitter, hum)
makes more groups; the excess is counted at intervals shorter than the tag's by more than its
uncertainty. The only assumption is that the noise is not related to the tag's interval.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

LEVEL = 0.93
"""Share of the present threshold at which groups are counted: they are then frequent enough to
count within ten seconds, yet close to those that reach the threshold. At 0.85, varying sparks
made 1.5 times the nominal false groups, because their tail falls slowly."""
_SHORTEST, _LONGEST = 0.58, 0.86
"""Range of the lattices' intervals relative to the tag's; two of the shortest exceed the
tag's."""
_LATTICES = 12
_GAIN = 0.08
"""Noise powers that a group adds to the count."""
_EAGER, _EAGER_FOR = 0.7, 3.0
"""Noise powers that a group adds while coloured noise is new, over the groups awaited since it
began and a few: the steps of stochastic approximation. 1.6, the mean excess of a group in such
noise, would be faster, but cost a tag of 14 dB beside a carrier one pulse in a hundred."""
_CHANCE = 0.4
"""Count that white noise reaches by chance; only the excess raises the threshold."""
_MOST_SHARE = 0.85
"""Highest threshold as a share of the largest sum, K cells at their limit: strong pulses of
other transmitters are counted, too, and must not hide a strong tag."""
_TOLERATED = 1.6
"""Ratio of counted groups to those of white noise up to which the threshold is unchanged."""
_TOLERATED_COLOURED = 1.2
"""The same ratio while the noise is known to be coloured: an excess is then hardly chance."""
_WHITE_K = np.log(np.array([2.0, 3.0, 5.0, 8.0]))
_WHITE = np.array([0.51, 0.68, 1.03, 1.09])
"""Ratio of counted groups in white noise to the computed tail, by K: measured."""
Test = Callable[[NDArray[np.intp], int], bool]
"""Tests whether present anchors make a group at the level on a lattice: `lows` of its other
pulses, and columns by which its interval is shorter than the tag's."""


class NullLattices:
    """Counts the groups of one search on lattices that no tag has.

    `lows` (places, k - 1): columns from an anchor in each place to the stretches of the other
    pulses. `expected_per_column`: groups of white noise at `LEVEL` of the threshold, on one
    lattice. `threshold`, `limit`: of a sum and of a cell in it, in noise powers.
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
        """True while the noise is known to be coloured."""
        self._awaited = 0.0
        """False groups allowed since then."""
        self._most = max(0.0, _MOST_SHARE * k * limit - threshold)
        self._more = 0.0
        """Noise powers counted, less the first few due to chance."""

    def count(self, columns: int, test: Test | None) -> None:
        """Count the groups that new columns complete, and adjust the threshold.

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
        """Factor on a threshold that gives as many false groups as white noise."""
        return 1.0 + max(0.0, self._more - _CHANCE) / threshold
