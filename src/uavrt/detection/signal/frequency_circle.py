"""Compare frequencies of a sampled channel, which are periodic in the sample rate.

Pulses of a tag at a channel's edge scatter across it, and are reported at the alias nearest to
their track.
"""

import math

from uavrt.detection.signal.tuning import CHANNEL


def apart_hz(one_hz: float, two_hz: float, sample_rate_hz: float) -> float:
    """Signed difference of two frequencies modulo the sample rate, nearest to zero [Hz]."""
    return math.remainder(one_hz - two_hz, sample_rate_hz)


def in_channel_hz(
    offset_hz: float, *, nominal_hz: float, sample_rate_hz: float, margin_hz: float = 0.0
) -> float:
    """Alias of a track's frequency: near `nominal_hz`, or else within the channel [Hz]."""
    miss_hz = apart_hz(offset_hz, nominal_hz, sample_rate_hz)
    if abs(miss_hz) < CHANNEL.usual_error_hz:
        return nominal_hz + miss_hz
    if abs(offset_hz) <= sample_rate_hz / 2.0 + margin_hz:
        return offset_hz
    place_hz = -math.remainder(-offset_hz, sample_rate_hz)
    return place_hz if place_hz > -sample_rate_hz / 2.0 else place_hz + sample_rate_hz
