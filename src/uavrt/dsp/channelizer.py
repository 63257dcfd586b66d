"""Split a band into channels by a uniform DFT filter bank; unused channels are not computed.

``y_c[n] = sum_m h[m] x[H n - m] exp(-j 2 pi c (H n - m) / M)``: a tone at c times the channel
spacing lands on 0 Hz of channel c. With H = M (critically sampled) it is the original system's;
with H = M / 2 each channel is twice oversampled, so that no frequency is on an edge.

The sum is folded: with ``u = Q M - m`` the window of the last Q M samples is weighted by the
symmetric prototype, added up modulo M and Fourier transformed. The window starts at ``H n - Q
M``, so for H = M / 2 and odd n the transform comes out rotated by half its length, which is a
change of sign in odd channels.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import UsageError
from uavrt.core.runtime.native import kernels
from uavrt.dsp.decimator import Mode
from uavrt.dsp.filters import bank_taps, compatible_bank_taps

MATRIX_CHANNELS = 32
"""Maximum number of channels for which a DFT matrix is faster than an FFT (measured)."""

WINDOWS_PER_PASS = 8
"""Number of sample windows weighted in one pass; a longer inner loop saves a fifth of the
time."""

OUTPUTS_PER_PASS = 1024
"""Maximum number of output samples computed per pass; a block of the radio usually yields 655
or 327."""


class Channelizer:
    """Split a band into equally spaced channels.

    Parameters
    ----------
    channels : int
        Number of channels M over the whole band; even in the default mode.
    sample_rate_hz : float
        Rate of the band [Hz]; used for rates and `latency_s`.
    mode : {"default", "compatible"}
        Twice oversampled (channel rate 2 / M of the band's), or the original system's
        critically sampled bank (1 / M).
    in_use : sequence of int, optional
        Channels to compute, in this order; all by default.

    Raises
    ------
    UsageError
        No such channel, or an odd number of them in the default mode.
    """

    def __init__(
        self,
        *,
        channels: int = 100,
        sample_rate_hz: float = 375_000.0,
        mode: Mode = "default",
        in_use: Sequence[int] | None = None,
    ) -> None:
        if channels < 2 or (mode == "default" and channels % 2):
            raise UsageError(
                f"the number of channels {channels} is not supported",
                remedy="Use an even number of channels",
            )
        self.channels = channels
        self.mode: Mode = mode
        self.in_use = tuple(range(channels) if in_use is None else in_use)
        for channel in self.in_use:
            if not 0 <= channel < channels:
                raise UsageError(
                    f"channel {channel} does not exist", remedy=f"Use 0 to {channels - 1}"
                )
        self.hop = channels if mode == "compatible" else channels // 2
        self.sample_rate_hz = sample_rate_hz
        self.taps = (compatible_bank_taps if mode == "compatible" else bank_taps)(channels)
        self.delay_samples = self.taps.size / 2
        """Group delay of the channelizer [samples of the band]."""
        phases = self.taps.reshape(-1, channels)
        # Real weights for interleaved real and imaginary parts.
        self._pairs = weights = np.repeat(phases, 2, axis=1).astype(np.float32)
        self._weights = np.tile(weights, (1, WINDOWS_PER_PASS))
        self._window = self.taps.size
        self._all = self.in_use == tuple(range(channels))
        self._selection = np.array(self.in_use, dtype=np.intp)
        self._odd: NDArray[np.bool_] | slice = self._selection % 2 == 1
        if self._all:
            self._odd = slice(1, None, 2)
        self._matrix: NDArray[np.complex64] | None = None
        if len(self.in_use) <= MATRIX_CHANNELS:
            turns = np.outer(self._selection, np.arange(channels)) % channels / channels
            self._matrix = np.exp(-2j * np.pi * turns).astype(np.complex64)
        self._folded = np.empty((0, 2 * channels), dtype=np.float32)
        turns = np.arange(channels) / channels
        self._turns = np.exp(-2j * np.pi * turns).astype(np.complex64)
        self._chosen = self._selection.astype(np.int32)
        self._work = np.empty(0, dtype=np.float32)
        self.reset()

    @property
    def spacing_hz(self) -> float:
        """Distance of channel centres [Hz]."""
        return self.sample_rate_hz / self.channels

    @property
    def channel_rate_hz(self) -> float:
        """Sample rate of each channel [Hz]."""
        return self.sample_rate_hz / self.hop

    @property
    def latency_s(self) -> float:
        """Group delay of the filter [s]."""
        return self.delay_samples / self.sample_rate_hz

    def reset(self) -> None:
        """Clear all samples; the next input is sample 0 of the band again."""
        self._tail = np.zeros(self._window, dtype=np.complex64)
        self._odd_row = False

    def process(self, block: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Channelize consecutive samples.

        Parameters
        ----------
        block : (n,) complex64 array
            Samples, any number; the division of a stream into blocks changes no output.

        Returns
        -------
        (channels in use, m) complex64 array
            Output n of the stream is at sample H n of the band and appears once the H samples
            from there on have arrived: ``floor(total / H)`` outputs in all.
        """
        block = np.ascontiguousarray(block, dtype=np.complex64)
        if block.size >= OUTPUTS_PER_PASS * self.hop:
            parts = np.array_split(block, 1 + block.size // ((OUTPUTS_PER_PASS - 1) * self.hop))
            return np.concatenate([self.process(part) for part in parts], axis=1)
        tail, hop = self._tail, self.hop
        rows = max(0, (tail.size + block.size - self._window) // hop)
        # Outputs that need the tail of the previous block; the others read the block in place.
        head = min(rows, -(-tail.size // hop))
        pieces = []
        if head:
            need = (head - 1) * hop + self._window - tail.size
            pieces.append((0, head, np.concatenate((tail, block[:need]))))
        if rows > head:
            pieces.append((head, rows, block[head * hop - tail.size :]))
        out = self._outputs(rows, pieces)
        used = rows * hop - tail.size
        if used >= 0:
            self._tail = block[used:].copy()
        else:
            self._tail = np.concatenate((tail[used:], block))
        self._odd_row ^= bool(rows % 2)
        return out

    def _outputs(
        self, rows: int, pieces: list[tuple[int, int, NDArray[np.complex64]]]
    ) -> NDArray[np.complex64]:
        """Compute the samples of all channels in use, shape (channels in use, rows)."""
        native = kernels()
        if native is not None:
            out = np.empty((len(self.in_use), rows), np.complex64)
            if not self._work.size:
                self._work = np.empty(96 * self.channels, dtype=np.float32)
            for first, last, samples in pieces:
                odd = int(self._odd_row) + first
                native.bank(
                    *(samples, self._pairs, self._turns, self._chosen, self.channels),
                    *(self.hop, odd, last - first, out, first, self._work),
                )
            return out
        if not len(self._folded):
            self._folded = np.empty((OUTPUTS_PER_PASS, 2 * self.channels), dtype=np.float32)
        folded = self._folded[:rows]
        for first, last, samples in pieces:
            self._fold_rows(samples, folded[first:last])
        out = self._transform(folded.view(np.complex64))
        if self.hop != self.channels:
            # Odd rows of the whole stream, odd channels: half a turn (see the module's text).
            out[self._odd, 0 if self._odd_row else 1 :: 2] *= -1
        return out

    def _fold_rows(self, samples: NDArray[np.complex64], folded: NDArray[np.float32]) -> None:
        """Weight and fold samples, from the oldest that row 0 needs, into the
        rows of `folded`.
        """
        floats = samples.view(np.float32)
        group = WINDOWS_PER_PASS if self.hop == self.channels else 1
        grouped = len(folded) // group * group
        self._fold(floats, folded[:grouped], group)
        self._fold(floats[grouped * 2 * self.hop :], folded[grouped:], 1)

    def _fold(
        self, floats: NDArray[np.float32], folded: NDArray[np.float32], group: int
    ) -> None:
        """Weight the windows and add their samples modulo M, processing `group` windows as one
        long row.

        Consecutive windows can be joined if H = M, because they then begin M samples apart.
        """
        if len(folded) == 0:
            return
        width = group * 2 * self.channels
        # As in the decimator: not by `as_strided`.
        windows: NDArray[np.float32] = np.ndarray(
            (len(folded) // group, len(self._weights), width),
            np.float32,
            floats,
            strides=(8 * group * self.hop, 8 * self.channels, 4),
        )
        result = folded.reshape(-1, width)
        np.einsum("nqm,qm->nm", windows, self._weights[:, :width], out=result)

    def _transform(self, folded: NDArray[np.complex64]) -> NDArray[np.complex64]:
        if self._matrix is not None:
            product: NDArray[np.complex64] = self._matrix @ folded.T
            return product
        # Loads scipy.fft, 14 MB; only computers without the kernels need it.
        from uavrt.core.runtime.lean_scipy import fft

        # Transformed along columns, the result is (channels, outputs) without a transposition.
        spectrum: NDArray[np.complex64] = fft.fft(folded.T, axis=0)
        return spectrum if self._all else spectrum[self._selection]
