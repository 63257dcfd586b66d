"""Define the limits on a tag's signal: the searched frequencies, and the tag's interval."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Tag
from uavrt.detection.search.refine import Measured, timing_error_s
from uavrt.detection.signal.frequency_circle import apart_hz
from uavrt.detection.track.tracks import Track, least_real
from uavrt.detection.track.tuning import BOUNDS, FOLLOW


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Limits of frequency and time within which groups and tracks may be those of one tag."""

    tag: Tag
    home_hz: float
    half_width_hz: float
    sample_rate_hz: float
    excluded_hz: tuple[tuple[float, float], ...] = ()

    def excluded_rows(self, offsets_hz: NDArray[np.float64]) -> NDArray[np.intp]:
        """Indices of the spectrogram rows in an excluded band, limits included."""
        inside = np.zeros(len(offsets_hz), np.bool_)
        for low, high in self.excluded_hz:
            inside |= (offsets_hz >= low) & (offsets_hz <= high)
        return np.flatnonzero(inside)

    def refusal(self, places: list[tuple[int, Measured]], rate: int) -> str | None:
        """Reason why the measured pulses of a group cannot be the tag's; None if they can."""
        floor = least_real([pulse.power for _, pulse in places])
        real = [pair for pair in places if pair[1].power >= floor]
        strongest = max((pulse for _, pulse in real), key=lambda pulse: pulse.power)
        if (reason := self.off_frequency(strongest.offset_hz)) is not None:
            return reason
        times = [(place, m.start / self.sample_rate_hz, m.power) for place, m in real]
        return "not the tag's interval" if self._off_interval(times, rate) else None

    def left_by(self, track: Track) -> bool:
        """True if a track has left the frequencies or intervals allowed for the tag."""
        times = [(slot.number, slot.time_s, slot.measured.power) for slot in track.received]
        return self.off_frequency(track.offset_hz) is not None or self._off_interval(
            times, track.rate
        )

    def most_interval_error_s(self, rate: int) -> float:
        """Maximum deviation from a rate's declared interval, with sample clock error [s]."""
        nominal_s = self.tag.pulse_intervals_s
        own_s = nominal_s[rate - 1]
        # One crystal determines both rates: the error of the longer interval is larger.
        most_s = self.tag.interval_uncertainty_s * own_s / min(nominal_s)
        return most_s + BOUNDS.clock_error * own_s

    def off_frequency(self, offset_hz: float) -> str | None:
        """Reason why a signal at a frequency cannot be the tag's; None if it can."""
        if any(low <= offset_hz <= high for low, high in self.excluded_hz):
            return "in an excluded frequency range"
        away_hz = abs(apart_hz(offset_hz, self.home_hz, self.sample_rate_hz))
        if away_hz > self.half_width_hz + BOUNDS.edge_bins / self.tag.pulse_width_s:
            return "outside the frequencies searched"
        return None

    def on_frequency(self, offsets_hz: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(n,) True for frequencies that may be the tag's, by the rules of `off_frequency`."""
        away_hz = offsets_hz - self.home_hz
        away_hz -= self.sample_rate_hz * np.rint(away_hz / self.sample_rate_hz)
        own = np.abs(away_hz) <= self.half_width_hz + BOUNDS.edge_bins / self.tag.pulse_width_s
        for low, high in self.excluded_hz:
            own &= (offsets_hz < low) | (offsets_hz > high)
        return own

    def _off_interval(self, pulses: list[tuple[int, float, float]], rate: int) -> bool:
        """True if pulses (number among the K, time_s, power) do not fit a rate's interval."""
        if len(pulses) < 2:
            return False
        (first, begin_s, weak), (last, end_s, power) = pulses[0], pulses[-1]
        own_s = self.tag.pulse_intervals_s[rate - 1]
        most_s = self.most_interval_error_s(rate)
        width_s = self.tag.pulse_width_s
        noise_s = timing_error_s(width_s, weak) + timing_error_s(width_s, power)
        jitter_s = 2.0 * self.tag.interval_jitter_s + BOUNDS.timing_sigmas * noise_s
        span = last - first
        if span > 0 and abs((end_s - begin_s) / span - own_s) > most_s + jitter_s / span:
            return True
        # Many pulses give the interval far more accurately than the first and the last.
        interval_s, error_s = self._line(pulses)
        return abs(interval_s - own_s) > most_s + BOUNDS.line_sigmas * error_s

    def leaves_open(self, track: Track) -> bool:
        """True if a long group's interval is uncertain: the last pulses of a train that began
        before the stream may fit an interval 2 ms off.
        """
        if self.tag.k <= FOLLOW.most_alone:
            return False
        pulses = [
            (slot.number, slot.time_s, slot.measured.power)
            for slot in track.slots
            if (slot.received or slot.state == "open")
            and slot.measured.power > FOLLOW.weakest_power
        ]
        if len(pulses) < 2:
            return True
        return self._line(pulses)[1] > BOUNDS.known_share * self.most_interval_error_s(
            track.rate
        )

    def _line(self, pulses: list[tuple[int, float, float]]) -> tuple[float, float]:
        # In plain Python: for the few pulses of a track NumPy takes four times as long.
        jitter_s = self.tag.interval_jitter_s / math.sqrt(3.0)
        width_s, begin_s = self.tag.pulse_width_s, pulses[0][1]
        weights = [
            1.0 / (timing_error_s(width_s, power) ** 2 + jitter_s**2) for _, _, power in pulses
        ]
        mean = sum(w * n for w, (n, _, _) in zip(weights, pulses, strict=True)) / sum(weights)
        spread = along = 0.0
        for weight, (number, time_s, _) in zip(weights, pulses, strict=True):
            away = number - mean
            spread += weight * away * away
            along += weight * away * (time_s - begin_s)
        spread = max(spread, 1e-30)
        return along / spread, 1.0 / math.sqrt(spread)
