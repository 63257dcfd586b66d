"""The time-frequency grid of the search: a spectrogram of windows one pulse long.

Reference/detector.md §4.1–4.2: for a rectangular pulse the matched filter bank is the
discrete-time Fourier transform of each window. The original's hop is half a pulse and its rows
half a bin apart, which costs 1.0 dB; here the hop is an eighth of a pulse and the rows a
quarter of a bin apart, in seconds and hertz whatever the sample rate.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

HOPS_PER_PULSE = 8
ROWS_PER_BIN = 4
_SINGLE_THREAD_PRODUCT = 200_000
"""Matrix products up to this size stay on one thread in OpenBLAS (its limit is 262 144): two
threads that wake for 50 us of work cost 50 times as much."""
_DECIMATED_WINDOW = 24
"""Least samples of a pulse after decimation: below, the hop gets too coarse."""
_OUTPUTS_PER_ROW = 8
_STOPBAND_DB = 55.0


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Windows and rows of one tag's spectrogram.

    Attributes
    ----------
    sample_rate_hz : float
        Rate of the channel's samples.
    window, hop : int
        Length of a window and step between two, in the channel's samples.
    decimation : int
        Channel samples for each sample of the narrow band that the search works on.
    reach : int
        Channel samples that the band's filter looks to each side.
    offsets_hz : ndarray of float64, shape (rows,)
        Row frequencies relative to the centre of the channel.
    toeplitz : ndarray of complex64, shape (samples, outputs), or None
        Several outputs of the filter as one matrix product.
    matrix : ndarray of complex64, shape (window / decimation, rows)
        The transform, scaled so that the output noise power is the channel's per sample.
    """

    sample_rate_hz: float
    window: int
    hop: int
    decimation: int
    reach: int
    offsets_hz: NDArray[np.float64]
    toeplitz: NDArray[np.complex64] | None
    matrix: NDArray[np.complex64]

    @property
    def hop_s(self) -> float:
        """Time between two columns [s]."""
        return self.hop / self.sample_rate_hz

    @property
    def rows(self) -> int:
        """Number of frequencies."""
        return len(self.offsets_hz)

    def start(self, column: float) -> float:
        """Channel sample at which a column's window starts."""
        return column * self.hop - (self.decimation - 1) / 2.0

    def power(self, samples: NDArray[np.complex64]) -> NDArray[np.float32]:
        """Power of every cell.

        Parameters
        ----------
        samples : ndarray of complex64, shape (n,)
            Contiguous samples of the narrow band (of the channel without decimation).

        Returns
        -------
        ndarray of float32, shape (columns, rows)
            Squared magnitude of the matched filter; in noise its mean is the noise power of
            one channel sample, for a pulse it is that times ENR + 1.
        """
        length, hop = len(self.matrix), self.hop // self.decimation
        count = max(0, (len(samples) - length) // hop + 1)
        result = np.empty((count, self.rows), np.float32)
        chunk = max(1, _SINGLE_THREAD_PRODUCT // self.matrix.size)
        for first in range(0, count, chunk):
            last = min(first + chunk, count)
            frames = _windows(samples, first * hop, (last - first, length), hop)
            parts = (np.ascontiguousarray(frames) @ self.matrix).view(np.float32)
            np.multiply(parts, parts, out=parts)
            np.add(parts[:, 0::2], parts[:, 1::2], out=result[first:last])
        return result


class Spectrogram:
    """Columns of a stream of channel samples, each once.

    Parameters
    ----------
    grid : Grid
    """

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._band = np.zeros(0, np.complex64)
        self.consumed = 0
        """Narrow-band samples made so far."""

    def needed(self) -> int:
        """Index of the first channel sample that the next call looks at; may be negative."""
        return self.consumed * self._grid.decimation - self._grid.reach

    def push(self, samples: NDArray[np.complex64]) -> NDArray[np.float32]:
        """Take channel samples from index `needed` on; the new columns, (columns, rows)."""
        grid = self._grid
        band = self._decimate(samples)
        self.consumed += len(band)
        block = np.concatenate((self._band, band)) if len(self._band) else band
        power = grid.power(block)
        self._band = block[len(power) * (grid.hop // grid.decimation) :].copy()
        return power

    def _decimate(self, samples: NDArray[np.complex64]) -> NDArray[np.complex64]:
        grid = self._grid
        if grid.toeplitz is None:
            return samples.copy()
        length, outputs = grid.toeplitz.shape
        stride = outputs * grid.decimation
        count = max(0, (len(samples) - length) // stride + 1)
        band = np.empty((count, outputs), np.complex64)
        chunk = max(1, _SINGLE_THREAD_PRODUCT // grid.toeplitz.size)
        for first in range(0, count, chunk):
            last = min(first + chunk, count)
            pieces = _windows(samples, first * stride, (last - first, length), stride)
            np.matmul(np.ascontiguousarray(pieces), grid.toeplitz, out=band[first:last])
        return band.ravel()


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
    nyquist_hz = sample_rate_hz / 2.0
    samples = pulse_width_s * sample_rate_hz
    circular = half_width_hz >= nyquist_hz
    decimation = 1
    if not circular:
        decimation = int(
            min(sample_rate_hz / (2.5 * half_width_hz), samples / _DECIMATED_WINDOW)
        )
        decimation = max(1, decimation)
    length = max(4, round(samples / decimation))
    hop = max(1, round(samples / decimation / HOPS_PER_PULSE))
    step_hz = sample_rate_hz / (length * decimation) / ROWS_PER_BIN
    if circular:
        # The band is a circle: a whole number of rows, none of them twice.
        count = round(sample_rate_hz / step_hz)
        offsets = (np.arange(count) - (count - 1) // 2) * (sample_rate_hz / count)
    else:
        reach = math.ceil(half_width_hz / step_hz)
        offsets = offset_hz + np.arange(-reach, reach + 1) * step_hz
        offsets = offsets[np.abs(offsets) <= nyquist_hz]
    toeplitz, side = None, 0
    if decimation > 1:
        taps = _band_filter(
            sample_rate_hz=sample_rate_hz,
            decimation=decimation,
            offset_hz=offset_hz,
            pass_hz=half_width_hz + 0.5 / pulse_width_s,
        )
        side = len(taps) // 2
        toeplitz = np.zeros(
            ((_OUTPUTS_PER_ROW - 1) * decimation + len(taps), _OUTPUTS_PER_ROW), np.complex64
        )
        for output in range(_OUTPUTS_PER_ROW):
            toeplitz[output * decimation : output * decimation + len(taps), output] = taps
    n = (np.arange(length) * decimation)[:, np.newaxis]
    phase = -2j * np.pi * n * (offsets / sample_rate_hz)[np.newaxis, :]
    scale = decimation / math.sqrt(length * decimation)
    return Grid(
        sample_rate_hz=sample_rate_hz,
        window=length * decimation,
        hop=hop * decimation,
        decimation=decimation,
        reach=side,
        offsets_hz=offsets.astype(np.float64),
        toeplitz=toeplitz,
        matrix=np.ascontiguousarray((np.exp(phase) * scale).astype(np.complex64)),
    )


def _band_filter(
    *, sample_rate_hz: float, decimation: int, offset_hz: float, pass_hz: float
) -> NDArray[np.complex128]:
    """Band-pass around the tag whose aliases fall outside ± `pass_hz`, shape (odd,).

    Kaiser window by Kaiser's formulas. The samples stay at their frequency (folded by the
    decimation); the rows of the transform are folded alike, so nothing is mixed.
    """
    stop_hz = sample_rate_hz / decimation - pass_hz
    width = max(stop_hz - pass_hz, 0.02 * sample_rate_hz / decimation) / sample_rate_hz
    side = math.ceil((_STOPBAND_DB - 7.95) / (2.285 * 2.0 * math.pi * width) / 2.0)
    n = np.arange(-side, side + 1)
    cutoff = 1.0 / decimation
    beta = 0.1102 * (_STOPBAND_DB - 8.7)
    taps = cutoff * np.sinc(cutoff * n) * np.kaiser(len(n), beta)
    taps /= taps.sum()
    # The samples are correlated with these taps, not convolved: hence the sign.
    return np.asarray(taps * np.exp(-2j * np.pi * offset_hz / sample_rate_hz * n))


def _windows(
    samples: NDArray[np.complex64], first: int, shape: tuple[int, int], step: int
) -> NDArray[np.complex64]:
    """Overlapping windows of contiguous samples, without a copy.

    The constructor is much faster than `numpy.lib.stride_tricks.as_strided`, and checks that
    the windows lie inside the buffer.
    """
    size = samples.itemsize
    return np.ndarray(shape, np.complex64, samples, first * size, (step * size, size))


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
