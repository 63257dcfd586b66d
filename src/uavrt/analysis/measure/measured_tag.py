"""Measured properties of a tag, and the tag list entry derived from them."""

import math
from dataclasses import dataclass
from typing import Final

from uavrt.core.messages import Tag

INTERVAL_MARGIN: Final = 0.01
"""Suggested relative uncertainty of the interval. With temperature and battery, a tag's
interval changes by some tenths of a percent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredRate:
    """One of a tag's pulse intervals, as measured in a recording."""

    interval_s: float
    interval_sigma_s: float
    jitter_s: float
    """Standard deviation of pulse times from equal intervals [s], with measurement error."""
    largest_deviation_s: float
    drift: float
    drift_sigma: float
    pulses: int
    missing: int
    """Number of missing pulses between the first and the last one at this interval."""
    first_time_ns: int
    last_time_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredTag:
    """A tag as measured in a recording; each sigma is one standard deviation."""

    frequency_hz: float
    """Tag's frequency in the recording's middle, relative to the radio's crystal [Hz]."""
    frequency_sigma_hz: float
    drift_hz_per_s: float
    drift_sigma_hz_per_s: float
    pulse_width_s: float
    pulse_width_sigma_s: float
    enr_db: float
    """Median of the tag's pulse energies divided by the noise density [dB]."""
    slide_hz: float
    """Change of the frequency from the start to the end of a pulse [Hz]; 0 if it is too small
    to matter. The frequency is then that at half the pulse's length."""
    pulses: int
    rates: tuple[MeasuredRate, ...]
    """Pulse intervals of the tag, sorted by number of pulses, largest first."""

    def entry(self, tag_id: int, name: str | None = None) -> Tag:
        """Return a tag list entry of at most two intervals, with margins for seasonal changes.

        The tolerance of the interval is 1 %, or the measured uncertainty if that is greater.
        The jitter is a quarter above the largest deviation.
        """
        rates = self.rates[:2]
        interval_s = max(rate.interval_s for rate in rates)
        uncertainty_s = max(
            INTERVAL_MARGIN * interval_s, *(3.0 * rate.interval_sigma_s for rate in rates)
        )
        jitter_s = 1.25 * max(rate.largest_deviation_s for rate in rates)
        return Tag(
            tag_id=tag_id,
            frequency_hz=float(round(self.frequency_hz)),
            pulse_width_s=round(self.pulse_width_s, 4),
            pulse_intervals_s=tuple(round(rate.interval_s, 5) for rate in rates),
            interval_uncertainty_s=math.ceil(1e3 * uncertainty_s) / 1e3,
            interval_jitter_s=max(2, math.ceil(1e3 * jitter_s)) / 1e3,
            name=name,
            frequency_slide_hz=float(round(self.slide_hz, -1)),
        )
