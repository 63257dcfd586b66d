"""Compute the times of a stream's samples from the times of its blocks.

The nominal sample rate is used only within a block. Over an hour, a crystal that is off by 50
ppm would cause an error of 180 ms, and gaps and clock corrections would add to it.
"""

from bisect import bisect_right
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.core.units import NANOSECONDS_PER_SECOND

_LEAST_STEP_NS: Final = 100_000
"""Minimum deviation of a block's time from the time computed by the sample rate for it to be
stored [ns]."""


class BlockTimes:
    """Converts between sample indices and times in a stream."""

    def __init__(self, sample_rate_hz: float) -> None:
        self._rate_hz = sample_rate_hz
        self._ns_per_sample = NANOSECONDS_PER_SECOND / sample_rate_hz
        self._indices: list[int] = []
        self._times_ns: list[int] = []

    @property
    def start_ns(self) -> int:
        """Time of the first block [ns, UTC]; 0 without blocks."""
        return self._times_ns[0] if self._times_ns else 0

    def add(self, index: int, time_ns: int) -> None:
        """Add the time [ns, UTC] and the index, counting lost samples, of a block's first
        sample.
        """
        if self._indices and abs(time_ns - self.time_ns(index)) < _LEAST_STEP_NS:
            return
        self._indices.append(index)
        self._times_ns.append(time_ns)

    def time_ns(self, index: float) -> int:
        """Time of a sample [ns, UTC]; `index` may lie between two samples."""
        at = max(0, bisect_right(self._indices, index) - 1)
        ahead_ns = round((index - self._indices[at]) * self._ns_per_sample)
        return self._times_ns[at] + ahead_ns

    def seconds(self, indices: NDArray[np.float64], since_ns: int) -> NDArray[np.float64]:
        """Times of many samples [s], relative to `since_ns`."""
        at = np.maximum(np.searchsorted(self._indices, indices, side="right") - 1, 0)
        begin_s = (np.array(self._times_ns, np.int64) - since_ns) / NANOSECONDS_PER_SECOND
        ahead = indices - np.array(self._indices, np.int64)[at]
        return np.asarray(begin_s[at] + ahead / self._rate_hz, np.float64)

    def index(self, time_ns: int) -> float:
        """Return the fractional sample index at a time. If the clock was set back and two
        samples have that time, the first is returned.
        """
        for at, first in enumerate(self._indices):
            index = first + (time_ns - self._times_ns[at]) / self._ns_per_sample
            if at + 1 == len(self._indices) or index < self._indices[at + 1]:
                # A time that was skipped when the clock was set forward.
                return max(index, float(first)) if at else index
        raise ValueError("no block of samples has been added yet")
