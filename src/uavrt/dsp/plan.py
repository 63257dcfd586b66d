"""Choose decimation and channel count for a sample rate."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from uavrt.core.errors import TunerError, UsageError
from uavrt.dsp.decimator import Mode
from uavrt.dsp.filters import CLEAN_FRACTION

CHANNEL_SPACING_HZ = 3750.0
"""Channel spacing of the original system [Hz]. The spacing used is the nearest that gives a
channel count with small prime factors."""

NARROWEST_BAND_HZ = 375_000.0
"""Minimum sample rate of the band after decimation [Hz]."""

LOWEST_RATE_HZ = 3_000.0
ONE_CHANNEL_RATE_HZ = 14_000.0
"""Maximum sample rate of a recording that is treated as a single channel [Hz]; the filter bank
needs at least four channels."""

HIGHEST_FACTOR = 64
UNDECIMATED_FRACTION = 0.45
"""Half of the usable span without decimation, as a share of the sample rate."""


DEFAULT_WINDOW_HZ = 500.0
"""Half-width of a tag's search band that every channel can hold [Hz]."""
SEARCHED_FRACTION = 0.4
"""Maximum distance of searched frequencies from a channel's centre, as a share of the channel's
rate: 3000 Hz at 7500 Hz.

At this distance the filter bank attenuates signals by 0.3 dB and aliases by 30 dB."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BandPlan:
    """Decimation factor and channels for a sample rate."""

    decimation_factor: int
    band_rate_hz: float
    channel_count: int
    channel_spacing_hz: float
    usable_half_span_hz: float

    def offset_hz(self, from_center_hz: float) -> float:
        """Distance of a frequency from its channel's centre [Hz].

        `from_center_hz`: frequency from the radio's centre.
        """
        half, spacing = self.channel_count // 2, self.channel_spacing_hz
        highest = half - 1 if self.channel_count > 1 else 0
        return from_center_hz - spacing * min(
            max(round(from_center_hz / spacing), -half), highest
        )

    @property
    def channel_rate_hz(self) -> float:
        """Sample rate of one channel [Hz], or of the band if it is not split."""
        return self.channel_spacing_hz * (2.0 if self.channel_count > 1 else 1.0)


def plan_band(sample_rate_hz: float, *, reach_hz: float, mode: Mode = "default") -> BandPlan:
    """Choose the decimation and the channels for a sample rate, such that the usable span
    reaches `reach_hz` from the centre if possible.
    """
    factor = choose_decimation(sample_rate_hz=sample_rate_hz, reach_hz=reach_hz, mode=mode)
    one = sample_rate_hz <= ONE_CHANNEL_RATE_HZ
    band_rate_hz = sample_rate_hz / factor
    count = 1 if one else choose_channel_count(band_rate_hz)
    half_span_hz = usable_half_span_hz(
        band_rate_hz=band_rate_hz, decimated=factor > 1, mode=mode
    )
    return BandPlan(
        decimation_factor=factor,
        band_rate_hz=band_rate_hz,
        channel_count=count,
        channel_spacing_hz=band_rate_hz / count,
        usable_half_span_hz=half_span_hz,
    )


def widest_window_hz(offset_hz: float, channel_rate_hz: float) -> float:
    """Widest half-width of the search at `offset_hz` from a channel's centre [Hz]."""
    return max(DEFAULT_WINDOW_HZ, SEARCHED_FRACTION * channel_rate_hz - abs(offset_hz))


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontEndPlan:
    """Settings of the front end, derived from the sample rate and the tags."""

    mode: Literal["default", "compatible"]
    sample_rate_hz: float
    center_frequency_hz: float
    decimation_factor: int
    """Factor by which the sample rate is decimated; 1: no decimator."""
    band_rate_hz: float
    channel_count: int
    """Number of channels across the decimated band; 1: no channelizer."""
    channel_spacing_hz: float
    channel_rate_hz: float
    usable_half_span_hz: float
    """Maximum distance of a tag from the radio's centre [Hz]."""
    frequencies_hz: tuple[float, ...]
    frequency_channels: tuple[int, ...]
    """Channel number of each frequency in `frequencies_hz`, in their order."""
    channels_in_use: tuple[int, ...]
    """Numbers of the channels that are computed, ascending."""
    channel_centers_hz: tuple[float, ...]
    """Absolute centre frequency of each channel in use [Hz]."""
    latency_s: float
    """Group delay of decimator and channelizer [s], already subtracted from all times."""

    def channel_of(self, frequency_hz: float) -> int:
        """Number of the channel whose centre is nearest to a frequency. Raises `TunerError`
        outside the usable span.
        """
        offset_hz = frequency_hz - self.center_frequency_hz
        if not abs(offset_hz) <= self.usable_half_span_hz:
            raise outside_span(
                [frequency_hz], self.center_frequency_hz, self.usable_half_span_hz
            )
        return round(offset_hz / self.channel_spacing_hz) % self.channel_count


