"""Compute the power of all frequencies of a band in short windows."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from uavrt.core.runtime.native import kernels
from uavrt.detection.beeps.tuning import POINTS
from uavrt.dsp.plan import fast_length


class BandSpectrogram:
    """Computes a spectrogram with Hann windows for a range of frequencies in a band."""

    def __init__(self, *, sample_rate_hz: float, low_hz: float, high_hz: float) -> None:
        self.length = max(16, round(POINTS.window_s * sample_rate_hz))
        """Number of samples in a window of the transform."""
        self.hop = max(4, round(POINTS.hop_s * sample_rate_hz))
        """Number of samples from the start of one transform window to the next."""
        self._size = fast_length(self.length)
        self.step_hz = sample_rate_hz / self._size
        """Distance between the spectrogram's frequency bins [Hz]."""
        half = self._size // 2
        self._first = max(-half, int(np.ceil(low_hz / self.step_hz)))
        last = min(self._size - half - 1, int(np.floor(high_hz / self.step_hz)))
        self.bins = max(last - self._first + 1, 1)
        """Number of frequency bins of the spectrogram that are computed."""
        self.low_hz = self._first * self.step_hz
        """Lowest computed frequency, relative to the band's centre [Hz]."""
        self._taper = np.hanning(self.length + 2)[1:-1].astype(np.float32)
        self._twiddles = np.exp(-2j * np.pi / self._size * np.arange(self._size)).astype(
            np.complex64
        )
        # The kernel transforms lengths without prime factors above 5.
        self._kernel = (2 * 3 * 5) ** self._size.bit_length() % self._size == 0
        self._work = np.empty(0, np.complex64)

    def powers(self, samples: NDArray[np.complex64], out: NDArray[np.float32]) -> None:
        """Compute the power in as many windows as `out` (windows, bins) has rows.

        The windows begin at the first of the `samples`, `hop` apart.
        """
        native = kernels() if self._kernel else None
        work = 8 * (self._size + 1) if native else self._size * POINTS.least_frames
        if self._work.size != work:  # kept: new memory would take as long as the transforms
            self._work = np.empty(work, np.complex64)
        if native is not None:
            first = self._first % self._size
            work_parts, taper = self._work.view(np.float32), self._taper
            native.spectrogram(
                samples, self.hop, taper, self._twiddles, first, self.bins, work_parts, out
            )
            return
        # Loads scipy.fft, 14 MB; only computers without the kernels need it.
        from uavrt.core.runtime.lean_scipy import fft

        windows = sliding_window_view(samples, self.length)[:: self.hop]
        for begin in range(0, len(out), POINTS.least_frames):
            power = out[begin : begin + POINTS.least_frames]
            framed = self._work.reshape(-1, self._size)[: len(power)]
            framed[:, self.length :] = 0.0
            np.multiply(
                windows[begin : begin + len(power)], self._taper, out=framed[:, : self.length]
            )
            spectrum = fft.fft(framed, axis=1, overwrite_x=True)
            negative = min(max(0, -self._first), self.bins)
            for target, source in (
                (power[:, :negative], spectrum[:, self._first + self._size :]),
                (power[:, negative:], spectrum[:, max(0, self._first) :]),
            ):
                part = source[:, : target.shape[1]]
                np.multiply(part.real, part.real, out=target)
                target += part.imag**2
