"""Remove carriers from the samples before the search.

In windows one pulse long, the side lobes of a 60 dB carrier hide a tag 100 Hz away. Carriers
are found in a transform 25 times as long. They are subtracted with slowly varying amplitudes,
which are fitted jointly by least squares. A tag exactly on a carrier loses part of its energy.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.signal.tuning import CARRIERS


class LineCanceller:
    """Finds and subtracts the carriers of a channel."""

    def __init__(self, sample_rate_hz: float) -> None:
        self._rate = sample_rate_hz
        self._length = 1 << round(math.log2(CARRIERS.transform_s * sample_rate_hz))
        self._window = _window(self._length)
        self._block = max(1, round(CARRIERS.block_s * sample_rate_hz))
        self._past: NDArray[np.complex64] | None = None
        """Newest samples before carriers were removed; None: no carrier was removed."""
        self.frequencies_hz = np.zeros(0)
        """(lines,) frequencies of the subtracted carriers from the channel's centre [Hz]."""
        self._ratios = np.zeros(0)
        """(lines,) power of each carrier over the median of the bins around it."""
        self._searches_left = np.zeros(0, np.intp)
        """(lines,) number of further calls that subtract a carrier no longer found."""

    @property
    def idle(self) -> bool:
        """True if no carrier has to be subtracted from the present or the last samples."""
        return not self.frequencies_hz.size and self._past is None

    @property
    def needed(self) -> int:
        """Number of earlier samples that `find` and `subtract` need with the new samples."""
        return max(self._length, round(CARRIERS.fit_s * self._rate))

    def find(self, before: NDArray[np.complex64], samples: NDArray[np.complex64]) -> None:
        """Find carriers in the newest samples and in `before`, the samples before them."""
        past = before if self._past is None else self._past
        newest = np.concatenate((past, samples))[-self._length :]
        if len(newest) < self._length:
            return
        spectrum = np.fft.fft(newest * self._window)
        power = spectrum.real**2 + spectrum.imag**2
        floor = np.partition(
            power.reshape(-1, CARRIERS.group_bins), CARRIERS.floor_rank, axis=1
        )[:, CARRIERS.floor_rank]
        floor *= CARRIERS.floor_scale
        # Near an edge of the noise the group on the stronger side counts.
        floor = np.maximum(floor, np.maximum(np.roll(floor, 1), np.roll(floor, -1)))
        least = np.finfo(np.float32).tiny
        over = power > np.maximum(
            np.repeat(CARRIERS.threshold_ratio * floor, CARRIERS.group_bins), least
        )
        self._searches_left -= 1
        self._keep(self._searches_left > 0)
        if not over.any():
            return
        peaks = np.flatnonzero(
            over & (power >= np.roll(power, 1)) & (power > np.roll(power, -1))
        )
        peaks = peaks[np.argsort(-power[peaks])][: 2 * CARRIERS.most_lines]
        three = (peaks + np.array([[-1], [0], [1]])) % self._length
        below, at, above = np.log(np.maximum(power[three], least))
        shift = 0.5 * (below - above) / (below - 2.0 * at + above)
        signed = np.where(peaks > self._length // 2, peaks - self._length, peaks)
        bin_hz = self._rate / self._length
        frequencies = (signed + shift) * bin_hz
        ratios = power[peaks] / np.maximum(
            floor[peaks // CARRIERS.group_bins], np.float32(1e-30)
        )
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
        apart = np.abs(frequencies[:, np.newaxis] - self.frequencies_hz)
        near = apart <= within_hz
        found, line = np.nonzero(near)
        self.frequencies_hz[line], self._ratios[line] = frequencies[found], ratios[found]
        self._searches_left[line] = CARRIERS.held_searches
        room = CARRIERS.most_lines - self.frequencies_hz.size
        others = np.flatnonzero(~near.any(axis=1))
        if not room or not others.size:
            return
        new = others[self._steady(samples, frequencies[others])][:room]
        self.frequencies_hz = np.concatenate((self.frequencies_hz, frequencies[new]))
        self._ratios = np.concatenate((self._ratios, ratios[new]))
        self._searches_left = np.concatenate(
            (self._searches_left, np.full(new.size, CARRIERS.held_searches))
        )

    def _keep(self, kept: NDArray[np.bool_]) -> None:
        if not kept.all():
            self.frequencies_hz, self._ratios = self.frequencies_hz[kept], self._ratios[kept]
            self._searches_left = self._searches_left[kept]

    def _steady(
        self, samples: NDArray[np.complex64], frequencies: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """True for frequencies with steady power, as carriers have and pulses do not.

        There the median power of pieces of 20 ms is near their mean.
        """
        length = round(0.02 * self._rate)
        pieces = samples[: len(samples) // length * length].reshape(-1, length)
        turns = np.exp((-2j * np.pi / self._rate) * np.outer(np.arange(length), frequencies))
        sums = pieces @ turns.astype(np.complex64)
        powers = sums.real**2 + sums.imag**2
        return np.asarray(np.median(powers, axis=0) > 0.3 * powers.mean(axis=0))

    def subtract(self, before: NDArray[np.complex64], samples: NDArray[np.complex64]) -> None:
        """Remove carriers, in place, from new samples (n,) that follow the samples `before`."""
        if not self.frequencies_hz.size:
            self._past = None
            return
        past = before[-self.needed :] if self._past is None else self._past
        self._past = np.concatenate((past, samples))[-self.needed :]
        if not len(samples):
            return
        before = past[-round(CARRIERS.fit_s * self._rate) :]
        both = np.concatenate((before, samples))
        block = self._block
        count = len(both) // block
        if count < 4 * CARRIERS.degree:
            return
        rest = both[len(both) - count * block :].reshape(count, block)
        many = len(self._ratios) > CARRIERS.few_lines
        weak = (
            CARRIERS.degree_of_most
            if len(self._ratios) > CARRIERS.many_lines
            else CARRIERS.degree_of_many
        )
        degrees = np.where(many & (self._ratios < CARRIERS.strong_ratio), weak, CARRIERS.degree)
        lines = _Waves(self.frequencies_hz, degrees, self._rate, count, block)
        cleaned = lines.removed(rest).ravel()[-len(samples) :]
        samples[len(samples) - len(cleaned) :] = cleaned


class _Waves:
    """Sinusoids at given frequencies with amplitudes that follow polynomials, fitted jointly.

    All are fitted together by conjugate gradients, because neighbours share a part of their
    power. Within a block an amplitude is taken as linear.
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
        """Samples (count, block) of the sum of carriers with weights (polynomials, waves)."""
        levels = np.concatenate((self._values @ weights, self._changes @ weights), axis=1)
        return np.asarray((levels * self._middles) @ self._within.T)

    def _shares(self, samples: NDArray[np.complex64]) -> NDArray[np.complex64]:
        """Project samples on each carrier separately; the adjoint operation of `_sum`."""
        levels = (samples @ self._within.conj()) * self._middles.conj()
        half = levels.shape[1] // 2
        shares = self._values.T @ levels[:, :half] + self._changes.T @ levels[:, half:]
        return np.asarray(shares * self._used)

    def removed(self, samples: NDArray[np.complex64]) -> NDArray[np.complex64]:
        rest = samples
        shares = direction = self._shares(rest)
        power = _power(shares)
        for _ in range(CARRIERS.most_fit_steps):
            wave = self._sum(direction)
            step = power / max(_power(wave), 1e-30)
            rest = rest - np.float32(step) * wave
            shares = self._shares(rest)
            before, power = power, _power(shares)
            if power <= CARRIERS.residual_share * self._used.sum() * _power(rest) / rest.size:
                break
            direction = shares + np.float32(power / before) * direction
        return rest


def _power(values: NDArray[np.complex64]) -> float:
    return float((values.real**2 + values.imag**2).sum())


@lru_cache(maxsize=8)
def _window(length: int) -> NDArray[np.float32]:
    return np.hanning(length).astype(np.float32)


@lru_cache(maxsize=8)
def _polynomials(count: int, degree: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Create orthonormal polynomials over blocks: values and slopes (count, degree + 1)."""
    at = (2.0 * np.arange(count) + 1.0) / count - 1.0
    legendre = np.polynomial.legendre
    values, mixed = np.linalg.qr(legendre.legvander(at, degree))
    slopes = legendre.legval(at, legendre.legder(np.eye(degree + 1))).T
    changes = slopes @ np.linalg.inv(mixed) * (2.0 / count)
    return values.astype(np.float32), changes.astype(np.float32)
