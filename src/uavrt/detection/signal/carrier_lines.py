"""Remove carriers from the samples before the search.

A window one pulse long has side lobes: a carrier 60 dB above the noise of a bin hides a tag 100
Hz away even if each row has its own noise estimate. A transform 25 times as long as a pulse
finds carriers. They are subtracted with slowly varying amplitudes (modulation, drift), fitted
jointly by least squares. A window function with low side lobes would always cost a rectangular
pulse 1.8 dB (Hann). A tag exactly on a carrier loses a part of its energy.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

LOOK_S = 0.55
"""Length of the transform that finds carriers: bins of 1.8 Hz."""
FIT_S = 0.3
"""Duration of the past included in the fit of an amplitude."""
_BLOCK_S = 0.004
_DEGREE = 7
"""Degree of the amplitude's polynomial. Of a carrier of 60 dB with 30 % of 1.3 Hz degree 4 left
20 dB, degree 6 0.5 dB."""
_RATIO = 40.0
"""Threshold over the median of the bins around: noise reaches it in one of 10^12 bins, pulses
(50 Hz wide) reach 4, a carrier does from about 0 dB in a bin of 50 Hz."""
_GROUP = 16
_FLOOR_BIN = 4
_FLOOR_SCALE = 2.0
"""Bin of a group, in order of power, that measures its noise, and the median over it. An idle
transmitter's frame of 60 ms has a line every 16.7 Hz, which takes half of the bins."""
_MOST = 240
"""Most carriers subtracted: mains hum has a line every 50 or 100 Hz of a channel, frames of
60 ms one every 16.7 Hz."""
FEW_LINES = 6
_DEGREE_OF_MANY = 3
"""Degree for weak carriers when there are many: 37 polynomials of degree 7 take a tenth of the
noise, most of it at the newest samples; 3 follows a line 1.5 Hz wide."""
_DEGREE_OF_MOST = 1
"""Degree for weak carriers above `_MANY` lines: those of an idle transmitter are steady."""
_MANY = 100
_MOST_STEPS = 10
_LEFT = 0.02
"""Largest residual power of the carriers, as a share of the noise's."""
_STRONG_RATIO = 1e4
"""Least power of a strong carrier over the median around it: 25 dB in a bin."""
_HELD_LOOKS = 40
"""Calls (of up to 0.44 s) for which a carrier is subtracted after it was last found. A line of
hum fades for seconds; without this, its return gave 17 times the nominal false groups, with it
1.2 times (49 groups in 841 decisions at 5 %)."""


