"""Divide the samples by the level of their instant where noise comes in bursts.

Power lines spark at twice the mains frequency: noise for a millisecond or five of each ten. A
window one pulse long holds two or three such bursts, so cells of few independent parts make
several times the false groups of steady noise, and a tag is lost in bursts that leave most of
its pulse clean. In noise whose power changes the matched filter weighs each sample by its
noise; dividing by the standard deviation makes the noise steady.

The level of an instant is the harmonic mean of those of the frequencies on both sides of the
band that is searched: neither a tag's pulse nor a neighbour on one side is a burst.
"""

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.signal.in_place import Surroundings

_SIDE_S = 0.0013
"""Half-length of the filters for the frequencies on both sides of the band."""
_SMOOTH_S = 0.0011
"""Half-length of the mean over time: three independent values in a kilohertz."""
_GUARD_HZ = 50.0
_LEAST_WIDTH_HZ = 300.0
"""Least width of each side; narrower ones cannot be measured within a millisecond."""
_QUIET_SHARE = 0.2
"""Quantile of the levels that represents the time between bursts."""
_MEAN = 1.8
"""Ratio of steady noise's mean level to that quantile (1.79), and a little more."""
_HIGH = 5.0
"""Ratio of a burst's level to that quantile. Of steady noise 0.8 % is higher, with the edges of
pulses of 60 dB 1.3 %, with sparks of 3 dB mean power 16 % or more."""
_SPARKING = 0.135
"""Share of such levels at which the noise counts as sparks: rarer bursts are blanked as
impulses; ten of 5 ms in a second make 10 %."""
_STEADY = 0.11
_LOOK_EVERY = 8
"""Steps between checks while nothing sparks: a check takes a third of a step."""
_AVERAGE = 0.2


class SparkLimiter:
    """Makes noise steady that comes in bursts shorter than a pulse.

    `offset_hz`, `half_width_hz`: the band that is searched, relative to the channel's centre.
    """

    def __init__(
        self, *, sample_rate_hz: float, offset_hz: float, half_width_hz: float
    ) -> None:
        away_hz = half_width_hz + _GUARD_HZ
        width_hz = 0.5 * sample_rate_hz - away_hz
        side = round(_SIDE_S * sample_rate_hz)
        at = np.arange(-side, side + 1)
        self._filters: list[NDArray[np.complex64]] = []
        if width_hz >= _LEAST_WIDTH_HZ:
            low_pass = np.sinc(at * width_hz / sample_rate_hz) * np.hanning(2 * side + 3)[1:-1]
            low_pass /= low_pass.sum()
            for sign in (-1.0, 1.0):
                middle_hz = offset_hz + sign * (away_hz + 0.5 * width_hz)
                turn = np.exp(2j * np.pi * middle_hz / sample_rate_hz * at)
                self._filters.append((low_pass * turn).astype(np.complex64))
        smooth = np.hanning(2 * round(_SMOOTH_S * sample_rate_hz) + 1)[1:-1]
        self._smooth = (smooth / smooth.sum()).astype(np.float32)
        self.reach = side + (len(smooth) - 1) // 2 if self._filters else 0
        """Samples examined on either side of each."""
        self._surroundings = Surroundings()
        self._share = 0.0
        self._steps = 0
        self.active = False
        """True while the samples are divided."""

    def limit(
        self,
        before: NDArray[np.complex64],
        samples: NDArray[np.complex64],
        after: NDArray[np.complex64],
    ) -> None:
        """Divide new samples in place where the noise sparks; see `Surroundings.of`."""
        self._steps += 1
        idle = not self.active and self._steps % _LOOK_EVERY != 1
        if not self._filters or len(samples) <= 2 * self.reach or idle:
            self._surroundings.unfiltered()
            return
        whole = self._surroundings.of(before, samples, after, self.reach)
        level = self._level(whole)
        there = level[samples != 0.0]
        if not len(there):
            self._surroundings.unfiltered()
            return
        at = int(_QUIET_SHARE * len(there))
        quiet = float(np.partition(there, at)[at])
        share = float((there > _HIGH * quiet).mean())
        self._share += (_AVERAGE if self.active else 1.0) * (share - self._share)
        self.active = self._share > (_STEADY if self.active else _SPARKING)
        if not self.active or quiet <= 0.0:
            self._surroundings.unfiltered()
            return
        self._surroundings.filtered(whole, self.reach)
        samples /= np.sqrt(np.maximum(level / np.float32(_MEAN * quiet), np.float32(1.0)))

    def _level(self, whole: NDArray[np.complex64]) -> NDArray[np.float32]:
        """Power outside the searched band, of all samples but `reach` at both ends."""
        sides = []
        for taps in self._filters:
            outside = np.convolve(whole, taps, "valid")
            power = outside.real**2 + outside.imag**2
            sides.append(np.convolve(power, self._smooth, "valid"))
        # Near the lower of the two, and less scattered.
        low, high = sides
        return np.asarray(2.0 * low * high / (low + high + np.float32(1e-30)), np.float32)
