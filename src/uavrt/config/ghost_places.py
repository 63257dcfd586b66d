"""Compute at which frequencies a strong signal causes spurious signals in a receiver.

Spurious signals are mirror images, harmonics and intermodulation products. If one tag may cause
a spurious signal at another tag's frequency, a single detector process searches for both tags,
if this keeps the processes' loads balanced. It can compare both pulse trains at once. Two
processes would have to compare them through the supervisor a second later, and some flights
would confirm a spurious signal as a tag.
"""

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

HIGHEST = 9
"""Highest multiple of a signal's offset from the centre frequency at which a spurious signal is
assumed."""
_NEAR_HZ = 15.0
_NEAR_HZ_PER_MULTIPLE = 3.0
_NEIGHBOUR_HZ = 1000.0
"""Smallest distance between a signal and a spurious signal that it causes [Hz]; anything nearer
counts as spectral leakage."""
_USUAL_HZ = 500.0
"""Largest assumed error of a tag's labelled frequency [Hz], even if the search band is
wider."""
_MULTIPLES = sorted(set(range(-HIGHEST, HIGHEST + 1)) - {0, 1}, key=lambda m: (abs(m), m))
"""Multiples of a signal's offset from the centre frequency at which it causes spurious signals,
lowest first; -1 is the mirror image."""
_PRODUCTS = (
    *((2, -1), (-1, 2), (3, -2), (-2, 3)),
    *((1, 1), (-1, -1), (1, -1), (-1, 1), (-2, -1), (-1, -2)),
)
"""Pairs of factors (m, n) of intermodulation products.

Two signals at offsets a and b from the centre frequency cause a spurious signal at m a + n b.
The first four pairs come from nonlinear amplifiers, the rest from converters that process I and
Q separately."""


@dataclass(frozen=True, slots=True)
class Receiver:
    """A receiver's centre frequency and sample rate, which place its spurious signals."""

    center_frequency_hz: float
    sample_rate_hz: float

    def makes(
        self, ghost_hz: float, original_hz: float, partners_hz: Iterable[float] = ()
    ) -> bool:
        """True if a signal, alone or with `partners_hz`, may cause a spurious signal at
        `ghost_hz`.
        """
        if abs(ghost_hz - original_hz) < _NEIGHBOUR_HZ:
            return False
        return any(
            self._apart_hz(ghost_hz, place_hz) < near_hz
            for place_hz, near_hz in self._places(original_hz, partners_hz)
        )

    def share_of_band(
        self,
        original_hz: float,
        partners_hz: Iterable[float],
        *,
        nominal_hz: float,
        half_width_hz: float,
    ) -> float:
        """Share (0 to 1) of a tag's search band that may contain spurious signals of another
        signal.
        """
        half_hz = min(half_width_hz, _USUAL_HZ)
        inside_hz = 0.0
        for place_hz, near_hz in self._places(original_hz, partners_hz):
            apart_hz = self._apart_hz(nominal_hz, place_hz)
            inside_hz += max(
                0.0, min(apart_hz + near_hz, half_hz) - max(apart_hz - near_hz, -half_hz)
            )
        return min(1.0, inside_hz / (2.0 * half_hz))

    def multiple(self, ghost_hz: float, original_hz: float, window_hz: float) -> int | None:
        """Multiple of a signal's offset that explains a spurious signal within a window, lowest
        first (-1: mirror image); None if none does.
        """
        original = original_hz - self.center_frequency_hz
        for multiple in _MULTIPLES:
            miss_hz = self._apart_hz(ghost_hz, multiple * original)
            if miss_hz < (1 + abs(multiple)) * min(window_hz, _USUAL_HZ):
                return multiple
        return None

    def _places(
        self, original_hz: float, partners_hz: Iterable[float]
    ) -> Iterator[tuple[float, float]]:
        """Yield the offset from the centre frequency, before aliasing, and the tolerance of
        each possible spurious signal [Hz].
        """
        original = original_hz - self.center_frequency_hz
        for multiple in _MULTIPLES:
            yield multiple * original, _NEAR_HZ + _NEAR_HZ_PER_MULTIPLE * abs(multiple)
        for partner_hz, (one, other) in itertools.product(partners_hz, _PRODUCTS):
            near_hz = _NEAR_HZ + _NEAR_HZ_PER_MULTIPLE * (abs(one) + abs(other))
            yield one * original + other * (partner_hz - self.center_frequency_hz), near_hz

    def _apart_hz(self, frequency_hz: float, place_hz: float) -> float:
        offset_hz = frequency_hz - self.center_frequency_hz
        return abs(math.remainder(offset_hz - place_hz, self.sample_rate_hz))
