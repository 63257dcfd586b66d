"""Where a receiver shows a strong signal besides its own place."""

import math
from dataclasses import dataclass

HIGHEST = 9
"""Multiple of a signal's distance from the centre."""
_NEAR_HZ = 15.0
_NEAR_HZ_PER_MULTIPLE = 3.0
_BESIDE_HZ = 1000.0
"""Nearer than this it is no ghost but a neighbour, or a leak that is refused already."""
_USUAL_HZ = 500.0
"""Tags are off by no more, however wide the search is."""
_MULTIPLES = sorted(set(range(-HIGHEST, HIGHEST + 1)) - {0, 1}, key=lambda m: (abs(m), m))
"""The mirror first."""


@dataclass(frozen=True, slots=True)
class Receiver:
    """What makes ghosts."""

    center_frequency_hz: float
    sample_rate_hz: float

    def makes(self, ghost_hz: float, original_hz: float) -> bool:
        """Whether a signal may have a ghost at a frequency."""
        if abs(ghost_hz - original_hz) < _BESIDE_HZ:
            return False
        return any(
            self._miss_hz(ghost_hz, original_hz, multiple)
            < _NEAR_HZ + _NEAR_HZ_PER_MULTIPLE * abs(multiple)
            for multiple in _MULTIPLES
        )

    def multiple(self, ghost_hz: float, original_hz: float, window_hz: float) -> int | None:
        """By which multiple a signal may have a ghost in a search, if each is off its place.

        Parameters
        ----------
        ghost_hz, original_hz : float
            Nominal frequencies.
        window_hz : float
            Half-width of the search around both.

        Returns
        -------
        int, optional
            The least; -1 is the mirror. None: by none.
        """
        for multiple in _MULTIPLES:
            miss_hz = self._miss_hz(ghost_hz, original_hz, multiple)
            if miss_hz < (1 + abs(multiple)) * min(window_hz, _USUAL_HZ):
                return multiple
        return None

    def _miss_hz(self, ghost_hz: float, original_hz: float, multiple: int) -> float:
        ghost = ghost_hz - self.center_frequency_hz
        original = original_hz - self.center_frequency_hz
        return abs(math.remainder(ghost - multiple * original, self.sample_rate_hz))
