"""Buffer of the recent samples of a channel, with times, gaps and impulses.

Times are those of the blocks; a difference between blocks' times and sample counts is either a
slow clock (followed) or lost samples (filled with zeros). Runs of zeros count as lost samples,
also if the sender inserted them. Lost samples have no weight in any statistic.
"""

import bisect
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.core.runtime.native import kernels
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.detection.signal.tuning import CHANNEL
from uavrt.dsp.zero_runs import zero_runs


@dataclass(slots=True)
class Counters:
    """Counters of a detector since its start, one for each kind of lost or refused data."""

    samples: int = 0
    samples_lost: int = 0
    """Number of samples missing according to the blocks' times; replaced by zeros."""
    samples_blanked: int = 0
    """Number of samples set to zero because they were impulses."""
    blocks_stale: int = 0
    """Number of blocks refused because they precede samples already received."""
    restarts: int = 0
    """Number of restarts of the detector after a jump of time too long to bridge."""
    pulses: int = 0
    groups: int = 0
    tracks: int = 0
    rejected: dict[str, int] = field(default_factory=dict)
    """Number of candidate groups above the threshold that were rejected, by reason."""

    def reject(self, reason: str, count: int = 1) -> None:
        """Count rejected candidates, separately for each reason."""
        self.rejected[reason] = self.rejected.get(reason, 0) + count


