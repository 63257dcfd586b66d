"""Put the blocks of a stream in order, even if they are late, early, missing or duplicate."""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag
from uavrt.core.units import ns_from_s
from uavrt.detection.signal.sample_buffer import Counters, SampleBuffer
from uavrt.detection.signal.tuning import CHANNEL


class LongestBlock:
    """Upper limit of the next block's length: the longest of the last 64 to 128 blocks."""

    def __init__(self) -> None:
        self.length = 0
        self._lately = 0
        self._before = 0
        self._count = 0

    def note(self, length: int) -> None:
        """Add the length of a block [samples]."""
        self._count += 1
        if self._count == CHANNEL.recent_blocks:
            self._before, self._lately, self._count = self._lately, 0, 0
            self.length = max(self._before, length)
        if length > self._lately:
            self._lately = length
            if length > self.length:
                self.length = length


class Intake:
    """Sorts the sample blocks of one detector into its buffer, by their times."""

    def __init__(self, tag: Tag, *, sample_rate_hz: float, counters: Counters) -> None:
        longest = max(tag.pulse_intervals_s) + tag.interval_uncertainty_s
        span_s = (tag.k - 1) * longest
        if len(tag.pulse_intervals_s) > 1:
            # The other rate is followed from the last received pulse, up to two intervals ago.
            span_s += 2.0 * longest
        # Batch, block, filter and the windows around a pulse: a group is tested 0.7 s late.
        keep_s = max(span_s, 1.0) + tag.interval_jitter_s + 0.8
        self._slow_clock_s = tag.pulse_width_s / 8.0
        self.buffer = SampleBuffer(
            sample_rate_hz=sample_rate_hz,
            keep=math.ceil((keep_s + tag.pulse_width_s) * sample_rate_hz),
            tolerance_s=self._slow_clock_s,
        )
        self._longest_hole_s = (tag.k + 1) * longest + tag.interval_jitter_s + 1.0
        self._rate_hz = sample_rate_hz
        self._counters = counters
        self.stale_blocks = 0
        """Number of consecutive sample blocks that began before the buffer's end."""

    def clear(self) -> None:
        """Delete all stored samples, so that the next block is treated as the first."""
        self.buffer.clear()
        self.stale_blocks = 0

    def admit(
        self, samples: NDArray[np.complex64], time_ns: int, *, after: int
    ) -> Literal["taken", "refused", "later", "earlier"]:
        """Add a block at the position given by its time.

        Returns ``taken`` or ``refused``. After a jump of time the block is not added, and the
        result is ``later`` or ``earlier``.
        """
        buffer, counters = self.buffer, self._counters
        if not buffer.empty:
            late_s = buffer.deviation_ns(time_ns) * 1e-9
            if late_s > self._longest_hole_s:
                counters.restarts += 1
                return "later"
            if late_s >= self._slow_clock_s:
                count = round(late_s * self._rate_hz)
                counters.samples_lost += count
                buffer.append_hole(count)
            elif late_s <= -self._slow_clock_s:
                overlap = round(-late_s * self._rate_hz)
                if buffer.fill_hole(samples, time_ns, after):
                    counters.samples_lost -= len(samples)
                    counters.samples += len(samples)
                    return "refused"
                if overlap >= len(samples):
                    counters.blocks_stale += 1
                    self.stale_blocks += 1
                    if self.stale_blocks < CHANNEL.restart_blocks:
                        return "refused"
                    counters.restarts += 1
                    return "earlier"
                samples = samples[overlap:]
                time_ns += ns_from_s(overlap / self._rate_hz)
        self.stale_blocks = 0
        counters.samples += len(samples)
        buffer.append(samples, time_ns)
        return "taken"

    def may_be_filled(self, upto: int) -> bool:
        """True if a gap before an index is so recent that its block may still arrive."""
        if not self.buffer.holes:
            return False
        low, high = self.buffer.holes[-1]
        patience = round(CHANNEL.reorder_s * self._rate_hz)
        # One block behind it may be longer than that, and be the one that overtook.
        young = self.buffer.end - high < patience or self.buffer.newest <= high
        return young and low < upto
