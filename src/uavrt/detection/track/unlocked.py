"""Detect in the mode that never locks: every group of pulses is found independently.

No track predicts the next pulse; each reported pulse belongs to a group that reached the
threshold of the search. Groups with common pulses are joined. As in the other modes, K
consecutive expected pulses, counted from the first one, are numbered as one group. A group that
continues the previous group in time and frequency confirms it, as in the original detector.
"""

import math
from collections.abc import Callable

from uavrt.detection.search.refine import Measured
from uavrt.detection.signal.frequency_circle import apart_hz
from uavrt.detection.track.chance import BurstRates
from uavrt.detection.track.tracks import Track
from uavrt.detection.track.tuning import BOUNDS

FoundPulse = tuple[int, float, int, Measured]
"""Pulse of a group: its number among the K, its time [s] and [ns], and its measurement."""


def join_group(
    tracks: list[Track],
    pulses: list[FoundPulse],
    *,
    rate: int,
    sample_rate_hz: float,
    around: Callable[[Track, Measured], BurstRates],
) -> Track | None:
    """Join a group to the track that it continues; return the track, or None."""
    onto = _continued(tracks, pulses, rate=rate, sample_rate_hz=sample_rate_hz)
    if onto is None:
        return None
    track, base = onto
    track.join(pulses, base, around)
    return track


def _continued(
    tracks: list[Track], pulses: list[FoundPulse], *, rate: int, sample_rate_hz: float
) -> tuple[Track, int] | None:
    """Find the track that a group continues, and the number of the group's first pulse."""
    strongest = max((pulse[3] for pulse in pulses), key=lambda measured: measured.power)
    for track in tracks:
        if track.rate != rate:
            continue
        miss_hz = apart_hz(strongest.offset_hz, track.offset_hz, sample_rate_hz)
        if abs(miss_hz) > BOUNDS.same_group_hz:
            continue
        for place, time_s, _, _ in pulses:
            for slot in track.slots:
                if abs(slot.time_s - time_s) < 0.75 * track.tag.pulse_width_s:
                    return track, slot.number - place
        place, time_s = pulses[0][0], pulses[0][1]
        ahead = round((time_s - track.time_s) / track.interval_s)
        if not 1 <= ahead <= track.tag.k + 1:
            continue
        phase, cross, interval = track.variance
        spread = math.sqrt(max(0.0, phase + 2.0 * ahead * cross + ahead**2 * interval))
        reach_s = 2.5 * spread + track.tag.interval_jitter_s + track.tag.pulse_width_s / 8.0
        if abs(time_s - track.time_s - ahead * track.interval_s) < reach_s:
            return track, track.number + ahead - place
    return None


def drop_old(tracks: list[Track], now_s: float) -> None:
    """Delete groups, in place, that a new group can no longer continue."""
    tracks[:] = [
        t
        for t in tracks
        if now_s - t.time_s < (2.0 * t.tag.k + 1.0) * max(t.tag.pulse_intervals_s)
    ]