class LineCanceller:
    """Finds and subtracts the carriers of a channel."""

    def __init__(self, sample_rate_hz: float) -> None:
        self._rate = sample_rate_hz
        self._length = 1 << round(math.log2(LOOK_S * sample_rate_hz))
        self._window = _window(self._length)
        self._block = max(1, round(_BLOCK_S * sample_rate_hz))
        self._past: NDArray[np.complex64] | None = None
        """Newest samples before carriers were removed; None: unchanged."""
        self.frequencies_hz = np.zeros(0)
        """(lines,) carriers being subtracted, relative to the channel's centre."""
        self._ratios = np.zeros(0)
        """Power of each over the median of the bins around."""
        self._looks_left = np.zeros(0, np.intp)
        """Remaining calls for which each is subtracted if it is not found again."""

    @property
    def idle(self) -> bool:
        """True if there is nothing to subtract, nor was in the last samples."""
        return not self.frequencies_hz.size and self._past is None

    @property
    def needed(self) -> int:
        """Number of samples before the new ones that `find` and `subtract` need."""
        return max(self._length, round(FIT_S * self._rate))

    def find(self, before: NDArray[np.complex64], samples: NDArray[np.complex64]) -> None:
        """Find carriers in the newest samples, of this or the last calls.

        `before`: earlier samples that are kept, in the state in which `subtract` left them.
        """
        past = before if self._past is None else self._past
        newest = np.concatenate((past, samples))[-self._length :]
        if len(newest) < self._length:
            return
        spectrum = np.fft.fft(newest * self._window)
        power = spectrum.real**2 + spectrum.imag**2
        floor = np.partition(power.reshape(-1, _GROUP), _FLOOR_BIN, axis=1)[:, _FLOOR_BIN]
        floor *= _FLOOR_SCALE
        # Near an edge of the noise the group on its louder side counts.
        floor = np.maximum(floor, np.maximum(np.roll(floor, 1), np.roll(floor, -1)))
        least = np.finfo(np.float32).tiny
        over = power > np.maximum(np.repeat(_RATIO * floor, _GROUP), least)
        self._looks_left -= 1
        self._keep(self._looks_left > 0)
        if not over.any():
            return
        peaks = np.flatnonzero(
            over & (power >= np.roll(power, 1)) & (power > np.roll(power, -1))
        )
        peaks = peaks[np.argsort(-power[peaks])][: 2 * _MOST]
        three = (peaks + np.array([[-1], [0], [1]])) % self._length
        below, at, above = np.log(np.maximum(power[three], least))
        shift = 0.5 * (below - above) / (below - 2.0 * at + above)
        signed = np.where(peaks > self._length // 2, peaks - self._length, peaks)
        bin_hz = self._rate / self._length
        frequencies = (signed + shift) * bin_hz
        ratios = power[peaks] / np.maximum(floor[peaks // _GROUP], np.float32(1e-30))
        apart = np.abs(frequencies[:, np.newaxis] - frequencies)
        flank = np.tril(apart <= 4.0 * bin_hz, -1).any(axis=1)
        self._hold(frequencies[~flank], ratios[~flank], 2.0 * bin_hz, newest)

    def _hold(
        self,
        frequencies: NDArray[np.float64],
        ratios: NDArray[np.float32],
        within_hz: float,
        samples: NDArray[np.complex64],
    ) -> None:
        """Continue with held carriers, and add steady ones; strongest first."""
        apart = np.abs(frequencies[:, np.newaxis] - self.frequencies_hz)
        near = apart <= within_hz
        found, line = np.nonzero(near)
        self.frequencies_hz[line], self._ratios[line] = frequencies[found], ratios[found]
        self._looks_left[line] = _HELD_LOOKS
        room = _MOST - self.frequencies_hz.size
        others = np.flatnonzero(~near.any(axis=1))
        if not room or not others.size:
            return
        new = others[self._steady(samples, frequencies[others])][:room]
        self.frequencies_hz = np.concatenate((self.frequencies_hz, frequencies[new]))
        self._ratios = np.concatenate((self._ratios, ratios[new]))
        self._looks_left = np.concatenate((self._looks_left, np.full(new.size, _HELD_LOOKS)))

    def _keep(self, kept: NDArray[np.bool_]) -> None:
        if not kept.all():
            self.frequencies_hz, self._ratios = self.frequencies_hz[kept], self._ratios[kept]
            self._looks_left = self._looks_left[kept]

    def _steady(
        self, samples: NDArray[np.complex64], frequencies: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """True where the median of 20 ms pieces equals the average: not so for pulses."""
        length = round(0.02 * self._rate)
        pieces = samples[: len(samples) // length * length].reshape(-1, length)
        turns = np.exp((-2j * np.pi / self._rate) * np.outer(np.arange(length), frequencies))
        sums = pieces @ turns.astype(np.complex64)
        powers = sums.real**2 + sums.imag**2
        return np.asarray(np.median(powers, axis=0) > 0.3 * powers.mean(axis=0))

    def subtract(self, before: NDArray[np.complex64], samples: NDArray[np.complex64]) -> None:
        """Remove the carriers from new samples, in place.

        `before`: earlier samples that are kept. `samples` (n,): those that follow the last
        call's.
        """
        if not self.frequencies_hz.size:
            self._past = None
            return
        past = before[-self.needed :] if self._past is None else self._past
        self._past = np.concatenate((past, samples))[-self.needed :]
        if not len(samples):
            return
        before = past[-round(FIT_S * self._rate) :]
        both = np.concatenate((before, samples))
        block = self._block
        count = len(both) // block
        if count < 4 * _DEGREE:
            return
        rest = both[len(both) - count * block :].reshape(count, block)
        many = len(self._ratios) > FEW_LINES
        weak = _DEGREE_OF_MOST if len(self._ratios) > _MANY else _DEGREE_OF_MANY
        degrees = np.where(many & (self._ratios < _STRONG_RATIO), weak, _DEGREE)
        lines = _Waves(self.frequencies_hz, degrees, self._rate, count, block)
        cleaned = lines.removed(rest).ravel()[-len(samples) :]
        samples[len(samples) - len(cleaned) :] = cleaned


class _Waves:
    """Waves at given frequencies whose amplitudes follow polynomials.

    All waves are fitted together, since neighbours share a part of their power, by the method
    of conjugate gradients: its cost is that of a few products of small matrices. Within a block
    an amplitude is linear.
    """

    def __init__(
        self,
        frequencies_hz: NDArray[np.float64],
        degrees: NDArray[np.intp],
        rate_hz: float,
        count: int,
        block: int,
    ) -> None:
        turn = 2j * np.pi / rate_hz * frequencies_hz
        place = np.arange(block)[:, np.newaxis] - 0.5 * (block - 1)
        within = np.exp(turn * place) / math.sqrt(block)
        self._within = np.concatenate((within, within * place / block), axis=1)
        self._within = self._within.astype(np.complex64)
        middles = np.exp(turn * (block * np.arange(count)[:, np.newaxis]))
        self._middles = np.tile(middles.astype(np.complex64), 2)
        most = int(degrees.max())
        self._values, self._changes = _polynomials(count, most)
        self._used = np.arange(most + 1)[:, np.newaxis] <= degrees

    def _sum(self, weights: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Sum the waves: weights (polynomials, waves) to samples (count, block)."""
        levels = np.concatenate((self._values @ weights, self._changes @ weights), axis=1)
        return np.asarray((levels * self._middles) @ self._within.T)

    def _shares(self, samples: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Project samples on each wave separately; the adjoint of `_sum`."""
        levels = (samples @ self._within.conj()) * self._middles.conj()
        half = levels.shape[1] // 2
        shares = self._values.T @ levels[:, :half] + self._changes.T @ levels[:, half:]
        return np.asarray(shares * self._used)

    def removed(self, samples: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Return samples (count, block) without the waves."""
        rest = samples
        shares = direction = self._shares(rest)
        power = _power(shares)
        for _ in range(_MOST_STEPS):
            wave = self._sum(direction)
            step = power / max(_power(wave), 1e-30)
            rest = rest - np.float32(step) * wave
            shares = self._shares(rest)
            before, power = power, _power(shares)
            if power <= _LEFT * self._used.sum() * _power(rest) / rest.size:
                break
            direction = shares + np.float32(power / before) * direction
        return rest


def _power(values: NDArray[np.complex64]) -> float:
    return float((values.real**2 + values.imag**2).sum())


@lru_cache(maxsize=8)
def _window(length: int) -> NDArray[np.float32]:
    """Hann's window, cached for all tags of a length: 16 kB."""
    return np.hanning(length).astype(np.float32)


@lru_cache(maxsize=8)
def _polynomials(count: int, degree: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Make orthonormal polynomials over a number of blocks.

    Returns (values, changes), both (count, degree + 1): at the blocks' centres, and the change
    from block to block.
    """
    at = (2.0 * np.arange(count) + 1.0) / count - 1.0
    legendre = np.polynomial.legendre
    values, mixed = np.linalg.qr(legendre.legvander(at, degree))
    slopes = legendre.legval(at, legendre.legder(np.eye(degree + 1))).T
    changes = slopes @ np.linalg.inv(mixed) * (2.0 / count)
    return values.astype(np.float32), changes.astype(np.float32)
