"""Divide the samples by the momentary noise level if the noise comes in bursts.

Power lines spark at twice the mains frequency: they emit noise for one to five milliseconds in
each ten. This noise forms several times as many false groups as steady noise. In noise of
varying power, a matched filter must weight each sample by the inverse of its noise power.

The noise level at an instant is the harmonic mean of the levels on both sides of the searched
band. So neither a tag's pulse nor a neighbour on one side counts as a burst.
"""

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.signal.in_place import Surroundings
from uavrt.detection.signal.tuning import SPARKS


class SparkLimiter:
    """Equalises noise in the searched band that comes in bursts shorter than a pulse."""

    def __init__(
        self, *, sample_rate_hz: float, offset_hz: float, half_width_hz: float
    ) -> None:
        away_hz = half_width_hz + SPARKS.guard_hz
        width_hz = 0.5 * sample_rate_hz - away_hz
        side = round(SPARKS.side_s * sample_rate_hz)
        at = np.arange(-side, side + 1)
        self._filters: list[NDArray[np.complex64]] = []
        if width_hz >= SPARKS.least_width_hz:
            low_pass = np.sinc(at * width_hz / sample_rate_hz) * np.hanning(2 * side + 3)[1:-1]
            low_pass /= low_pass.sum()
            for sign in (-1.0, 1.0):
                middle_hz = offset_hz + sign * (away_hz + 0.5 * width_hz)
                turn = np.exp(2j * np.pi * middle_hz / sample_rate_hz * at)
                self._filters.append((low_pass * turn).astype(np.complex64))
        smooth = np.hanning(2 * round(SPARKS.smooth_s * sample_rate_hz) + 1)[1:-1]
        self._smooth = (smooth / smooth.sum()).astype(np.float32)
        self.reach = side + (len(smooth) - 1) // 2 if self._filters else 0
        """Number of samples that the filters need on either side of each sample."""
        self._surroundings = Surroundings()
        self._share = 0.0
        self._steps = 0
        self.active = False
        """True while noise comes in bursts and the samples are divided by the noise level."""

    def limit(
        self,
        before: NDArray[np.complex64],
        samples: NDArray[np.complex64],
        after: NDArray[np.complex64],
    ) -> None:
        """Divide new samples by the noise level, in place, while noise comes in bursts."""
        self._steps += 1
        idle = not self.active and self._steps % SPARKS.check_every != 1
        if not self._filters or len(samples) <= 2 * self.reach or idle:
            self._surroundings.unfiltered()
            return
        whole = self._surroundings.of(before, samples, after, self.reach)
        level = self._level(whole)
        there = level[samples != 0.0]
        if not len(there):
            self._surroundings.unfiltered()
            return
        at = int(SPARKS.quiet_quantile * len(there))
        quiet = float(np.partition(there, at)[at])
        share = float((there > SPARKS.high_ratio * quiet).mean())
        self._share += (SPARKS.share_gain if self.active else 1.0) * (share - self._share)
        self.active = self._share > (
            SPARKS.steady_share if self.active else SPARKS.sparking_share
        )
        if not self.active or quiet <= 0.0:
            self._surroundings.unfiltered()
            return
        self._surroundings.filtered(whole, self.reach)
        samples /= np.sqrt(
            np.maximum(level / np.float32(SPARKS.mean_ratio * quiet), np.float32(1.0))
        )

    def _level(self, whole: NDArray[np.complex64]) -> NDArray[np.float32]:
        """Power outside the searched band, for all samples except `reach` at both ends."""
        sides = []
        for taps in self._filters:
            outside = np.convolve(whole, taps, "valid")
            power = outside.real**2 + outside.imag**2
            sides.append(np.convolve(power, self._smooth, "valid"))
        # Near the lower of the two levels, with less scatter.
        low, high = sides
        return np.asarray(2.0 * low * high / (low + high + np.float32(1e-30)), np.float32)
