"""Frequencies of a sampled channel: a circle as long as the sample rate.

What lies beyond one edge of a channel is seen at the other. Single pulses of a tag on an edge
scatter across it; they are compared around the circle, and reported near their
track, which alone has its place in the channel.
"""

import math

USUAL_ERROR_HZ = 500.0
"""A tag is off by no more: nearer to its nominal frequency an edge between them is crossed."""
EDGE_HZ = 2.0
"""A track at an edge must be so far beyond it to be taken for one at the other: more than twice
the scatter of a track of 16 dB, so that a tag 5 Hz inside does not change its place."""


def apart_hz(one_hz: float, two_hz: float, sample_rate_hz: float) -> float:
    """How much higher the first frequency is than the second, the short way around."""
    return math.remainder(one_hz - two_hz, sample_rate_hz)


def in_channel_hz(
    offset_hz: float, *, nominal_hz: float, sample_rate_hz: float, margin_hz: float = 0.0
) -> float:
    """Place a track's frequency in the channel.

    `offset_hz`: relative to the channel's centre, maybe beyond its edges.
    `nominal_hz`: where the tag should be.
    `margin_hz`: leave it where it is unless it is so far beyond an edge.
    Returns: of the frequencies that look alike the one in (-Fs/2, Fs/2], or one less than 500
    Hz from the nominal, be it across an edge.
    """
    miss_hz = apart_hz(offset_hz, nominal_hz, sample_rate_hz)
    if abs(miss_hz) < USUAL_ERROR_HZ:
        return nominal_hz + miss_hz
    if abs(offset_hz) <= sample_rate_hz / 2.0 + margin_hz:
        return offset_hz
    place_hz = -math.remainder(-offset_hz, sample_rate_hz)
    return place_hz if place_hz > -sample_rate_hz / 2.0 else place_hz + sample_rate_hz
