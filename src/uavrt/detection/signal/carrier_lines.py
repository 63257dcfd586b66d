"""Remove carriers from the samples before the search.

A window one pulse long has side lobes: a carrier 60 dB above the noise of a bin drowns a tag
100 Hz away though it never fools a row that knows its own noise. A carrier is told from pulses
by a transform 25 times as long, and subtracted with an amplitude that may change slowly
(modulation, drift), fitted by least squares.

A window function with low side lobes would cost a rectangular pulse 1.8 dB always (Hann). A tag
exactly on a carrier loses a part of its energy.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

LOOK_S = 0.55
"""Length of the transform that finds carriers: bins of 1.8 Hz."""
FIT_S = 0.3
"""Past that the fit of an amplitude takes in besides the new samples."""
_BLOCK_S = 0.004
_DEGREE = 7
"""Of the polynomial. Of a carrier of 60 dB with 30 % of 1.3 Hz degree 4 left 20 dB, degree 6
0.5 dB."""
_RATIO = 40.0
"""Power over the median of the bins around: noise reaches it once in 10^12 bins, pulses (50 Hz
wide) reach 4, a carrier does from about 0 dB in a bin of 50 Hz."""
_GROUP = 16
_MOST = 48
"""Carriers subtracted: mains hum has a line every 50 or 100 Hz of a channel."""
FEW_LINES = 6
_DEGREE_OF_MANY = 3
"""Of the weak ones when there are more than a few: 37 polynomials of degree 7 take a tenth of
the noise, and most of it where the newest samples end; 3 follows a line 1.5 Hz wide."""
_STRONG = 1e4
"""Power over the median around from which on a carrier is never weak: 25 dB in a bin."""
_HELD_LOOKS = 40
"""Looks (of up to 0.44 s) for which a carrier is subtracted after it was last found. A line of
hum fades for seconds; left in meanwhile, its return was a false group: 17 times as many as
asked for, with this 1.2 times (49 groups in 841 decisions at 5 %)."""


@dataclass(slots=True, kw_only=True)
class _Line:
    """A carrier, and for how many more looks we assume that it is there."""

    frequency_hz: float
    looks_left: int
    ratio: float
    """Its power over the median of the bins around."""


class LineCanceller:
    """Finds and subtracts the carriers of a channel."""

    def __init__(self, sample_rate_hz: float) -> None:
        self._rate = sample_rate_hz
        self._length = 1 << round(math.log2(LOOK_S * sample_rate_hz))
        self._window = _window(self._length)
        self._block = max(1, round(_BLOCK_S * sample_rate_hz))
        self._past: NDArray[np.complex64] | None = None
        """Newest samples as they were before carriers were taken out; None: as they are."""
        self._held: list[_Line] = []

    @property
    def frequencies_hz(self) -> list[float]:
        """Carriers being subtracted, relative to the channel's centre."""
        return [line.frequency_hz for line in self._held]

    @property
    def idle(self) -> bool:
        """Whether there is nothing to subtract, nor was in the last samples."""
        return not self._held and self._past is None

    @property
    def needed(self) -> int:
        """Samples before the new ones that `find` and `subtract` look at."""
        return max(self._length, round(FIT_S * self._rate))

    def find(self, before: NDArray[np.complex64], samples: NDArray[np.complex64]) -> None:
        """Look for carriers in the newest samples, this or the last calls'.

        `before`: what is kept of the samples before, in whatever state `subtract` left them.
        `samples` (n,): the new ones.
        """
        past = before if self._past is None else self._past
        newest = np.concatenate((past, samples))[-self._length :]
        if len(newest) < self._length:
            return
        spectrum = np.fft.fft(newest * self._window)
        power = spectrum.real**2 + spectrum.imag**2
        middle = _GROUP // 2
        floor = np.partition(power.reshape(-1, _GROUP), middle, axis=1)[:, middle]
        # Beside an edge of the noise the group on its louder side counts.
        floor = np.maximum(floor, np.maximum(np.roll(floor, 1), np.roll(floor, -1)))
        least = np.finfo(np.float32).tiny
        over = power > np.maximum(np.repeat(_RATIO * floor, _GROUP), least)
        for line in self._held:
            line.looks_left -= 1
        self._held = [line for line in self._held if line.looks_left > 0]
        if not over.any():
            return
        peaks = np.flatnonzero(
            over & (power >= np.roll(power, 1)) & (power > np.roll(power, -1))
        )
        found: list[float] = []
        bin_hz = self._rate / self._length
        for peak in peaks[np.argsort(-power[peaks])][: 2 * _MOST]:
            three = power[[peak - 1, peak, (peak + 1) % self._length]]
            below, at, above = np.log(np.maximum(three, least))
            shift = 0.5 * (below - above) / (below - 2.0 * at + above)
            index = peak - self._length if peak > self._length // 2 else peak
            frequency = float((index + shift) * bin_hz)
            if any(abs(frequency - other) <= 4.0 * bin_hz for other in found):
                continue
            ratio = float(power[peak] / max(floor[peak // _GROUP], np.float32(1e-30)))
            if self._hold(frequency, ratio, 2.0 * bin_hz, newest):
                found.append(frequency)

    def _hold(
        self,
        frequency_hz: float,
        ratio: float,
        within_hz: float,
        samples: NDArray[np.complex64],
    ) -> bool:
        """Continue with a carrier, or begin with one that is steady; whether it is one."""
        for line in self._held:
            if abs(line.frequency_hz - frequency_hz) <= within_hz:
                line.frequency_hz, line.ratio = frequency_hz, ratio
                line.looks_left = _HELD_LOOKS
                return True
        if len(self._held) >= _MOST or not self._steady(samples, frequency_hz):
            return False
        self._held.append(_Line(frequency_hz=frequency_hz, looks_left=_HELD_LOOKS, ratio=ratio))
        return True

    def _steady(self, samples: NDArray[np.complex64], frequency_hz: float) -> bool:
        """Whether there is as much of it in the middling 20 ms as on the average: no pulse."""
        length = round(0.02 * self._rate)
        count = len(samples) // length
        turn = np.exp((-2j * np.pi * frequency_hz / self._rate) * np.arange(count * length))
        sums = (samples[: count * length] * turn).reshape(count, length).sum(axis=1)
        powers = sums.real**2 + sums.imag**2
        return float(np.median(powers)) > 0.3 * float(powers.mean())

    def subtract(self, before: NDArray[np.complex64], samples: NDArray[np.complex64]) -> None:
        """Take the carriers out of new samples, in place.

        `before`: what is kept of the samples before.
        `samples` (n,): the samples that follow those of the last call.
        """
        if not self._held:
            self._past = None
            return
        past = before[-self.needed :] if self._past is None else self._past
        self._past = np.concatenate((past, samples))[-self.needed :]
        if not len(samples):
            return
        before = past[-round(FIT_S * self._rate) :]
        both = np.concatenate((before, samples))
        count = len(both) // self._block
        if count < 4 * _DEGREE:
            return
        spare = len(both) - count * self._block
        n = np.arange(len(both)) - len(both) / 2.0
        many = len(self._held) > FEW_LINES
        for line in sorted(self._held, key=lambda line: -line.ratio):
            degree = _DEGREE_OF_MANY if many and line.ratio < _STRONG else _DEGREE
            fine, solve = _polynomials(len(both), self._block, degree)
            turn = np.exp(2j * np.pi * line.frequency_hz / self._rate * n)
            still = (both * turn.conj())[spare:].reshape(count, self._block).mean(axis=1)
            # Not a product by BLAS: its threads take longer to wake than this does.
            wave = np.einsum("nd,d->n", fine, solve @ still) * turn
            both = both - wave
        samples[:] = both[len(before) :]


@lru_cache(maxsize=8)
def _window(length: int) -> NDArray[np.float32]:
    """Hann's window, one for all tags of a length: 16 kB."""
    return np.hanning(length).astype(np.float32)


@lru_cache(maxsize=8)
def _polynomials(
    length: int, block: int, degree: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Polynomials of an amplitude, and what fits them to the means of blocks.

    `block`: samples of a block; what is too few for one lies before the first.
    Returns (fine, solve): Legendre's over all samples, (length, degree + 1); least squares,
    (degree + 1, length // block).
    """
    n = np.arange(length) - length / 2.0
    fine = np.asarray(np.polynomial.legendre.legvander(2.0 * n / length, degree), np.float64)
    coarse = fine[length % block :].reshape(length // block, block, -1).mean(axis=1)
    return fine, np.linalg.pinv(coarse)
