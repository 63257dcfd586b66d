"""The time-frequency grid of the search: a spectrogram of windows one pulse long.

For a rectangular pulse, the bank of matched filters is the discrete-time Fourier transform of
each window. At any sample rate, windows begin an eighth of a pulse apart, and rows are a
quarter of a bin apart. Hops of half a pulse and rows half a bin apart, as in the original
detector, cost 1 dB.

The frequency of some tags slides during each pulse. Their windows are first multiplied by the
opposite slide (`slide_turns`), which does not change white noise. The row of such a pulse is
that of its frequency at half its length.

The columns of a row are contiguous in memory, because about fifty of them are read for each
anchor.
"""

import cmath
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavrt.core.runtime.native import kernels
from uavrt.detection.search.tuning import GRID

HOPS_PER_PULSE = 8
"""Number of spectrogram columns per pulse width."""
ROWS_PER_BIN = 4
"""Number of spectrogram rows per frequency bin; a bin is the inverse of the pulse width."""
OUTPUTS_PER_ROW = 8
"""Number of narrow-band samples in one row of the filter's matrix product."""


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Windows and rows of one tag's spectrogram.

    `window`, `hop`: length of a window and step between two [channel samples].
    `decimation`: channel samples for each sample of the narrow band that the search works on.
    `reach`: channel samples that the narrow band's filter needs on each side.
    `offsets_hz` (rows,): row frequencies from the centre of the channel [Hz].
    `filter` (samples, outputs): several outputs of that filter as one matrix product.
    `length`: narrow-band samples of a window.
    `matrix` (length, rows): the transform; in noise its output has the power of one sample.
    `halves`: `half_transforms`, instead of the matrix, where rows lie symmetrically around the
    tag and the narrow band was shifted to put the tag at zero.
    `turn_hz`: frequency by which the narrow band is shifted down after the filter [Hz].
    `slide_hz`: change of the tag's frequency during a pulse [Hz].
    `turns` (window,): `slide_turns` of the slide; None if the frequency is constant.
    `pairs`: the filter for the compiled kernel. The first array has the real and imaginary
    parts of its taps, each twice, as float32 (2, 2 × taps), filled up to a multiple of eight
    taps. The second has the phase of each output of a row against the first, as complex64.
    """

    sample_rate_hz: float
    window: int
    hop: int
    decimation: int
    reach: int
    offsets_hz: NDArray[np.float64]
    filter: NDArray[np.complex64] | None
    length: int
    matrix: NDArray[np.complex64] | None
    halves: tuple[NDArray[np.float32], NDArray[np.float32]] | None
    turn_hz: float
    slide_hz: float
    turns: NDArray[np.complex64] | None
    pairs: tuple[NDArray[np.float32], NDArray[np.complex64]] | None

    @property
    def hop_s(self) -> float:
        """Time between two spectrogram columns [s]."""
        return self.hop / self.sample_rate_hz

    @property
    def rows(self) -> int:
        """Number of frequencies of the grid."""
        return len(self.offsets_hz)

    def start(self, column: float) -> float:
        """Index of the channel sample at which a column's window starts."""
        return column * self.hop - (self.decimation - 1) / 2.0

    def column(self, start: float) -> float:
        """Column with a window that starts at a channel sample; the inverse of `start`."""
        return (start + (self.decimation - 1) / 2.0) / self.hop

    def power(self, samples: NDArray[np.complex64]) -> NDArray[np.float32]:
        """Power of all cells in the columns that the `samples` contain, (columns, rows).

        In noise the mean power is that of one channel sample. With a pulse it is ENR + 1 times
        as much.
        """
        hop = self.hop // self.decimation
        count = max(0, (len(samples) - self.length) // hop + 1)
        result = np.empty((self.rows, count), np.float32)
        native = kernels() if self.length <= GRID.kernel_window else None
        if self.halves is not None and native is not None:
            work = np.empty(2 * hop * (count + self.length // hop + 32), np.float32)
            native.powers(samples, hop, self.length, *self.halves, result, 0, count, work)
        elif self.halves is not None:
            self._power_by_halves(samples, result)
        elif self.matrix is not None:
            chunk = max(1, GRID.blas_product // self.matrix.size)
            for first in range(0, count, chunk):
                last = min(first + chunk, count)
                frames = _windows(samples, first * hop, (last - first, self.length), hop)
                product = self.matrix.T @ np.ascontiguousarray(frames).T
                some = result[:, first:last]
                np.multiply(product.real, product.real, out=some)
                some += product.imag * product.imag
        return result.T

    def _power_by_halves(
        self, samples: NDArray[np.complex64], result: NDArray[np.float32]
    ) -> None:
        """Write the power of rows at ± f together, with a quarter of the multiplications, all
        real.

        Around a window's middle, let e(n) = x(n) + x(-n) and o(n) = x(n) - x(-n). The transform
        at ± f is A ∓ jB, with A the sum of e cos and B that of o sin.
        """
        assert self.halves is not None
        cosines, sines = self.halves
        hop, half, length = self.hop // self.decimation, self.length // 2, self.length
        parts = np.stack((samples.real, samples.imag))
        middle, total = self.rows // 2, len(samples)
        chunk = max(1, GRID.blas_product // cosines.size)
        for first in range(0, result.shape[1], chunk):
            power = result[:, first : first + chunk]
            frames = np.ndarray(
                (2, length, power.shape[1]),
                np.float32,
                parts,
                4 * first * hop,
                (4 * total, 4, 4 * hop),
            )
            late, early = frames[:, length - half :], frames[:, half - 1 :: -1]
            even = np.concatenate((late + early, frames[:, half : length - half]), axis=1)
            a, b = np.matmul(cosines, even), np.matmul(sines, late - early)
            # Write the power last: strided rows are slow, all other accesses are contiguous.
            power[middle::-1] = (a[0] - b[1]) ** 2 + (a[1] + b[0]) ** 2
            power[middle:] = (a[0] + b[1]) ** 2 + (a[1] - b[0]) ** 2


class Spectrogram:
    """Computes the spectrogram of a stream of channel samples, each column once."""

    def __init__(self, grid: Grid) -> None:
        self.grid = grid
        self.band = np.zeros(0, np.complex64)
        """Narrow-band samples from the start of the next spectrogram column on."""
        self.consumed = 0
        """Number of narrow-band samples that the band's filter has made since the start."""
        self._turns = np.zeros((0, 1), np.complex64)

    @property
    def begun(self) -> int:
        """Number of columns computed so far, which is the number of the next column."""
        return (self.consumed - len(self.band)) * self.grid.decimation // self.grid.hop

    def needed(self) -> int:
        """Index of the first channel sample that the next call needs; may be negative."""
        return self.consumed * self.grid.decimation - self.grid.reach

    def push(self, samples: NDArray[np.complex64]) -> NDArray[np.float32]:
        """Add channel samples from index `needed` on; return new columns (columns, rows)."""
        grid = self.grid
        block = self.lengthened(samples)
        power = grid.power(block)
        self.band = block[len(power) * (grid.hop // grid.decimation) :].copy()
        return power

    def lengthened(self, samples: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Decimate new channel samples; append them to the unused narrow-band samples."""
        grid, native = self.grid, kernels()
        if native is None or grid.filter is None or grid.pairs is None:
            return np.concatenate((self.band, self.decimate(samples)))
        length, outputs = grid.filter.shape
        count = max(0, (len(samples) - length) // (outputs * grid.decimation) + 1)
        carried, new = len(self.band), count * outputs
        block = np.empty(carried + new, np.complex64)
        block[:carried] = self.band
        turned = self._turned(self.consumed // outputs, count)
        taps, turn = grid.pairs
        used = length - (outputs - 1) * grid.decimation
        native.narrow(samples, taps, used, grid.decimation, turned, turn, block, carried)
        self.consumed += new
        return block

    def decimate(self, samples: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Filter and decimate channel samples, in whole rows of `OUTPUTS_PER_ROW` outputs."""
        grid = self.grid
        if grid.filter is None:
            self.consumed += len(samples)
            return samples
        length, outputs = grid.filter.shape
        stride = outputs * grid.decimation
        count = max(0, (len(samples) - length) // stride + 1)
        band = np.empty((count, outputs), np.complex64)
        chunk = max(1, GRID.blas_product // grid.filter.size)
        for first in range(0, count, chunk):
            last = min(first + chunk, count)
            pieces = _windows(samples, first * stride, (last - first, length), stride)
            np.matmul(np.ascontiguousarray(pieces), grid.filter, out=band[first:last])
        if grid.turn_hz:
            band *= self._turned(self.consumed // outputs, count)
        self.consumed += band.size
        return band.reshape(-1)

    def _turned(self, row: int, count: int) -> NDArray[np.complex64]:
        """Phase factors (count, 1) that shift the tag to 0 Hz, one per `OUTPUTS_PER_ROW`."""
        grid = self.grid
        turns = grid.turn_hz * OUTPUTS_PER_ROW * grid.decimation / grid.sample_rate_hz
        if count > len(self._turns):
            phases = np.modf(np.arange(count) * turns)[0]
            self._turns = np.exp(-2j * np.pi * phases).astype(np.complex64)[:, np.newaxis]
        start = np.complex64(cmath.exp(-2j * math.pi * math.modf(row * turns)[0]))
        return np.asarray(self._turns[:count] * start)


def make_grid(
    *,
    sample_rate_hz: float,
    pulse_width_s: float,
    offset_hz: float,
    half_width_hz: float,
    slide_hz: float = 0.0,
) -> Grid:
    """Create the grid around one tag; an infinite `half_width_hz` means the whole channel.

    `slide_hz`: change of the tag's frequency during a pulse [Hz].
    """
    nyquist_hz = sample_rate_hz / 2.0
    samples = pulse_width_s * sample_rate_hz
    circular = half_width_hz >= nyquist_hz
    decimation = 1
    if not circular:
        reach_hz = half_width_hz + 0.5 * abs(slide_hz)
        decimation = int(min(sample_rate_hz / (2.5 * reach_hz), samples / GRID.least_window))
        decimation = max(1, decimation)
    length = max(4, round(samples / decimation))
    hop = max(1, round(samples / decimation / HOPS_PER_PULSE))
    step_hz = sample_rate_hz / (length * decimation) / ROWS_PER_BIN
    if circular:
        # The band is circular: use a whole number of rows, without repetition.
        count = round(sample_rate_hz / step_hz)
        offsets = (np.arange(count) - (count - 1) // 2) * (sample_rate_hz / count)
    else:
        reach = math.ceil(half_width_hz / step_hz)
        offsets = offset_hz + np.arange(-reach, reach + 1) * step_hz
        offsets = offsets[np.abs(offsets) <= nyquist_hz]
    bank, side, pairs = None, 0, None
    if decimation > 1:
        taps = _band_filter(
            sample_rate_hz=sample_rate_hz,
            decimation=decimation,
            offset_hz=offset_hz,
            pass_hz=reach_hz + 0.5 / pulse_width_s,
        )
        side = len(taps) // 2
        bank = np.zeros(
            ((OUTPUTS_PER_ROW - 1) * decimation + len(taps), OUTPUTS_PER_ROW), np.complex64
        )
        for output in range(OUTPUTS_PER_ROW):
            bank[output * decimation : output * decimation + len(taps), output] = taps
        padded = np.concatenate((taps, np.zeros(-len(taps) % 8)))  # whole vectors
        parts = np.stack((padded.real, padded.imag)).repeat(2, axis=1).astype(np.float32)
        pairs = (parts, np.ones(OUTPUTS_PER_ROW, np.complex64))
    scale = decimation / math.sqrt(length * decimation)
    symmetric = bank is not None and len(offsets) == 2 * reach + 1 and not slide_hz
    matrix, halves = None, None
    if bank is not None and symmetric:
        shift = 2.0 * math.pi * offset_hz * decimation / sample_rate_hz
        turn = np.exp(-1j * shift * np.arange(OUTPUTS_PER_ROW)).astype(np.complex64)
        bank *= turn
        assert pairs is not None
        pairs = (pairs[0], turn)
        halves = half_transforms(length, reach + 1, scale)
    else:
        n = (np.arange(length) * decimation)[:, np.newaxis]
        phase = -2j * np.pi * n * (offsets / sample_rate_hz)[np.newaxis, :]
        turns = slide_turns(length, sample_rate_hz / decimation, slide_hz)[:, np.newaxis]
        matrix = np.ascontiguousarray((np.exp(phase) * turns * scale).astype(np.complex64))
    whole = slide_turns(length * decimation, sample_rate_hz, slide_hz)
    return Grid(
        sample_rate_hz=sample_rate_hz,
        window=length * decimation,
        hop=hop * decimation,
        decimation=decimation,
        reach=side,
        offsets_hz=offsets.astype(np.float64),
        filter=bank,
        length=length,
        matrix=matrix,
        halves=halves,
        turn_hz=offset_hz if symmetric else 0.0,
        slide_hz=slide_hz,
        turns=whole.astype(np.complex64) if slide_hz else None,
        pairs=pairs,
    )


def slide_turns(length: int, rate_hz: float, slide_hz: float) -> NDArray[np.complex128]:
    """Factors (length,) that make the frequency of a sliding pulse constant, at its middle's.

    The frequency changes evenly by `slide_hz` during the pulse, of `length` samples.
    """
    away = (np.arange(length) - (length - 1) / 2.0) / length
    return np.asarray(np.exp(-1j * np.pi * slide_hz * (length / rate_hz) * away**2))


@lru_cache(maxsize=32)
def half_transforms(
    length: int, rows: int, scale: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Cosines and sines of the rows from the tag's frequency up, shared by all tags.

    Returns cosines (rows, length - length // 2), for the pairs of samples from the middle
    outwards, an odd window's middle last; and sines (rows, length // 2).
    """
    half = length // 2
    away = np.arange(half) + (1.0 if length % 2 else 0.5)
    frequency = np.arange(rows) / (ROWS_PER_BIN * length)
    phase = 2.0 * np.pi * frequency[:, np.newaxis] * away[np.newaxis, :]
    cosines, sines = scale * np.cos(phase), scale * np.sin(phase)
    if length % 2:
        cosines = np.concatenate((cosines, np.full((rows, 1), scale)), axis=1)
    return cosines.astype(np.float32), sines.astype(np.float32)


def _band_filter(
    *, sample_rate_hz: float, decimation: int, offset_hz: float, pass_hz: float
) -> NDArray[np.complex128]:
    """Taps (an odd number) of a band-pass around the tag; aliases are outside ± `pass_hz`.

    Kaiser window by Kaiser's formulas. The samples stay at their frequency, folded by the
    decimation; the rows of the transform are folded alike.
    """
    stop_hz = sample_rate_hz / decimation - pass_hz
    width = max(stop_hz - pass_hz, 0.02 * sample_rate_hz / decimation) / sample_rate_hz
    side = math.ceil((GRID.stopband_db - 7.95) / (2.285 * 2.0 * math.pi * width) / 2.0)
    n = np.arange(-side, side + 1)
    cutoff = 1.0 / decimation
    beta = 0.1102 * (GRID.stopband_db - 8.7)
    taps = cutoff * np.sinc(cutoff * n) * np.kaiser(len(n), beta)
    taps /= taps.sum()
    # The samples are correlated with these taps, not convolved: hence the sign.
    return np.asarray(taps * np.exp(-2j * np.pi * offset_hz / sample_rate_hz * n))


def _windows(
    samples: NDArray[np.complex64], first: int, shape: tuple[int, int], step: int
) -> NDArray[np.complex64]:
    """View of overlapping windows of contiguous samples, without a copy.

    Much faster than `numpy.lib.stride_tricks.as_strided`, and checks that they fit the buffer.
    """
    size = samples.itemsize
    return np.ndarray(shape, np.complex64, samples, first * size, (step * size, size))


def sliding_maximum(power: NDArray[np.float32], reach: int) -> NDArray[np.float32]:
    """Maximum over `reach` columns on each side; the result lacks `reach` columns
    at each end.
    """
    columns, rows = power.shape
    side_by_side = power.T.flags.c_contiguous
    # As one long row: values that cross into the next row are cut off with the margins.
    result = power.T.reshape(-1) if side_by_side else power
    width = 2 * reach + 1
    covered = 1
    while covered < width:
        shift = min(covered, width - covered)
        result = np.maximum(result[:-shift], result[shift:])
        covered += shift
    if not side_by_side:
        return result
    shape = (columns - 2 * reach, rows)
    return np.ndarray(shape, np.float32, result, 0, (4, 4 * columns))
