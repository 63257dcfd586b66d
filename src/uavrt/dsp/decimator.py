"""Decimation by a small integer: one matrix product per few hundred blocks of samples.

``y[n] = sum_k h[k] x[D n - k]``. The input is cut, without copying, into blocks of ``P = R D``
samples, the rows of a matrix. A block contributes to the R outputs that start in it and to the
E that start before it and reach into it. A product with an (R + E, P) matrix of shifted taps
gives all these parts. Each block's parts are added to those of the blocks after it, which gives
the outputs (overlap-add). This rounds a little differently from a plain sum: up to 3e-7 of the
largest sample.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import UsageError
from uavrt.core.runtime.native import kernels
from uavrt.dsp.filters import compatible_decimator_taps, decimator_taps

Mode = Literal["default", "compatible"]

PASS_SAMPLES = 270_000
"""Maximum number of samples per matrix product. A block of 262 144 samples fits into one
product; smaller products are slower."""

DIRECT_OUTPUTS = 1024
"""Maximum number of outputs that a direct sum computes per pass, which limits its memory."""


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
    ) -> None:
        if not 2 <= factor <= 64:
            raise UsageError(
                f"the decimation factor {factor} is not supported", remedy="Use 2 to 64"
            )
        design = compatible_decimator_taps if mode == "compatible" else decimator_taps
        taps = design(factor)
        self.factor = factor
        self.taps = taps
        self.sample_rate_hz = sample_rate_hz
        self.delay_samples = (taps.size - 1) / 2
        """Group delay of the decimation filter [input samples]."""
        # Oldest sample first, hence the reversed taps.
        self._weights = np.ascontiguousarray(taps[::-1], dtype=np.complex64)
        # Number of outputs that start in a block: more of them give more idle taps, fewer give
        # more additions. At least 5 outputs and 40 samples were fastest.
        self._starts = max(5, -(-40 // factor))
        self._matrix = _shifted_taps(self._weights, factor, self._starts)
        # Number of later blocks that an output depends on.
        self._reach = -(-((taps.size - 1) // factor) // self._starts)
        self._pass = max(128, PASS_SAMPLES // (self._starts * factor))
        self._parts = np.empty((0, self._matrix.shape[1]), dtype=np.complex64)
        self._pairs = np.repeat(taps[::-1], 2).astype(np.float32)
        self.reset()

    @property
    def latency_s(self) -> float:
        """Group delay of the filter [s]."""
        return self.delay_samples / self.sample_rate_hz

    def reset(self) -> None:
        """Clear the filter's memory; the next sample becomes sample 0 and yields ``y[0]``."""
        self._tail = np.zeros(self.taps.size - 1, dtype=np.complex64)

    def process(self, block: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Filter and decimate consecutive samples.

        Parameters
        ----------
        block : (n,) complex64 array
            Samples, any number; the division of a stream into blocks changes no output.

        Returns
        -------
        (m,) complex64 array
            All outputs up to the last input; output n of the stream is at input D n.
        """
        block = np.ascontiguousarray(block, dtype=np.complex64)
        length, factor, tail = self.taps.size, self.factor, self._tail
        count = max(0, (tail.size + block.size - length) // factor + 1)
        out = np.empty(count, dtype=np.complex64)
        # Outputs that need the tail of the previous block; the others read the block in place.
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
        """Filter samples, from the oldest that ``out[0]`` needs, into `out`."""
        native = kernels()
        if native is not None:
            native.decimate(samples, self._pairs, self.factor, out)
            return
        if not len(self._parts):
            self._parts = np.empty((self._pass, self._matrix.shape[1]), dtype=np.complex64)
        starts, size = self._starts, self._starts * self.factor
        blocks, width, reach = samples.size // size, self._matrix.shape[1], self._reach
        groups = max(0, min(blocks - reach, out.size // starts))
        rows = samples[: blocks * size].reshape(blocks, size)
        grouped = out[: groups * starts].reshape(groups, starts)
        for first in range(0, groups, self._pass - reach):
            sums = grouped[first : first + self._pass - reach]
            count = len(sums)
            parts = self._parts[: count + reach]
            np.matmul(rows[first : first + count + reach], self._matrix, out=parts)
            np.copyto(sums, parts[:count, width - starts :])
            for later in range(1, reach + 1):
                # Contribution of a block to the outputs that started `later` blocks before.
                begin = width - starts * (later + 1)
                part = parts[later : later + count, max(begin, 0) : begin + starts]
                target = sums[:, max(-begin, 0) :]
                np.add(target, part, out=target)
        self._filter_directly(samples[groups * size :], out[groups * starts :])

    def _filter_directly(
        self, samples: NDArray[np.complex64], out: NDArray[np.complex64]
    ) -> None:
        """Compute `out` by direct sums, for the few outputs at the ends of a block."""
        length = self._weights.size
        for first in range(0, out.size, DIRECT_OUTPUTS):
            some = out[first : first + DIRECT_OUTPUTS]
            stretch = samples[first * self.factor :]
            shape, strides = (some.size, length), (8 * self.factor, 8)
            # The constructor takes a sixth of `as_strided`'s time and leaves no garbage: the
            # dictionary names of `as_strided` pass through Python's table of interned strings,
            # 40 times a second, until it is rebuilt, with 0.5 MB more.
            windows: NDArray[np.complex64] = np.ndarray(
                shape, np.complex64, stretch, strides=strides
            )
            # NumPy passes no overlapping view to the BLAS, hence the copy.
            np.matmul(np.ascontiguousarray(windows), self._weights, out=some)


def _shifted_taps(
    weights: NDArray[np.complex64], factor: int, starts: int
) -> NDArray[np.complex64]:
    """Return the matrix that converts a block of samples to its contributions to all outputs
    that it affects.

    Leading zero columns make the number of columns a multiple of 4, which is 10 % faster in the
    BLAS for D = 8.
    """
    outputs = (weights.size - 1) // factor + starts
    matrix = np.zeros((starts * factor, -(-outputs // 4) * 4), dtype=np.complex64)
    for column in range(1, outputs + 1):
        # The last column is the last output that starts in the block.
        begin = factor * (starts - column)
        low, high = max(begin, 0), min(begin + weights.size, matrix.shape[0])
        matrix[low:high, -column] = weights[low - begin : high - begin]
    return matrix
