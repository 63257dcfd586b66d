"""Compute frequencies where a receiver shows ghosts of a strong signal, such as mirror images.

If a ghost of one tag may appear at another tag's frequency, one detector process searches for
both tags, as far as the load stays even. It compares both pulse trains at once. Two processes
would exchange trains through the supervisor, a second later, and some flights would confirm a
ghost.
"""

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

HIGHEST = 9
"""Highest multiple of a signal's offset from the centre frequency at which a ghost is
assumed."""
_NEAR_HZ = 15.0
_NEAR_HZ_PER_MULTIPLE = 3.0
_NEIGHBOUR_HZ = 1000.0
"""Smallest distance between a signal and its ghost [Hz]; nearer signals count as leakage."""
_USUAL_HZ = 500.0
"""Largest assumed error of a tag's labelled frequency [Hz], even if the search band is
wider."""
_MULTIPLES = sorted(set(range(-HIGHEST, HIGHEST + 1)) - {0, 1}, key=lambda m: (abs(m), m))
"""Multiples of a signal's offset from the centre frequency at which ghosts appear, lowest
first; -1 is the mirror image."""
_PRODUCTS = (
    *((2, -1), (-1, 2), (3, -2), (-2, 3)),
    *((1, 1), (-1, -1), (1, -1), (-1, 1), (-2, -1), (-1, -2)),
)
"""Coefficients (m, n) of intermodulation: two signals at offsets f and g from the centre
frequency cause a spurious signal (ghost) at m·f + n·g. The first four come from nonlinear
amplifiers, the others from converters that distort I and Q separately."""


@dataclass(frozen=True, slots=True)
class Receiver:
    """Tuning of a receiver, which determines its ghost frequencies."""

    center_frequency_hz: float
    sample_rate_hz: float

    def makes(
        self, ghost_hz: float, original_hz: float, partners_hz: Iterable[float] = ()
    ) -> bool:
        """True if a signal, alone or with `partners_hz`, may cause a ghost at `ghost_hz`."""
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
        """Share (0 to 1) of a tag's search band that ghosts of a signal may occupy."""
        half_hz = min(half_width_hz, _USUAL_HZ)
        inside_hz = 0.0
        for place_hz, near_hz in self._places(original_hz, partners_hz):
            apart_hz = self._apart_hz(nominal_hz, place_hz)
            inside_hz += max(
                0.0, min(apart_hz + near_hz, half_hz) - max(apart_hz - near_hz, -half_hz)
            )
        return min(1.0, inside_hz / (2.0 * half_hz))

    def multiple(self, ghost_hz: float, original_hz: float, window_hz: float) -> int | None:
        """Order of a signal's lowest ghost in a search band (-1: mirror image), or None."""
        original = original_hz - self.center_frequency_hz
        for multiple in _MULTIPLES:
            miss_hz = self._apart_hz(ghost_hz, multiple * original)
            if miss_hz < (1 + abs(multiple)) * min(window_hz, _USUAL_HZ):
                return multiple
        return None

    def _places(
        self, original_hz: float, partners_hz: Iterable[float]
    ) -> Iterator[tuple[float, float]]:
        """Offset of each possible ghost from the centre before aliasing, and tolerance [Hz]."""
        original = original_hz - self.center_frequency_hz
        for multiple in _MULTIPLES:
            yield multiple * original, _NEAR_HZ + _NEAR_HZ_PER_MULTIPLE * abs(multiple)
        for partner_hz, (one, other) in itertools.product(partners_hz, _PRODUCTS):
            near_hz = _NEAR_HZ + _NEAR_HZ_PER_MULTIPLE * (abs(one) + abs(other))
            yield one * original + other * (partner_hz - self.center_frequency_hz), near_hz

    def _apart_hz(self, frequency_hz: float, place_hz: float) -> float:
        offset_hz = frequency_hz - self.center_frequency_hz
        return abs(math.remainder(offset_hz - place_hz, self.sample_rate_hz))