def channel_center_hz(
    center_frequency_hz: float, channel: int, channel_count: int, spacing_hz: float
) -> float:
    """Absolute frequency of a channel's centre [Hz].

    The first half of the channels lies at and above the radio's centre, the rest below. If the
    number is even, the middle channel is at the negative Nyquist frequency.
    """
    signed = channel if 2 * channel < channel_count else channel - channel_count
    return center_frequency_hz + signed * spacing_hz


def outside_span(
    frequencies_hz: Sequence[float], center_hz: float, half_span_hz: float
) -> TunerError:
    """Return the error for frequencies outside the usable span around a radio frequency."""
    listed = ", ".join(f"{frequency / 1e6:.6f}" for frequency in frequencies_hz)
    low, high = (center_hz - half_span_hz) / 1e6, (center_hz + half_span_hz) / 1e6
    return TunerError(
        f"{listed} MHz outside the usable span {low:.6f} to {high:.6f} MHz",
        remedy="Tune the radio nearer to these tags, use a higher sample rate, "
        "or leave these tags out",
    )


def usable_half_span_hz(*, band_rate_hz: float, decimated: bool, mode: Mode) -> float:
    """Maximum usable distance of a tag from the radio's centre [Hz], within the decimator's
    span without aliases.

    The compatible mode uses the whole band with its aliases, as the original system does.
    """
    if mode == "compatible":
        return band_rate_hz / 2
    return band_rate_hz * (CLEAN_FRACTION if decimated else UNDECIMATED_FRACTION)


def widest_half_span_hz(sample_rate_hz: float) -> float:
    """Maximum distance of a tag from the centre of a recording of this rate [Hz]."""
    one_channel = sample_rate_hz <= ONE_CHANNEL_RATE_HZ
    return sample_rate_hz * (0.5 if one_channel else UNDECIMATED_FRACTION)


def choose_decimation(*, sample_rate_hz: float, reach_hz: float, mode: Mode) -> int:
    """Return the largest decimation factor whose usable span reaches `reach_hz` from the
    centre.
    """
    largest = int(sample_rate_hz / NARROWEST_BAND_HZ + 1e-9)
    largest = min(max(largest, 1), HIGHEST_FACTOR)
    if mode == "compatible":
        return largest
    for factor in range(largest, 1, -1):
        span = usable_half_span_hz(
            band_rate_hz=sample_rate_hz / factor, decimated=True, mode=mode
        )
        if reach_hz <= span:
            return factor
    return 1


def choose_channel_count(band_rate_hz: float) -> int:
    """Return the number of channels that gives a spacing nearest to 3750 Hz: even, and without
    a prime factor above 11.
    """
    exact = band_rate_hz / CHANNEL_SPACING_HZ
    nearest = 2 * round(exact / 2)
    candidates = (n for n in range(max(2, nearest - 16), nearest + 17, 2) if _smooth(n))
    return min(candidates, key=lambda n: (abs(band_rate_hz / n - CHANNEL_SPACING_HZ), n))


def fast_length(least: int) -> int:
    """Return the smallest length, at least `least`, without a prime factor above 11, since such
    lengths are fast to transform.
    """
    while not _smooth(least):
        least += 1
    return least


def _smooth(number: int) -> bool:
    for prime in (2, 3, 5, 7, 11):
        while number % prime == 0:
            number //= prime
    return number == 1


def check_rate(sample_rate_hz: float) -> None:
    """Raise `UsageError` for a sample rate that no plan supports."""
    highest = HIGHEST_FACTOR * NARROWEST_BAND_HZ
    if not LOWEST_RATE_HZ <= sample_rate_hz <= highest:
        raise UsageError(
            f"the sample rate {sample_rate_hz:g} Hz is not supported",
            remedy=f"Use {LOWEST_RATE_HZ:g} to {highest:g} samples a second",
        )
