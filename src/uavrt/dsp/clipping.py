"""Detect clipping of the receiver's converter: signals are then stronger than measured."""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from uavrt.core.messages import IQBlock
from uavrt.core.units import NANOSECONDS_PER_SECOND

CLIPPED_AMPLITUDE = 0.99
"""Amplitude from which a sample counts as clipped [full scales]; the largest 8-bit value is
0.992."""
COMPUTED_AMPLITUDE = 2.0
"""Amplitude above which samples must be computed and not received [full scales]; a radio's
filters do not reach it."""
_STRETCH_S = 0.5e-3
"""Length of the pieces into which samples are divided to search for clipping [s]; a 15 ms pulse
has thirty pieces."""
_MOST_SAMPLES = 64
"""Number of samples examined in each piece; a clipping tone clips at least a quarter of
them."""
_PULSE_SHARE = 0.2
"""Share of a pulse's pieces that must contain clipped samples for the pulse to count as
clipped; an impulse clips only one piece."""
MOST_UNREAD = 1000
"""Maximum number of clipped pieces kept until read, enough for half a second or more."""
_KEEP_NS = 20 * NANOSECONDS_PER_SECOND
"""Duration for which clipped pieces are kept [ns]; pulses are reported within it."""


class ClippedTimes:
    """Times of clipped samples in the last 20 seconds."""

    def __init__(self) -> None:
        self._stretches: deque[tuple[int, int]] = deque()
        """Begin and end of each clipped piece of samples [ns, UTC], in order of time."""

    def add(self, stretches_ns: Sequence[tuple[int, int]]) -> None:
        """Add the begin and end times of further clipped pieces [ns, UTC], in order of time."""
        self._stretches.extend(stretches_ns)
        while self._stretches and self._stretches[0][1] < self._stretches[-1][1] - _KEEP_NS:
            self._stretches.popleft()

    def covers(self, start_ns: int, end_ns: int) -> bool:
        """True if more than a fifth of a pulse between two times [ns, UTC] was clipped."""
        inside_ns = sum(
            max(0, min(last_ns, end_ns) - max(first_ns, start_ns))
            for first_ns, last_ns in self._stretches
        )
        return inside_ns > _PULSE_SHARE * (end_ns - start_ns)


class Clipping:
    """Finds samples at the limits of the radio's converter.

    At high sample rates it examines 64 samples in each half millisecond.
    """

    def __init__(self) -> None:
        self.examined_s = 0.0
        self.clipped_s = 0.0
        """Total duration of pieces with clipped samples [s], in steps of half a millisecond."""
        self.times = ClippedTimes()
        self._new: list[tuple[int, int]] = []
        self._has_full_scale = True

    @property
    def share(self) -> float:
        """Share of the examined time with clipped samples."""
        return self.clipped_s / self.examined_s if self.examined_s else 0.0

    def check(self, block: IQBlock) -> None:
        """Search a block of the radio's samples for clipped samples."""
        rate_hz = block.sample_rate_hz
        length = max(1, math.ceil(_STRETCH_S * rate_hz))
        count = len(block.samples) // length
        self.examined_s += len(block.samples) / rate_hz
        if not count:
            return
        some = block.samples[: count * length].view(np.float32).reshape(count, 2 * length)
        some = some[:, : 2 * min(length, _MOST_SAMPLES)]
        if self._has_full_scale and float(some.max()) > COMPUTED_AMPLITUDE:
            self._has_full_scale, self.clipped_s = False, 0.0
            self.times, self._new = ClippedTimes(), []
        if not self._has_full_scale:
            return
        at_limit = (some.max(axis=1) >= CLIPPED_AMPLITUDE) | (
            some.min(axis=1) <= -CLIPPED_AMPLITUDE
        )
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
        self._new = (self._new + new)[-MOST_UNREAD:]

    def take_new(self) -> tuple[tuple[int, int], ...]:
        """Return the times (begin, end) of clipped pieces since the last call [ns, UTC]."""
        new, self._new = tuple(self._new), []
        return new
