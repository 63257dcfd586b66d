"""Remove carriers and impulses from new samples, and whiten the noise, in place."""

import math

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.signal.carrier_lines import LineCanceller
from uavrt.detection.signal.occupancy import Occupancy
from uavrt.detection.signal.sample_buffer import Counters, SampleBuffer, blank_impulses
from uavrt.detection.signal.sparks import SparkLimiter
from uavrt.detection.signal.tuning import CARRIERS, CHANNEL
from uavrt.detection.signal.whitening import Whitener


class Cleaner:
    """Cleans the samples of one stream; the noise is made white in the searched band."""

    def __init__(
        self,
        *,
        sample_rate_hz: float,
        pulse_width_s: float,
        counters: Counters,
        band_hz: tuple[float, float] | None = None,
    ) -> None:
        self._counters = counters
        self._lines = LineCanceller(sample_rate_hz)
        self._whitener: Whitener | None = None
        self._limiter: SparkLimiter | None = None
        self.occupancy: Occupancy | None = None
        """Counter of the time in which the band's middle is free of other signals."""
        self._ahead = self._steady_ahead = 0
        if band_hz is not None:
            offset_hz, half_width_hz = band_hz
            self._whitener = Whitener(
                sample_rate_hz=sample_rate_hz, offset_hz=offset_hz, half_width_hz=half_width_hz
            )
            self._limiter = SparkLimiter(
                sample_rate_hz=sample_rate_hz, offset_hz=offset_hz, half_width_hz=half_width_hz
            )
            self.occupancy = Occupancy(
                sample_rate_hz=sample_rate_hz, pulse_width_s=pulse_width_s, offset_hz=offset_hz
            )
            self._steady_ahead = self._limiter.reach
            self._ahead = self._steady_ahead + self._whitener.reach
        self._without_lines = 0
        self._blanked = 0
        self._white = 0
        self._steady = 0
        self.flank = max(2, round(0.35 * pulse_width_s * sample_rate_hz))
        """Number of samples examined on either side of an impulse."""
        self._short = max(2, round(0.05 * pulse_width_s * sample_rate_hz))
        self._every = round(CARRIERS.search_every_s * sample_rate_hz)
        self._search_from = 0
        """Sample index at which carriers are searched next."""
        self.floor = 0.0
        """Median power of the channel's samples; 0 before the first call."""
        self.mean_floor = 0.0
        """Mean power of the channel's clean samples, without pulses."""

    @property
    def margin(self) -> int:
        """Number of samples that must follow a stretch before the stretch can be cleaned."""
        ahead = self._whitener.reach if self._whitener is not None and self.whitening else 0
        return self._beyond + self._ahead + ahead

    @property
    def _beyond(self) -> int:
        """Number of samples that must follow a stretch before impulses in it can be found."""
        return self.flank + self._short

    @property
    def many_lines(self) -> bool:
        """True if many carriers are removed, as with mains hum."""
        return self._lines.frequencies_hz.size > CARRIERS.few_lines

    @property
    def whitening(self) -> bool:
        """True if the samples are filtered to make the noise white."""
        return self._whitener is not None and self._whitener.active

    def clean(self, buffer: SampleBuffer, first: int, last: int, *, renew: bool) -> None:
        """Clean the samples [first, last); `renew` measures the median power again."""
        ready = max(self._without_lines, min(buffer.end, last + self.margin))
        buffer.examine(ready)
        if self._whitener is None or self._limiter is None:
            self._cancel_lines(buffer, first, last)
            buffer.silence(first, last)
            self._blank(buffer, first, last, renew=renew)
            return
        begin = max(self._without_lines, buffer.start)
        self._cancel_lines(buffer, begin, ready)
        buffer.silence(begin, ready)
        self._without_lines = ready
        end = min(buffer.end, last + self._ahead)
        begin = max(self._blanked, buffer.start)
        self._blank(buffer, begin, end, renew=renew)
        self._blanked = end
        self._whitener.learn(buffer.view(begin, end))
        if self.occupancy is not None:
            self.occupancy.count(buffer.view(begin, end))
        self._whiten(self._whitener, buffer, last)
        self._make_steady(self._limiter, buffer, last)
        if self._whitener.active or self._limiter.active:
            self.mean_floor = _median_power(buffer.view(first, last)) / math.log(2.0)

    def _whiten(self, whitener: Whitener, buffer: SampleBuffer, last: int) -> None:
        end = min(buffer.end, last + self._steady_ahead)
        begin = max(self._white, buffer.start)
        whitener.filter(
            buffer.view(max(buffer.start, begin - whitener.reach), begin),
            buffer.view(begin, end),
            buffer.view(end, self._blanked),
        )
        if whitener.active:
            buffer.silence(begin, end)
        self._white = end

    def _make_steady(self, limiter: SparkLimiter, buffer: SampleBuffer, last: int) -> None:
        begin = max(self._steady, buffer.start)
        limiter.limit(
            buffer.view(max(buffer.start, begin - limiter.reach), begin),
            buffer.view(begin, last),
            buffer.view(last, self._white),
        )
        self._steady = last

    def _cancel_lines(self, buffer: SampleBuffer, first: int, last: int) -> None:
        look = self._lines.frequencies_hz.size > 0 or last >= self._search_from
        if not look and self._lines.idle:
            return
        first = max(first, buffer.start)
        new = buffer.view(first, last)
        before = buffer.view(max(buffer.start, first - self._lines.needed), first)
        if look:
            self._lines.find(before, new)
            if last - buffer.start >= self._lines.needed:
                self._search_from = last + self._every
        self._lines.subtract(before, new)

    def _blank(self, buffer: SampleBuffer, first: int, last: int, *, renew: bool) -> None:
        """Blank impulses in samples [first, last).

        Impulses are found in whitened samples, so that strong neighbours are not blanked.
        """
        margin = self._beyond
        low = max(buffer.start, first - margin)
        high = min(buffer.end, last + margin)
        stretch = buffer.view(low, high)
        if self._whitener is not None and self._whitener.active:
            white = max(low, self._white)
            ahead = buffer.view(high, min(buffer.end, high + self._whitener.reach))
            before = buffer.view(low, white)
            rest = self._whitener.preview(before, buffer.view(white, high), ahead)
            stretch = np.concatenate((before, rest))
        if not len(stretch):
            return
        if self.floor <= 0.0 or renew:
            self.floor = _median_power(stretch) or self.floor
            self.mean_floor = self.floor / math.log(2.0)
        if self.floor > 0.0:
            blanked = blank_impulses(
                stretch,
                floor=self.floor,
                short=self._short,
                flank=self.flank,
                first=first - low,
                last=last - low,
            )
            for a, b in blanked:
                buffer.view(low + a, low + b)[:] = 0.0
            self._counters.samples_blanked += sum(b - a for a, b in blanked)
            buffer.blanked += [(low + a, low + b) for a, b in blanked]


def _median_power(samples: NDArray[np.complex64]) -> float:
    """Median power of the samples that are not lost (zero); 0 if all are lost."""
    some = samples[:: CHANNEL.floor_stride]
    power = some.real**2 + some.imag**2
    power = power[power > 0.0]
    middle = len(power) // 2
    return float(np.partition(power, middle)[middle]) if len(power) else 0.0
