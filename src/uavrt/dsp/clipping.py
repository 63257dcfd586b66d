"""Find where the receiver's converter clipped: signals there are stronger than they look."""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from uavrt.messages import IQBlock
from uavrt.units import NANOSECONDS_PER_SECOND

LIMIT = 0.99
"""Of full scale, which is 1 in every format: the last code of 8 bits is 0.992."""
_BEYOND = 2.0
"""Of full scale: samples beyond are of a source that has none (made by a computer). A radio's
own filters pass it by a few tenths."""
_STRETCH_S = 0.5e-3
"""What is looked at together: a pulse of 15 ms has thirty."""
_LEAST_SAMPLES = 64
"""Looked at of each stretch; a tone at the limits is there for one sample in four and more."""
_PULSE_SHARE = 0.2
"""Of a pulse's stretches; an impulse at the limits makes no pulse stronger."""
MOST_NEW = 1000
"""Stretches that are kept until they are taken: half a second at the least."""
_KEEP_NS = 20 * NANOSECONDS_PER_SECOND
"""Pulses are told no later than this."""


class ClippedTimes:
    """When samples were at the limits, for the last seconds."""

    def __init__(self) -> None:
        self._stretches: deque[tuple[int, int]] = deque()
        """Begin and end of those [ns], in order."""

    def add(self, stretches_ns: Sequence[tuple[int, int]]) -> None:
        """Add begin and end of further stretches, in order, none twice."""
        self._stretches.extend(stretches_ns)
        while self._stretches and self._stretches[0][1] < self._stretches[-1][1] - _KEEP_NS:
            self._stretches.popleft()

    def covers(self, start_ns: int, end_ns: int) -> bool:
        """Whether samples of a pulse between two times were at the limits."""
        inside_ns = sum(
            max(0, min(last_ns, end_ns) - max(first_ns, start_ns))
            for first_ns, last_ns in self._stretches
        )
        return inside_ns > _PULSE_SHARE * (end_ns - start_ns)


class Clipping:
    """Looks at the samples of a radio for those at the limits of its converter.

    Of fast radios not every sample is looked at, but of each half a millisecond 64.
    """

    def __init__(self) -> None:
        self.looked_s = 0.0
        self.clipped_s = 0.0
        """Time with samples at the limits, in steps of half a millisecond."""
        self.times = ClippedTimes()
        self._new: list[tuple[int, int]] = []
        self._has_full_scale = True

    @property
    def share(self) -> float:
        """Of all time that in which samples were at the limits."""
        return self.clipped_s / self.looked_s if self.looked_s else 0.0

    def look(self, block: IQBlock) -> None:
        """Look at a block of the radio's samples."""
        rate_hz = block.sample_rate_hz
        length = max(1, math.ceil(_STRETCH_S * rate_hz))
        count = len(block.samples) // length
        self.looked_s += len(block.samples) / rate_hz
        if not count:
            return
        some = block.samples[: count * length].view(np.float32).reshape(count, 2 * length)
        some = some[:, : 2 * min(length, _LEAST_SAMPLES)]
        if self._has_full_scale and float(some.max()) > _BEYOND:
            self._has_full_scale, self.clipped_s = False, 0.0
            self.times, self._new = ClippedTimes(), []
        if not self._has_full_scale:
            return
        at_limit = (some.max(axis=1) >= LIMIT) | (some.min(axis=1) <= -LIMIT)
        if not at_limit.any():
            return
        self.clipped_s += int(np.count_nonzero(at_limit)) * length / rate_hz
        ns_per_stretch = length / rate_hz * NANOSECONDS_PER_SECOND
        edges = np.flatnonzero(np.diff(at_limit, prepend=False, append=False)).tolist()
        new = [
            (
                block.time_ns + round(first * ns_per_stretch),
                block.time_ns + round(last * ns_per_stretch),
            )
            for first, last in zip(edges[::2], edges[1::2], strict=True)
        ]
        self.times.add(new)
        self._new = (self._new + new)[-MOST_NEW:]

    def take_new(self) -> tuple[tuple[int, int], ...]:
        """Take begin and end [ns] of the stretches found since the last call, in order."""
        new, self._new = tuple(self._new), []
        return new
