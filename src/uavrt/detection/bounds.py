"""What a tag's signal must keep to: the frequencies that are searched, and its interval."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.circle import apart_hz
from uavrt.detection.refine import Measured, timing_error_s
from uavrt.detection.tracks import CLOCK_ERROR, Track, least_real
from uavrt.messages import Tag

_EDGE_BINS = 0.5
"""So far beyond the band a signal may be measured: half of what a pulse is wide."""
_SIGMAS = 2.5
"""Of the time that noise gives a pulse."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Bounds of one tag's groups and tracks.

    Attributes
    ----------
    tag : Tag
    home_hz : float
        Middle of the search, relative to the channel's centre.
    half_width_hz : float
        Of the search; at or above half the sample rate: the whole channel.
    sample_rate_hz : float
    excluded_hz : tuple of (float, float)
        Stretches in which nothing is the tag, relative to the channel's centre.
    """

    tag: Tag
    home_hz: float
    half_width_hz: float
    sample_rate_hz: float
    excluded_hz: tuple[tuple[float, float], ...] = ()

    def excluded_rows(self, offsets_hz: NDArray[np.float64]) -> NDArray[np.intp]:
        """Which rows lie in an excluded stretch, bounds included."""
        inside = np.zeros(len(offsets_hz), np.bool_)
        for low, high in self.excluded_hz:
            inside |= (offsets_hz >= low) & (offsets_hz <= high)
        return np.flatnonzero(inside)

    def refusal(self, places: list[tuple[int, Measured]], rate: int) -> str | None:
        """Why the measured pulses of a group are not the tag's, or None.

        Parameters
        ----------
        places : list of (int, Measured)
            Places among the K, in order of time.
        rate : int
        """
        floor = least_real([pulse.power for _, pulse in places])
        real = [pair for pair in places if pair[1].power >= floor]
        strongest = max((pulse for _, pulse in real), key=lambda pulse: pulse.power)
        if (reason := self.off_frequency(strongest.offset_hz)) is not None:
            return reason
        times = [(place, m.start / self.sample_rate_hz, m.power) for place, m in real]
        return "not the tag's interval" if self._off_interval(times, rate) else None

    def left_by(self, track: Track) -> bool:
        """Whether a track has gone where the tag cannot be."""
        times = [
            (slot.number, slot.time_s, slot.measured.power)
            for slot in track.slots
            if slot.state in ("accepted", "reported")
        ]
        return self.off_frequency(track.offset_hz) is not None or self._off_interval(
            times, track.rate
        )

    def off_frequency(self, offset_hz: float) -> str | None:
        """Why a frequency is not the tag's, or None."""
        if any(low <= offset_hz <= high for low, high in self.excluded_hz):
            return "in an excluded stretch"
        away_hz = abs(apart_hz(offset_hz, self.home_hz, self.sample_rate_hz))
        if away_hz > self.half_width_hz + _EDGE_BINS / self.tag.pulse_width_s:
            return "outside the frequencies searched"
        return None

    def _off_interval(self, pulses: list[tuple[int, float, float]], rate: int) -> bool:
        """Whether pulses, as (place, time_s, power), cannot be of one rate."""
        if len(pulses) < 2:
            return False
        (first, begin_s, weak), (last, end_s, power) = pulses[0], pulses[-1]
        nominal_s = self.tag.pulse_intervals_s
        own_s = nominal_s[rate - 1]
        # One crystal makes both rates: of the longer interval it errs by more.
        most_s = self.tag.interval_uncertainty_s * own_s / min(nominal_s)
        most_s += CLOCK_ERROR * own_s
        width_s = self.tag.pulse_width_s
        noise_s = timing_error_s(width_s, weak) + timing_error_s(width_s, power)
        jitter_s = 2.0 * self.tag.interval_jitter_s + _SIGMAS * noise_s
        span = last - first
        return span > 0 and abs((end_s - begin_s) / span - own_s) > most_s + jitter_s / span
