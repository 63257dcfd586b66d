"""Fit a tag's interval: number its pulses and measure how regular they are."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.beeps.tuning import INTERVALS


@dataclass(frozen=True, slots=True, eq=False)
class Beat:
    """Straight line fitted to pulse times: ``t = first + interval · number``."""

    interval_s: float
    sigma_s: float
    """Standard deviation of the measured interval [s]; infinite for two pulses."""
    first_s: float
    numbers: NDArray[np.int64]
    """(n,) number of each pulse in the train, from 0; missing pulses are counted."""
    residuals_s: NDArray[np.float64]
    """(n,) time of each pulse minus its time on the fitted line [s]."""

    @property
    def scatter_s(self) -> float:
        """Standard deviation of the pulses about the line [s]."""
        spare = max(1, self.residuals_s.size - 2)
        return float(np.sqrt((self.residuals_s**2).sum() / spare))


def number_pulses(times_s: NDArray[np.float64], interval_s: float) -> NDArray[np.int64]:
    """Number the pulses of a train by intervals, so that missing pulses count.

    The interval in use follows the recent pulses, which allows for an error of the first guess
    of up to a fifth, and for slow drift. `times_s` (n,): ascending. Returns (n,), from zero;
    two pulses closer than half an interval have equal numbers.
    """
    numbers = np.zeros(times_s.size, dtype=np.int64)
    current = interval_s
    for k in range(1, times_s.size):
        steps = round((times_s[k] - times_s[k - 1]) / current)
        numbers[k] = numbers[k - 1] + steps
        first = max(0, k - INTERVALS.recent_pulses)
        span = numbers[k] - numbers[first]
        if span >= 1:
            # The slope of few pulses is uncertain: weight it by their number.
            slope = (times_s[k] - times_s[first]) / span
            trust = span / (span + 2.0)
            current = trust * slope + (1.0 - trust) * interval_s
    return numbers


def fit_beat(times_s: NDArray[np.float64], interval_s: float) -> Beat:
    """Fit the interval of two or more ascending pulse times (n,) by least squares."""
    numbers = number_pulses(times_s, interval_s)
    centred = numbers - numbers.mean()
    spread = float((centred**2).sum())
    if spread == 0.0:
        return Beat(interval_s, np.inf, float(times_s[0]), numbers, times_s - times_s.mean())
    slope = float((centred * (times_s - times_s.mean())).sum()) / spread
    first = float(times_s.mean() - slope * numbers.mean())
    residuals = times_s - first - slope * numbers
    spare = times_s.size - 2
    variance = float((residuals**2).sum()) / spare if spare > 0 else np.inf
    return Beat(slope, float(np.sqrt(variance / spread)), first, numbers, residuals)
