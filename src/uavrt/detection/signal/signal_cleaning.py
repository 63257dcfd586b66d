"""Remove carriers and impulses from new samples, in place."""

import math

import numpy as np

from uavrt.detection.signal.carrier_lines import FEW_LINES, LineCanceller
from uavrt.detection.signal.samples import Counters, SampleBuffer, blank_impulses
from uavrt.detection.signal.sparks import SparkLimiter
from uavrt.detection.signal.whitening import Whitener

_LINES_EVERY_S = 2.4
"""Time between two looks for carriers: one that is there may drift, and 2 Hz/s in 2.5 s is
more than an amplitude's fit can take."""
_FLOOR_STRIDE = 4
_MEDIAN = math.log(2.0)
"""Median of an exponential over its mean."""


class Cleaner:
    """Cleans the samples of one stream, stretch by stretch.

    Parameters
    ----------
    sample_rate_hz, pulse_width_s : float
    counters : Counters
    whitener : Whitener, optional
        Makes the noise white, and
    limiter : SparkLimiter, optional
        makes it steady before impulses are looked for.
    """

    def __init__(
        self,
        *,
        sample_rate_hz: float,
        pulse_width_s: float,
        counters: Counters,
        whitener: Whitener | None = None,
        limiter: SparkLimiter | None = None,
    ) -> None:
        self._counters = counters
        self._lines = LineCanceller(sample_rate_hz)
        self._whitener = whitener
        self._limiter = limiter
        self._steady_ahead = 0 if limiter is None else limiter.reach
        self._ahead = self._steady_ahead + (0 if whitener is None else whitener.reach)
        self._without_lines = 0
        """Index up to which carriers are taken out."""
        self._white = 0
        """Index up to which the noise is white."""
        self._steady = 0
        """Index up to which it is steady."""
        self.flank = max(2, round(0.35 * pulse_width_s * sample_rate_hz))
        """Samples looked at to either side of an impulse."""
        self._short = max(2, round(0.05 * pulse_width_s * sample_rate_hz))
        self._every = round(_LINES_EVERY_S * sample_rate_hz)
        self._look_at = 0
        """End of the stretch at which carriers are looked for again."""
        self.floor = 0.0
        """Median power of a sample; zero before the first stretch."""

    @property
    def margin(self) -> int:
        """Samples that must be there beyond a stretch."""
        return self._beyond + self._ahead

    @property
    def _beyond(self) -> int:
        """Samples beyond a stretch that the search for impulses looks at."""
        return self.flank + self._short

    @property
    def many_lines(self) -> bool:
        """Whether more than a few carriers are taken out: mains hum."""
        return len(self._lines.frequencies_hz) > FEW_LINES

    @property
    def mean_floor(self) -> float:
        """Mean power of a sample without pulses."""
        return self.floor / _MEDIAN

    def clean(self, buffer: SampleBuffer, first: int, last: int, *, renew: bool) -> None:
        """Clean the samples of indices [first, last).

        Parameters
        ----------
        buffer : SampleBuffer
        first, last : int
        renew : bool
            Measure the floor again.
        """
        buffer.examine(min(buffer.end, last + self.margin))
        if self._whitener is None or self._limiter is None:
            self._cancel_lines(buffer, first, last)
        else:
            self._whiten(self._whitener, buffer, last)
            self._make_steady(self._limiter, buffer, last)
        buffer.silence(first, last)
        self._blank(buffer, first, last, renew=renew)

    def _whiten(self, whitener: Whitener, buffer: SampleBuffer, last: int) -> None:
        """Make the noise white up to the samples that the next steps need."""
        end = min(buffer.end, last + self._beyond + self._steady_ahead)
        ready = min(buffer.end, last + self.margin)
        first = max(self._without_lines, buffer.start)
        self._cancel_lines(buffer, first, ready)
        buffer.silence(first, ready)
        whitener.learn(buffer.view(first, ready))
        begin = max(self._white, buffer.start)
        whitener.filter(
            buffer.view(max(buffer.start, begin - whitener.reach), begin),
            buffer.view(begin, end),
            buffer.view(end, ready),
        )
        if whitener.active:
            buffer.silence(begin, end)
        self._without_lines, self._white = ready, end

    def _make_steady(self, limiter: SparkLimiter, buffer: SampleBuffer, last: int) -> None:
        """Make the noise steady up to the samples that the search for impulses needs."""
        end = min(self._white, last + self._beyond)
        begin = max(self._steady, buffer.start)
        limiter.limit(
            buffer.view(max(buffer.start, begin - limiter.reach), begin),
            buffer.view(begin, end),
            buffer.view(end, self._white),
        )
        self._steady = end

    def _cancel_lines(self, buffer: SampleBuffer, first: int, last: int) -> None:
        """Subtract carriers from [first, last)."""
        look = bool(self._lines.frequencies_hz) or last >= self._look_at
        if not look and self._lines.idle:
            return
        first = max(first, buffer.start)
        new = buffer.view(first, last)
        before = buffer.view(max(buffer.start, first - self._lines.needed), first)
        if look:
            self._lines.find(before, new)
            if last - buffer.start >= self._lines.needed:
                self._look_at = last + self._every
        self._lines.subtract(before, new)

    def _blank(self, buffer: SampleBuffer, first: int, last: int, *, renew: bool) -> None:
        """Zero impulses in [first, last), looking a flank to either side."""
        margin = self._beyond
        low = max(buffer.start, first - margin)
        high = min(buffer.end, last + margin)
        stretch = buffer.view(low, high)
        if not len(stretch):
            return
        if self.floor <= 0.0 or renew:
            some = stretch[::_FLOOR_STRIDE]
            power = some.real**2 + some.imag**2
            power = power[power > 0.0]  # zeros stand for lost samples
            if len(power):
                middle = len(power) // 2
                self.floor = float(np.partition(power, middle)[middle])
        if self.floor > 0.0:
            blanked = blank_impulses(
                stretch,
                floor=self.floor,
                short=self._short,
                flank=self.flank,
                first=first - low,
                last=last - low,
            )
            self._counters.samples_blanked += sum(b - a for a, b in blanked)
            buffer.blanked += [(low + a, low + b) for a, b in blanked]
