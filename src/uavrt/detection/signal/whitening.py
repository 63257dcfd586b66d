"""Make the noise of a channel white: suppress noise-like neighbours.

Leakage from a band of noise near the tag would make ten times the false groups of white noise.
The matched filter for noise of density S is the pulse divided by S. So the samples are divided
by S where it is up to ten times the noise of the searched band, and by the square root of any
excess.

The filter is symmetric, so that no pulse is shifted, and has a gain of one at the tag's
frequency. It comes from linear prediction (J. Makhoul, Linear prediction: a tutorial review,
Proc. IEEE 63, 1975): a predictor of noise with a density D leaves it white, and its output
filtered backwards has the gain 1 / D.
"""

import math

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.signal.in_place import Samples, Surroundings
from uavrt.detection.signal.tuning import WHITENING


class Whitener:
    """Tracks a channel's noise density, and filters the samples to make it flat."""

    def __init__(
        self, *, sample_rate_hz: float, offset_hz: float, half_width_hz: float
    ) -> None:
        self.reach = round(WHITENING.reach_s * sample_rate_hz)
        self._radian = 2.0 * math.pi * offset_hz / sample_rate_hz
        self._length = 1 << round(math.log2(WHITENING.segment_s * sample_rate_hz))
        self._sample_s = 1.0 / sample_rate_hz
        self._taper = np.hanning(self._length + 2)[1:-1].astype(np.float32)
        frequencies = np.fft.fftfreq(self._length, 1.0 / sample_rate_hz)
        away = np.abs((frequencies - offset_hz + 0.5 * sample_rate_hz) % sample_rate_hz)
        away = np.abs(away - 0.5 * sample_rate_hz)
        self._searched = away <= half_width_hz + sample_rate_hz / self._length
        self._density = np.zeros(0)
        self._seen_s = 0.0
        self._steps = 0
        self._surroundings = Surroundings()
        self._taps: NDArray[np.complex64] | None = None

    @property
    def active(self) -> bool:
        """True while the samples are filtered."""
        return self._taps is not None

    def learn(self, samples: Samples) -> None:
        """Update the noise density with new samples without carriers; make their filter."""
        self._steps += 1
        rests = self._taps is None and self._seen_s > WHITENING.young_s
        if rests and self._steps % WHITENING.check_every:
            return
        length = self._length
        hop = length // 2
        if len(samples) < length:
            return
        pieces = np.lib.stride_tricks.sliding_window_view(samples, length)[::hop]
        present = pieces[:, ::8] != 0.0
        if not present.all():
            pieces = pieces[present.mean(axis=1) > 0.9]
        if not len(pieces):
            return
        spectrum = np.fft.fft(pieces * self._taper)
        power = spectrum.real**2 + spectrum.imag**2
        at = len(power) // 2
        middle = np.partition(power, at, axis=0)[at] / math.log(2.0)
        if not self._seen_s:
            self._density = np.maximum(middle, 1e-30)
        span_s = len(samples) * self._sample_s * (WHITENING.check_every if rests else 1)
        self._seen_s += span_s
        weight = min(1.0, span_s / min(self._seen_s, WHITENING.memory_s))
        limited = np.minimum(power, WHITENING.most_weight * self._density).mean(axis=0)
        self._density += weight * (limited - self._density)
        new = (
            self._taps is None
            or self._seen_s <= WHITENING.memory_s
            or not self._steps % WHITENING.check_every
        )
        if len(pieces) >= WHITENING.fewest_windows:
            risen = _smooth(middle) > WHITENING.rise_ratio * _smooth(self._density)
            self._density[risen] = middle[risen]
            new = new or bool(risen.any())
        if new:
            self._choose()

    def _choose(self) -> None:
        """Set the filter for the present noise density; no filter if the noise is white."""
        density = _smooth(self._density)
        least = float(density[self._searched].min())
        ratio = density / max(least, 1e-30)
        highest = float(ratio.max())
        least_coloured = (
            WHITENING.coloured_ratio
            if self._seen_s > WHITENING.young_s
            else WHITENING.young_coloured_ratio
        )
        if highest < (least_coloured if self._taps is None else WHITENING.plain_ratio):
            self._taps = None
            return
        over = np.maximum(self._density / max(least, 1e-30), 1.0)
        lags = np.fft.ifft(np.sqrt(over * np.minimum(over, WHITENING.suppressed_ratio)))
        self._taps = self._filter(lags)

    def _filter(self, lags: NDArray[np.complex128]) -> NDArray[np.complex64]:
        """Create the filter from an autocorrelation: the predictor, correlated with itself."""
        order = self.reach
        order = min(order, len(lags) // 2 - 1)
        index = np.arange(order)
        apart = index[:, np.newaxis] - index[np.newaxis, :]
        matrix = np.where(apart >= 0, lags[np.abs(apart)], lags[np.abs(apart)].conj())
        matrix[index, index] *= 1.0 + 1e-6
        predictor = np.concatenate(([1.0], -np.linalg.solve(matrix, lags[1 : order + 1])))
        taps = np.convolve(predictor, predictor[::-1].conj())
        at = np.arange(-order, order + 1)
        gain = (taps * np.exp(-1j * self._radian * at)).sum().real
        return np.asarray(taps / gain, np.complex64)

    def filter(self, before: Samples, samples: Samples, after: Samples) -> None:
        """Filter new samples in place; `before`, `after`: their unfiltered neighbours."""
        if self._taps is None:
            self._surroundings.unfiltered()
            return
        side = (len(self._taps) - 1) // 2
        whole = self._surroundings.of(before, samples, after, side)
        self._surroundings.filtered(whole, side)
        samples[:] = np.convolve(whole, self._taps, "valid")

    def preview(self, before: Samples, samples: Samples, after: Samples) -> Samples:
        """Return the filtered new samples without changing them; lost samples remain zero."""
        assert self._taps is not None
        side = (len(self._taps) - 1) // 2
        whole = self._surroundings.of(before, samples, after, side)
        white = np.convolve(whole, self._taps, "valid")
        white[samples == 0.0] = 0.0
        return white


def _smooth(density: NDArray[np.float64]) -> NDArray[np.float64]:
    side = WHITENING.smoothed_bins // 2
    sums = np.cumsum(np.concatenate(([0.0], density[-side:], density, density[:side])))
    return np.asarray(
        (sums[WHITENING.smoothed_bins :] - sums[: -WHITENING.smoothed_bins])
        / WHITENING.smoothed_bins
    )
