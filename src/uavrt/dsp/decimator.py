"""Decimation by a small integer: one matrix product over overlapping blocks.

``y[n] = sum_k h[k] x[D n - k]``. Eight outputs need a common stretch of ``7 D + L`` inputs; a
few hundred such stretches are copied under each other (im2col) and multiplied by one matrix
that holds the taps eight times, each shifted by D. Interleaved real and imaginary parts make
half of that matrix zero; a BLAS is fast enough to pay for it (reference/perf.md §2a).
"""

from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from uavrt.dsp.filters import compatible_decimator_taps, decimator_taps
from uavrt.errors import UsageError

Mode = Literal["default", "compatible"]

ROWS = 512
"""Stretches per matrix product: 512 × 274 floats fill half of a 1 MiB L2 cache."""


class Decimator:
    """Low-pass filter and keep every D-th sample.

    Parameters
    ----------
    factor : int
        Decimation factor D, 2 to 64.
    sample_rate_hz : float
        Input rate [Hz]; used for `latency_s` only.
    mode : {"default", "compatible"}
        Filter: aliases 60 dB down in the clean span, or csdr's 81 taps (`uavrt.dsp.filters`).
    taps : (n,) array, optional
        Another filter, in place of the mode's.

    Raises
    ------
    UsageError
        The factor is out of range.
    """

    def __init__(
        self,
        *,
        factor: int = 8,
        sample_rate_hz: float = 3_000_000.0,
        mode: Mode = "default",
        taps: NDArray[np.float64] | None = None,
    ) -> None:
        if not 2 <= factor <= 64:
            raise UsageError(f"decimation factor {factor}", remedy="Use 2 to 64")
        if taps is None:
            design = compatible_decimator_taps if mode == "compatible" else decimator_taps
            taps = design(factor)
        self.factor = factor
        self.taps = taps
        self.sample_rate_hz = sample_rate_hz
        self.delay_samples = (taps.size - 1) / 2
        """Group delay in input samples."""
        self._group = max(1, 64 // factor)
        self._matrix = _shifted_taps(taps, factor, self._group)
        self._scratch = np.empty((ROWS, self._matrix.shape[0]), dtype=np.float32)
        self.reset()

    @property
    def latency_s(self) -> float:
        """Group delay of the filter [s]."""
        return self.delay_samples / self.sample_rate_hz

    def reset(self) -> None:
        """Forget all samples; the next output is ``y[0]``, at the next input sample."""
        self._tail = np.zeros(self.taps.size - 1, dtype=np.complex64)

    def process(self, block: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Filter and decimate consecutive samples.

        Parameters
        ----------
        block : (n,) complex64 array
            Any length; how a stream is cut changes nothing.

        Returns
        -------
        (m,) complex64 array
            All outputs up to the last input; output n of the stream stands at input D n.
        """
        block = np.ascontiguousarray(block, dtype=np.complex64)
        length, factor, tail = self.taps.size, self.factor, self._tail
        count = max(0, (tail.size + block.size - length) // factor + 1)
        out = np.empty(count, dtype=np.complex64)
        # Outputs that need the tail of the block before; the rest reads the block in place.
        head = min(count, -(-tail.size // factor))
        if head:
            need = (head - 1) * factor + length - tail.size
            self._filter(np.concatenate((tail, block[:need])), out[:head])
        if count > head:
            self._filter(block[head * factor - tail.size :], out[head:])
        used = count * factor - tail.size
        if used >= 0:
            self._tail = block[used:].copy()
        else:
            self._tail = np.concatenate((tail[used:], block))
        return out

    def _filter(self, samples: NDArray[np.complex64], out: NDArray[np.complex64]) -> None:
        """Fill `out` from `samples`, whose first is the oldest that ``out[0]`` needs."""
        group, width = self._group, self._matrix.shape[0]
        rows = out.size // group
        floats = samples.view(np.float32)
        stretches = as_strided(floats, (rows, width), (8 * group * self.factor, 4))
        result = out.view(np.float32)[: 2 * group * rows].reshape(rows, 2 * group)
        for start in range(0, rows, ROWS):
            stop = min(start + ROWS, rows)
            # NumPy hands no overlapping view to the BLAS, so the copy is ours, in cache.
            scratch = self._scratch[: stop - start]
            np.copyto(scratch, stretches[start:stop])
            np.matmul(scratch, self._matrix, out=result[start:stop])
        rest = out.size - rows * group
        if rest:
            first = 2 * rows * group * self.factor
            need = 2 * ((rest - 1) * self.factor + self.taps.size)
            row = floats[first : first + need]
            out.view(np.float32)[2 * rows * group :] = row @ self._matrix[:need, : 2 * rest]


def _shifted_taps(taps: NDArray[np.float64], factor: int, group: int) -> NDArray[np.float32]:
    """Matrix from interleaved inputs to `group` interleaved outputs."""
    width = (group - 1) * factor + taps.size
    matrix = np.zeros((width, 2, group, 2), dtype=np.float32)
    for output in range(group):
        span = slice(output * factor, output * factor + taps.size)
        for part in (0, 1):
            # Oldest sample first, hence the taps backwards.
            matrix[span, part, output, part] = taps[::-1]
    return matrix.reshape(2 * width, 2 * group)