class SampleBuffer:
    """Stores the recent samples of a channel; an index counts from the start of the stream.

    `keep`: number of newest samples that are stored. `tolerance_s`: deviation of a block's time
    up to which the clock counts as slow and no samples as lost [s].
    """

    def __init__(self, *, sample_rate_hz: float, keep: int, tolerance_s: float) -> None:
        self.sample_rate_hz = sample_rate_hz
        self._ns_per_sample = NANOSECONDS_PER_SECOND / sample_rate_hz
        self._keep = keep
        self._tolerance_ns = tolerance_s * NANOSECONDS_PER_SECOND
        # Stored samples move to the front when the buffer is full: a quarter as many, every
        # second. With half, 5 MB more for 100 tags, that happens half as often (50 us each).
        self._data = np.zeros(keep + keep // 4 + 1024, np.complex64)
        self.start = 0
        """Index of the oldest stored sample, counted from the stream's start."""
        self.end = 0
        """Index after the newest stored sample, counted from the stream's start."""
        self._stamp_index: list[int] = []
        self._stamp_ns: list[int] = []
        self.holes: list[tuple[int, int]] = []
        """Sample index ranges that no block has filled yet and that contain zeros."""
        self.lost: list[tuple[int, int]] = []
        """Sample index ranges that are lost: runs of zeros found up to `examined`."""
        self.examined = 0
        """Sample index up to which the buffer was searched for zeros."""
        self._shortest = max(
            CHANNEL.shortest_loss_samples, math.ceil(CHANNEL.shortest_loss_s * sample_rate_hz)
        )
        self.blanked: list[tuple[int, int]] = []
        """Sample index ranges that were blanked as impulses."""

    @property
    def empty(self) -> bool:
        """True before the first block has been added to the buffer."""
        return not self._stamp_index

    @property
    def newest(self) -> int:
        """Index of the newest block's first sample."""
        return self._stamp_index[-1]

    def deviation_ns(self, time_ns: int) -> float:
        """Delay of a block relative to the time expected from the number of samples [ns]."""
        ahead = self.end - self._stamp_index[-1]
        return (time_ns - self._stamp_ns[-1]) - ahead * self._ns_per_sample

    def time_ns(self, index: float) -> int:
        """Time of a sample at the antenna [ns]; the index may be fractional or just beyond."""
        at = max(0, bisect.bisect_right(self._stamp_index, index) - 1)
        return self._stamp_ns[at] + round((index - self._stamp_index[at]) * self._ns_per_sample)

    def index(self, time_ns: int) -> float:
        """Index of the sample at a time; the inverse of `time_ns`."""
        at = max(0, bisect.bisect_right(self._stamp_ns, time_ns) - 1)
        return self._stamp_index[at] + (time_ns - self._stamp_ns[at]) / self._ns_per_sample

    def indices(self, times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Indices of the samples at many times, as `index`."""
        stamps_ns = np.array(self._stamp_ns, np.int64)
        at = np.maximum(np.searchsorted(stamps_ns, times_ns, side="right") - 1, 0)
        behind = (times_ns - stamps_ns[at]) / self._ns_per_sample
        return np.array(self._stamp_index, np.float64)[at] + behind

    def view(self, first: int, last: int) -> NDArray[np.complex64]:
        """Samples with indices [first, last), all of which must be stored."""
        return self._data[first - self.start : last - self.start]

    def extend(self, blocks: Sequence[tuple[NDArray[np.complex64], int]]) -> int:
        """Add blocks as long as each continues the previous one; return the number added. With
        a hundred tags, nearly all of a thousand blocks a second are added here.
        """
        if not self._stamp_index:
            return 0
        data, used, step_ns = self._data, self.end - self.start, self._ns_per_sample
        indices, times_ns, room = self._stamp_index, self._stamp_ns, len(self._data)
        due_ns = times_ns[-1] + (self.end - indices[-1]) * step_ns
        least_ns, added = self._tolerance_ns, 0
        for samples, time_ns in blocks:
            upto = used + len(samples)
            if upto == used or not -least_ns < due_ns - time_ns < least_ns:
                break
            if upto > room:
                self.end = self.start + used
                self._make_room(len(samples))
                data, used = self._data, self.end - self.start
                upto, room = used + len(samples), len(data)
            indices.append(self.start + used)
            times_ns.append(time_ns)
            data[used:upto] = samples
            due_ns = time_ns + (upto - used) * step_ns
            used = upto
            added += 1
        self.end = self.start + used
        return added

    def append(self, samples: NDArray[np.complex64], time_ns: int) -> None:
        """Add samples; the time is that of the first one."""
        self._stamp_index.append(self.end)
        self._stamp_ns.append(time_ns)
        self._write(samples)

    def append_hole(self, count: int) -> None:
        """Add a number of zeros for lost samples."""
        self.holes.append((self.end, self.end + count))
        while count:
            part = min(count, self._keep)
            self._write(np.zeros(part, np.complex64))
            count -= part

    def fill_hole(self, samples: NDArray[np.complex64], time_ns: int, after: int) -> bool:
        """Put a late block into its gap, if it begins at index `after` or later."""
        first = round(self.index(time_ns))
        last = first + len(samples)
        for at, (low, high) in enumerate(self.holes):
            if low - 1 <= first and last <= high + 1 and first >= max(after, self.start):
                first, last = max(first, low), min(last, high)
                self.view(first, last)[:] = samples[: last - first]
                self.holes[at : at + 1] = [
                    (a, b) for a, b in ((low, first), (last, high)) if b > a
                ]
                return True
        return False

    def clear(self) -> None:
        """Remove all samples; indices count from zero again."""
        self.start = self.end = 0
        self._stamp_index.clear()
        self._stamp_ns.clear()
        self.holes.clear()
        self.blanked.clear()
        self.lost.clear()
        self.examined = 0

    def examine(self, upto: int) -> None:
        """Find lost samples up to an index; call this before impulses there are blanked."""
        first = max(self.examined, self.start)
        for low, high in zero_runs(self.view(first, upto), self._shortest):
            low, high = first + low, first + high
            if self.lost and self.lost[-1][1] == low:
                low = self.lost.pop()[0]
            self.lost.append((low, high))
        self.examined = max(upto, self.examined)

    def silence(self, first: int, last: int) -> None:
        """Set the lost samples of [first, last) to zero again after a filter changed them."""
        for low, high in self.lost:
            if low < last and first < high:
                self.view(max(low, first), min(high, last))[:] = 0.0

    def loses(self, first: float, last: float) -> bool:
        """True if any sample of [first, last) is lost."""
        return any(low < last and first < high for low, high in self.lost)

    def weights(self, first: NDArray[Any], window: int) -> NDArray[np.float64] | None:
        """Factors on the power of windows that compensate for lost samples; None: none lost.

        A factor is the inverse of the share of received samples; 0 below
        `CHANNEL.least_received`.
        """
        if not self.lost or not first.size or not self.loses(first.min(), first.max() + window):
            return None
        share = np.ones(first.shape)
        for begin, end in self.lost:
            gone = np.minimum(first + window, end) - np.maximum(first, begin)
            share -= np.maximum(gone, 0) / window
        return np.where(
            share < CHANNEL.least_received, 0.0, 1.0 / np.maximum(share, CHANNEL.least_received)
        )

    def _write(self, samples: NDArray[np.complex64]) -> None:
        count = len(samples)
        if self.end - self.start + count > len(self._data):
            self._make_room(count)
        used = self.end - self.start
        self._data[used : used + count] = samples
        self.end += count

    def _make_room(self, count: int) -> None:
        used = self.end - self.start
        kept = min(used, self._keep)
        if kept + count > len(self._data):
            grown = np.zeros(kept + count + self._keep, np.complex64)
            grown[:kept] = self._data[used - kept : used]
            self._data = grown
        else:
            # One move within the buffer; a NumPy assignment would make a copy first.
            data = self._data.view(np.uint8).data
            size = self._data.itemsize
            data[: kept * size] = data[(used - kept) * size : used * size]
        self.start = self.end - kept
        self._drop_old()

    def _drop_old(self) -> None:
        at = max(0, bisect.bisect_right(self._stamp_index, self.start) - 1)
        del self._stamp_index[:at], self._stamp_ns[:at]
        self.holes = [(a, b) for a, b in self.holes if b > self.start]
        self.blanked = [(a, b) for a, b in self.blanked if b > self.start]
        self.lost = [(a, b) for a, b in self.lost if b > self.start]


def blank_impulses(
    samples: NDArray[np.complex64],
    *,
    floor: float,
    short: int,
    flank: int,
    first: int,
    last: int,
) -> list[tuple[int, int]]:
    """Set bursts that are too short for a pulse to zero, in place.

    A burst is a stretch with a power, averaged over `short` samples, of 12 times the noise
    floor and 4 times the power at a distance of `flank` both before *and* after it. Inside a
    pulse, however strong, at least one of these is as strong as the middle. Bursts of up to two
    flanks are blanked. Without this, impulses of 1 ms made a false group in every segment.
    """
    if not len(samples):
        return []
    native = kernels()
    if native is not None:
        largest = native.largest(samples)
    else:
        parts = samples.view(np.float32)
        largest = max(float(np.maximum.reduce(parts)), -float(np.minimum.reduce(parts)))
    if 2.0 * largest**2 < 24.0 * floor:
        return []
    power = samples.real**2 + samples.imag**2
    if float(power[first:last].max(initial=0.0)) < 24.0 * floor:
        return []
    total = np.concatenate(([0.0], np.cumsum(power, dtype=np.float64)))
    # energy[i] is the mean power of `short` samples around sample i.
    half = short // 2
    low = np.clip(np.arange(len(power)) - half, 0, len(power))
    high = np.clip(low + short, 0, len(power))
    energy = (total[high] - total[low]) / np.maximum(high - low, 1)
    # Mean of the received samples only: the lost ones may hold the rest of a pulse.
    there = np.concatenate(([0], np.cumsum(power > 0.0)))
    received = there[high] - there[low]
    much = 2 * received > high - low
    around = np.where(much, energy * (high - low) / np.maximum(received, 1), np.inf)
    before = np.concatenate((np.full(flank, floor), around[:-flank]))
    after = np.concatenate((around[flank:], np.full(flank, floor)))
    burst = (energy > 12.0 * floor) & (energy > 4.0 * np.maximum(before, after))
    burst[:first] = False
    burst[last:] = False
    if not burst.any():
        return []
    for _ in range(short):  # the filter's ringing on both sides
        burst[1:] |= burst[:-1]
        burst[:-1] |= burst[1:]
    burst[:first] = False
    burst[last:] = False
    samples[burst] = 0.0
    edges = np.flatnonzero(np.diff(burst, prepend=False, append=False)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))
