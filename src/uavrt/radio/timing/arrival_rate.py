"""Compare the measured rate of samples with the requested rate.

A radio that streams at a wrong rate seems to work, but no tag is found. The rate follows from
the smallest delay in each period of 0.5 s, because a stall does not delay all arrivals of a
period, and a loss of samples is a single step.
"""

import math
from collections import deque
from itertools import pairwise
from typing import Final

_PERIOD_S: Final = 0.5
"""Length of the periods in which the smallest delay of sample arrivals is measured [s]."""
_PERIODS: Final = 5
"""Number of periods after which a wrong sample rate can be detected: 2.5 s in total."""
_TOLERANCE: Final = 0.02
"""Relative error of the sample rate above which it is reported as wrong."""
_SETTLED: Final = 0.01
"""Relative error below which a rate reported as wrong counts as correct again."""
_CAUGHT_UP_S: Final = 0.03
"""Delay in excess of that before a pause, below which the sender has caught up [s]. It is
smaller than the change of the delay over `_PERIODS` that is reported."""
_CHANGE_SHARE: Final = 0.1
"""Relative change of a wrong sample rate above which the rate is reported once more."""


class ArrivalRate:
    """Measures the sample rate of one stream and detects a wrong rate."""

    def __init__(self, rate_hz: float) -> None:
        self.wrong_hz: float | None = None
        """Measured sample rate if it is wrong by more than 2 % [Hz], otherwise None."""
        self._rate_hz = rate_hz
        self._least_s: deque[float] = deque(maxlen=_PERIODS)
        self._period = 0
        self._now_s = 0.0
        self._first_ns: int | None = None
        self._catch_up_to_s = math.inf
        """Delay of arrivals before the last pause [s]; infinite once the sender caught up."""

    def arrived(self, received: int, now_ns: int, *, full: bool = False) -> None:
        """Add the number of samples that were received up to a time.

        `full`: the buffer was full, so the sender had to wait; such arrivals are not used.
        """
        if full:
            return
        if self._first_ns is None:
            self._first_ns, self._now_s = now_ns, -received / self._rate_hz
            return
        age_s = (now_ns - self._first_ns) * 1e-9
        delay_s = age_s - received / self._rate_hz
        stretch = int(age_s / _PERIOD_S)
        if stretch <= self._period:
            self._now_s = min(self._now_s, delay_s)
            return
        if stretch > self._period + 1:
            # A pause; another one before the sender has caught up keeps the delay to reach.
            self._catch_up_to_s = min(self._catch_up_to_s, self._now_s, *self._least_s)
            self._least_s.clear()
        else:
            self._least_s.append(self._now_s)
            self._judge()
        self._period, self._now_s = stretch, delay_s

    def _judge(self) -> None:
        least_s = list(self._least_s)
        caught_up = least_s[-1] <= self._catch_up_to_s + _CAUGHT_UP_S
        if self._catch_up_to_s < math.inf and caught_up:
            self._catch_up_to_s = math.inf
            self._least_s.clear()
            return
        if len(least_s) < _PERIODS or (
            self._catch_up_to_s < math.inf and least_s[-1] < least_s[0]
        ):
            return
        steps_s = [b - a for a, b in pairwise(least_s)]
        mean_s = sum(steps_s) / len(steps_s)
        if abs(mean_s) < _SETTLED * _PERIOD_S:
            self.wrong_hz = None
        elif abs(mean_s) > _TOLERANCE * _PERIOD_S and min(s / mean_s for s in steps_s) > 0.5:
            wrong_hz = self._rate_hz * (1.0 - mean_s / _PERIOD_S)
            # Reported once while the fault lasts.
            if self.wrong_hz is None or abs(wrong_hz / self.wrong_hz - 1.0) > _CHANGE_SHARE:
                self.wrong_hz = wrong_hz
