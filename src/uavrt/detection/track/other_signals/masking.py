"""Subtract pulses of a stronger tag that hide those of a weaker tag.

A rectangular pulse of length tp leaks up to 1 / (pi df tp)^2 of its power to a frequency df
away. A pulse 20 dB stronger and 100 Hz away hides a tag's pulse whenever the two overlap. The
stronger pulse's time, frequency and amplitude are known from its track, so it can be
subtracted.
"""

from uavrt.detection.search.refine import Measured
from uavrt.detection.signal.frequency_circle import apart_hz
from uavrt.detection.track.tracks import Track
from uavrt.detection.track.tuning import FOLLOW


def level(track: Track) -> float:
    """Mean power of a track's newest pulses [noise powers]; 0 without pulses."""
    powers = [slot.measured.power for slot in track.received]
    return sum(powers[-4:]) / len(powers[-4:]) if powers else 0.0


def strongest_first(tracks: list[Track]) -> list[Track]:
    """Tracks in the order in which to follow them: the strongest first."""
    return sorted(tracks, key=level, reverse=True) if len(tracks) > 1 else list(tracks)


def stronger_tracks(track: Track, tracks: list[Track], *, sample_rate_hz: float) -> list[Track]:
    """Tracks that may hide a track's pulses: stronger ones at another frequency."""
    if len(tracks) < 2:
        return []
    least = FOLLOW.hiding_ratio * level(track)
    least_hz = FOLLOW.hiding_bins / track.tag.pulse_width_s
    return [
        other
        for other in tracks
        if other.confirmed
        and not other.dead
        and level(other) > least
        and abs(apart_hz(other.offset_hz, track.offset_hz, sample_rate_hz)) > least_hz
    ]


def is_due(others: list[Track], *, earliest_s: float, latest_s: float) -> bool:
    """True if a stronger track still has to search for its pulse between two times."""
    for other in others:
        time_s, half_s = other.expected()
        if time_s + half_s > earliest_s and time_s - half_s < latest_s:
            return True
    return False


def hiding(
    track: Track, others: list[Track], *, earliest_s: float, latest_s: float
) -> list[Measured]:
    """Pulses of other tracks between two times that are stronger than those of this track."""
    least = FOLLOW.hiding_ratio * level(track)
    return [
        slot.measured
        for other in others
        for slot in other.slots
        if earliest_s < slot.time_s < latest_s and slot.measured.power > least
    ]
