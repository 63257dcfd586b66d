"""Compare frequencies of a sampled channel, which are periodic in the sample rate.

A signal beyond one edge of a channel appears at the other. Single pulses of a tag at an edge
scatter across it; they are compared around the circle, and reported at the frequency nearest to
that of their track.
"""

import math

USUAL_ERROR_HZ = 500.0
"""Largest error of a tag's frequency, used to decide on which side of an edge it is."""
EDGE_HZ = 2.0
"""Distance beyond an edge from which a track is moved to the other: more than twice the scatter
of a track of 16 dB, so that a tag 5 Hz inside keeps its frequency."""


def apart_hz(one_hz: float, two_hz: float, sample_rate_hz: float) -> float:
    """Difference of two frequencies by the shorter way around the circle."""
    return math.remainder(one_hz - two_hz, sample_rate_hz)


def in_channel_hz(
    offset_hz: float, *, nominal_hz: float, sample_rate_hz: float, margin_hz: float = 0.0
) -> float:
    """Choose among the aliases of a track's frequency.

    `offset_hz`: relative to the channel's centre, maybe beyond its edges. `nominal_hz`: the
    tag's expected frequency. `margin_hz`: leave it unchanged unless it is so far beyond an
    edge. Returns the one in (-Fs/2, Fs/2], or one less than 500 Hz from the nominal, even
    across an edge.
    """
    miss_hz = apart_hz(offset_hz, nominal_hz, sample_rate_hz)
    if abs(miss_hz) < USUAL_ERROR_HZ:
        return nominal_hz + miss_hz
    if abs(offset_hz) <= sample_rate_hz / 2.0 + margin_hz:
        return offset_hz
    place_hz = -math.remainder(-offset_hz, sample_rate_hz)
    return place_hz if place_hz > -sample_rate_hz / 2.0 else place_hz + sample_rate_hz
