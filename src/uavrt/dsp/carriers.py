"""Find steady carriers in the radio's band. Their intermodulation products with a tag's pulses
appear as spurious signals.
"""

import itertools
import math
from collections import deque
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import IQBlock

_APART_NS = (710_000_000, 970_000_000, 1_130_000_000)
"""Intervals between searches for carriers, used in turn [ns]. They differ so that no pulse
train coincides with all searches."""
_LENGTH_S = 0.011
"""Maximum length of samples searched for carriers [s]; their number is a power of two."""
_LEAST_SAMPLES = 256
_CONSECUTIVE_CHECKS = 3
"""Number of consecutive searches that must find a signal before it counts as a carrier; a pulse
is found in fewer."""
_STRONG_RATIO = 10.0**3.0
"""Minimum power of a carrier's frequency bin over the median bin; weaker carriers cause no
spurious signals."""
MOST_CARRIERS = 8
"""Maximum number of carriers reported; if there are more, the strongest are reported."""
_CENTRE_BINS = 4
"""Distance from the radio's centre within which bins are ignored because of the DC offset
[bins]."""
_SAME_BINS = 0.5
_LEAST_SHARE = 1e-4
"""Minimum power of a carrier relative to the strongest; weaker peaks are window sidelobes."""


class Carriers:
    """Finds strong steady carriers in the samples of a radio."""

    def __init__(self) -> None:
        self.frequencies_hz: tuple[float, ...] = ()
        """Absolute frequencies of steady carriers present now [Hz], the strongest first."""
        self._checks: deque[list[float]] = deque(maxlen=_CONSECUTIVE_CHECKS)
        self._next_ns: int | None = None
        self._apart_ns = itertools.cycle(_APART_NS)

    def check(self, block: IQBlock, center_frequency_hz: float) -> None:
        """Search a block of the radio's samples for steady carriers if the next search is due.

        Blocks of less than 256 samples are skipped. `center_frequency_hz` is the radio's tuned
        frequency.
        """
        if self._next_ns is not None and 0 < self._next_ns - block.time_ns < _APART_NS[-1]:
            return
        rate_hz = block.sample_rate_hz
        most = min(len(block.samples), round(_LENGTH_S * rate_hz))
        length = 1 << max(most.bit_length() - 1, 0)
        if length < _LEAST_SAMPLES:
            return
        self._next_ns = block.time_ns + next(self._apart_ns)
        self._checks.append(_strong(block.samples[:length], rate_hz))
        if len(self._checks) < _CONSECUTIVE_CHECKS:
            return
        near_hz = _SAME_BINS * rate_hz / length
        self.frequencies_hz = tuple(
            center_frequency_hz + at_hz
            for at_hz in self._checks[-1]
            if all(any(abs(at_hz - o) < near_hz for o in look) for look in self._checks)
        )


def _strong(samples: NDArray[np.complex64], rate_hz: float) -> list[float]:
    """Return the strongest carriers' frequencies in a block, relative to the radio's centre
    [Hz].
    """
    length = len(samples)
    spectrum = np.fft.fft(samples * _window(length))
    power = spectrum.real**2 + spectrum.imag**2
    least = max(_STRONG_RATIO * float(np.median(power[::8])), _LEAST_SHARE * float(power.max()))
    over = power > least
    peaks = np.flatnonzero(over & (power >= np.roll(power, 1)) & (power > np.roll(power, -1)))
    found: list[float] = []
    for peak in peaks[np.argsort(-power[peaks])][: 4 * MOST_CARRIERS]:
        below, at, above = np.log(power[[peak - 1, peak, (peak + 1) % length]])
        shift = 0.5 * (below - above) / (below - 2.0 * at + above)
        index = float(math.remainder(int(peak) + shift, length))
        if abs(index) > _CENTRE_BINS and all(
            abs(index - other) > _CENTRE_BINS for other in found
        ):
            found.append(index)
    return [index * rate_hz / length for index in found[:MOST_CARRIERS]]


@lru_cache(maxsize=4)
def _window(length: int) -> NDArray[np.float32]:
    return np.blackman(length).astype(np.float32)
