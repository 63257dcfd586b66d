"""An energy detector: single pulses, one cell of time and frequency at a time.

The best that can be done without summing pulses: a matched filter for a rectangular pulse on a
fine grid, the largest cell against a threshold from Monte Carlo.
"""

import math

import numpy as np
from numpy.typing import NDArray


class EnergyDetector:
    """Decides on the strongest cell of a segment.

    `probability`: of a false alarm in a segment.
    `trials`: segments of noise for the threshold.
    """

    def __init__(
        self,
        *,
        pulse_width_s: float,
        segment_s: float,
        probability: float = 0.01,
        sample_rate_hz: float = 3750.0,
        trials: int = 200,
        seed: int = 1,
    ) -> None:
        self.rate = sample_rate_hz
        self.window = math.ceil(pulse_width_s * sample_rate_hz - 1e-9)
        self.hop = max(1, self.window // 8)
        self._size = 4 * self.window
        count = round(segment_s * sample_rate_hz)
        rng = np.random.default_rng(seed)
        largest = np.array([self.strongest(_noise(rng, count))[0] for _ in range(trials)])
        # Maxima of many cells: an exponential tail beyond the mean of the maxima.
        scale = float(largest.std()) * math.sqrt(6.0) / math.pi
        location = float(largest.mean()) - 0.5772 * scale
        self.threshold = location - scale * math.log(-math.log(1.0 - probability))

    def strongest(self, samples: NDArray[np.complex64]) -> tuple[float, float, float]:
        """Power in noise powers, start [s] and frequency [Hz] of the strongest cell."""
        windows = np.lib.stride_tricks.sliding_window_view(samples, self.window)[:: self.hop]
        best = (0.0, 0.0, 0.0)
        for first in range(0, len(windows), 512):
            spectra = np.fft.fft(windows[first : first + 512], self._size, axis=1)
            power = (spectra.real**2 + spectra.imag**2) / self.window
            at = int(power.argmax())
            column, row = divmod(at, self._size)
            value = float(power[column, row])
            if value > best[0]:
                hz = (row - self._size * (row > self._size // 2)) * self.rate / self._size
                best = (value, (first + column) * self.hop / self.rate, hz)
        return best

    def detect(self, samples: NDArray[np.complex64]) -> tuple[float, float] | None:
        """Start [s] and frequency [Hz] of the strongest cell, if it passes the threshold."""
        power, start_s, offset_hz = self.strongest(samples)
        return (start_s, offset_hz) if power >= self.threshold else None


def _noise(rng: np.random.Generator, count: int) -> NDArray[np.complex64]:
    parts = rng.standard_normal((count, 2), dtype=np.float32) * np.float32(math.sqrt(0.5))
    return parts.view(np.complex64).ravel()
