"""The time-frequency grid of the search: a spectrogram of windows one pulse long.

Reference/detector.md §4.1–4.2: for a rectangular pulse the matched filter bank is the
discrete-time Fourier transform of each window. The original's hop is half a pulse and its rows
half a bin apart, which costs 1.0 dB; here the hop is an eighth of a pulse and the rows a
quarter of a bin apart, in seconds and hertz whatever the sample rate.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

HOPS_PER_PULSE = 8
ROWS_PER_BIN = 4
_FRAMES_PER_CHUNK = 512


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Windows and rows of one tag's spectrogram.

    Attributes
    ----------
    sample_rate_hz : float
        Rate of the samples.
    window : int
        Length of a window: the samples of one pulse.
    hop : int
        Samples between two windows.
    offsets_hz : ndarray of float64, shape (rows,)
        Row frequencies relative to the centre of the channel.
    matrix : ndarray of complex64, shape (window, rows)
        The transform, scaled so that the output noise power is the input's per sample.
    """

    sample_rate_hz: float
    window: int
    hop: int
    offsets_hz: NDArray[np.float64]
    matrix: NDArray[np.complex64]

    @property
    def hop_s(self) -> float:
        """Time between two columns [s]."""
        return self.hop / self.sample_rate_hz

    @property
    def rows(self) -> int:
        """Number of frequencies."""
        return len(self.offsets_hz)

    def columns(self, samples: int) -> int:
        """How many whole windows fit into so many samples."""
        return max(0, (samples - self.window) // self.hop + 1)

    def power(self, samples: NDArray[np.complex64]) -> NDArray[np.float32]:
        """Power of every cell.

        Parameters
        ----------
        samples : ndarray of complex64, shape (n,)
            Contiguous samples; column m starts at sample m × hop.

        Returns
        -------
        ndarray of float32, shape (columns(n), rows)
            Squared magnitude of the matched filter; in noise its mean is the noise power of
            one sample, for a pulse it is that times ENR + 1.
        """
        count = self.columns(len(samples))
        result = np.empty((count, self.rows), np.float32)
        step = samples.strides[0]
        for first in range(0, count, _FRAMES_PER_CHUNK):
            last = min(first + _FRAMES_PER_CHUNK, count)
            frames = as_strided(
                samples[first * self.hop :],
                (last - first, self.window),
                (self.hop * step, step),
                writeable=False,
            )
            parts = (np.ascontiguousarray(frames) @ self.matrix).view(np.float32)
            np.multiply(parts, parts, out=parts)
            np.add(parts[:, 0::2], parts[:, 1::2], out=result[first:last])
        return result


def make_grid(
    *,
    sample_rate_hz: float,
    pulse_width_s: float,
    offset_hz: float,
    half_width_hz: float,
) -> Grid:
    """Lay the grid around one tag.

    Parameters
    ----------
    sample_rate_hz : float
        Rate of the channel's samples.
    pulse_width_s : float
        Length of a pulse.
    offset_hz : float
        Middle of the search relative to the centre of the channel.
    half_width_hz : float
        Half-width of the search; infinite or large: the whole channel.
    """
    window = max(4, round(pulse_width_s * sample_rate_hz))
    hop = max(1, round(pulse_width_s * sample_rate_hz / HOPS_PER_PULSE))
    step_hz = sample_rate_hz / window / ROWS_PER_BIN
    nyquist_hz = sample_rate_hz / 2.0
    if half_width_hz >= nyquist_hz:
        # The band is a circle: a whole number of rows, none of them twice.
        count = round(sample_rate_hz / step_hz)
        offsets = (np.arange(count) - (count - 1) // 2) * (sample_rate_hz / count)
    else:
        reach = math.ceil(half_width_hz / step_hz)
        offsets = offset_hz + np.arange(-reach, reach + 1) * step_hz
        offsets = offsets[np.abs(offsets) <= nyquist_hz]
    n = np.arange(window)[:, np.newaxis]
    phase = -2j * np.pi * n * (offsets / sample_rate_hz)[np.newaxis, :]
    matrix = (np.exp(phase) / math.sqrt(window)).astype(np.complex64)
    return Grid(
        sample_rate_hz=sample_rate_hz,
        window=window,
        hop=hop,
        offsets_hz=offsets.astype(np.float64),
        matrix=np.ascontiguousarray(matrix),
    )


def sliding_maximum(power: NDArray[np.float32], reach: int) -> NDArray[np.float32]:
    """Maximum over ± `reach` columns, for columns where all of these exist.

    Parameters
    ----------
    power : ndarray of float32, shape (columns, rows)
    reach : int
        Columns looked at on each side.

    Returns
    -------
    ndarray of float32, shape (columns - 2 * reach, rows)
        By doubling: the work grows with the logarithm of `reach`.
    """
    width = 2 * reach + 1
    covered = 1
    result = power
    while covered < width:
        shift = min(covered, width - covered)
        result = np.maximum(result[:-shift], result[shift:])
        covered += shift
    return result
