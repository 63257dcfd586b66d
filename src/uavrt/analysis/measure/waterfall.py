"""Compute a spectrogram of a recording of any length, in a fixed amount of memory.

Each column contains the *largest* power within its time. In a picture of one hour, a column is
3.5 s and a pulse 20 ms, so a mean would show the pulse 22 dB weaker. When all columns are used,
neighbouring pairs are joined, so that at least half of the columns are in use at the end.

The longer a column, the stronger its largest noise. So the colour scale begins at the median of
the cells: the picture shows contrast, not absolute levels.
"""

from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from uavrt.core.messages import ChannelBlock
from uavrt.core.units import NANOSECONDS_PER_SECOND

COLUMNS: Final = 1024
"""Number of spectrogram columns, about as many as a picture has pixels across."""
TRACE_POINTS: Final = 1 << 21
"""Maximum number of points in a level trace (5.8 h of 20 ms pulses); beyond it, neighbouring
points are joined."""

_MOST_OFF: Final = 0.75
"""Time error above which spectra are aligned again with the block times [half pulse widths]."""


class MaximumHold:
    """Maxima of spectra in a fixed number of columns; pairs are joined when all are full."""

    def __init__(self, rows: int, columns: int) -> None:
        self._values = np.zeros((columns, rows), dtype=np.float32)
        self.frames_per_column = 1
        self._end = 0

    @property
    def values(self) -> NDArray[np.float32]:
        """Largest values, shape (used columns, rows); zero where there were no samples."""
        return self._values[: -(-self._end // self.frames_per_column)]

    def put(self, first: int, frames: NDArray[np.float32]) -> None:
        """Add consecutive spectra (n, rows) from index `first`; skipped columns remain zero."""
        if not len(frames):
            return
        self._end = max(self._end, first + len(frames))
        while self._end > self.frames_per_column * len(self._values):
            half = np.maximum(self._values[::2], self._values[1::2])
            self._values[: len(half)] = half
            self._values[len(half) :] = 0.0
            self.frames_per_column *= 2
        column = (first + np.arange(len(frames))) // self.frames_per_column
        np.maximum.at(self._values, column, frames)


class Waterfall:
    """Spectrogram around one tag's frequency, and the strongest level at each time.

    `pulse_width_s` sets the length of the Hann window to one and a half pulses, so that it
    covers a whole pulse.
    """

    def __init__(
        self,
        *,
        offset_hz: float,
        half_width_hz: float,
        sample_rate_hz: float,
        pulse_width_s: float,
    ) -> None:
        self._rate_hz = sample_rate_hz
        length = max(8, round(1.5 * pulse_width_s * sample_rate_hz))
        self._hop = max(1, round(0.5 * pulse_width_s * sample_rate_hz))
        self._window = (np.hanning(length + 2)[1:-1]).astype(np.float32)
        # White noise of power density N gives each bin the power N.
        self._window /= np.sqrt((self._window**2).sum() * sample_rate_hz)
        self._size = int(scipy.fft.next_fast_len(2 * length))
        half_width_hz = min(half_width_hz, sample_rate_hz / 2)
        frequencies = scipy.fft.fftfreq(self._size, 1.0 / sample_rate_hz)
        inside = np.flatnonzero(np.abs(frequencies - offset_hz) <= half_width_hz)
        self._bins = inside[np.argsort(frequencies[inside])]
        self.frequencies_hz: NDArray[np.float64] = frequencies[self._bins] - offset_hz
        """(rows,) frequencies of the rows, ascending, relative to the tag's [Hz]."""
        self._hold = MaximumHold(self._bins.size, COLUMNS)
        self._trace = MaximumHold(1, TRACE_POINTS)
        self._tail = np.zeros(0, np.complex64)
        self._next_index: int | None = None
        self._frame = 0
        self.start_time_ns = 0
        """Time of the picture's left edge [ns, UTC]."""

    def add(self, block: ChannelBlock) -> None:
        """Add the next block of the channel."""
        if self._next_index is None:
            self._next_index, self.start_time_ns = block.sample_index, block.time_ns
        since_s = (block.time_ns - self.start_time_ns) / NANOSECONDS_PER_SECOND
        since, samples = round(since_s * self._rate_hz), block.samples
        if block.sample_index != self._next_index:
            # After a gap the frames restart, on their old grid.
            self._tail = self._tail[:0]
            self._frame = max(0, -(-since // self._hop))
            samples = samples[self._frame * self._hop - since :]
        else:
            # A crystal that is off, or a clock that was corrected, moves them on it.
            due = (since - len(self._tail)) / self._hop
            if abs(due - self._frame) > _MOST_OFF and due > -1.0:
                self._frame = max(0, round(due))
        self._next_index = block.sample_index + len(block.samples)
        self._take(samples)

    @property
    def column_s(self) -> float:
        """Duration of a spectrogram column [s]."""
        return self._hold.frames_per_column * self._hop / self._rate_hz

    @property
    def power(self) -> NDArray[np.float32]:
        """Largest power density in each cell, (columns, rows); 0 where samples are missing."""
        return self._hold.values

    @property
    def trace(self) -> NDArray[np.float32]:
        """Largest power density over frequency at each time, (points,); 0 without samples."""
        return self._trace.values[:, 0]

    @property
    def trace_s(self) -> float:
        """Time between two points of `trace` [s]."""
        return self._trace.frames_per_column * self._hop / self._rate_hz

    @property
    def frame_center_s(self) -> float:
        """Time from the start of a spectrum's samples to their middle [s]."""
        return self._window.size / 2 / self._rate_hz

    def _take(self, samples: NDArray[np.complex64]) -> None:
        data = np.concatenate((self._tail, samples))
        length, hop = self._window.size, self._hop
        frames = (data.size - length) // hop + 1 if data.size >= length else 0
        # Blocks of any size in bounded memory.
        for first in range(0, frames, 256):
            count = min(256, frames - first)
            at = (first + np.arange(count)[:, None]) * hop + np.arange(length)
            spectrum = scipy.fft.fft(data[at] * self._window, self._size, axis=1)
            power = np.abs(spectrum[:, self._bins]).astype(np.float32) ** 2
            self._hold.put(self._frame, power)
            self._trace.put(self._frame, power.max(axis=1, keepdims=True))
            self._frame += count
        self._tail = data[frames * hop :].copy()
