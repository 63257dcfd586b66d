"""Recognise tags whose pulses come early by varying amounts, which means missing samples."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from uavrt.detection.beeps.points import Points
from uavrt.messages import Beep, BeepKind, Tag
from uavrt.units import ns_from_s

_LEAST_DB: Final = 12.0
"""Least level of the pulses used; noise has few of these."""
_FEWEST: Final = 10
_SHARE: Final = 0.7
"""Share of steps that are a little shorter than the interval."""
_MOST_MISSING: Final = 0.4
"""Largest part of an interval that may be missing between two pulses."""
_LEAST_SPREAD_S: Final = 0.02
"""Least scatter of the steps; less belongs to a train of its own."""
_LATE_S: Final = 0.025


def gapped_tags(
    points: Points, tags: Sequence[Tag], frequency_window_hz: float, start_ns: int
) -> list[Beep]:
    """Find tags with strong pulses at their frequency that come early at irregular intervals.

    `points`: at absolute frequencies, in order of time. `tags`: those without a train.
    """
    found = []
    for tag in tags:
        near = np.abs(points.frequencies_hz - tag.frequency_hz) <= frequency_window_hz
        here = points.take(near & (points.levels_db >= _LEAST_DB))
        if len(here) < _FEWEST:
            continue
        steps_s = np.diff(here.times_s)
        for interval_s in tag.pulse_intervals_s:
            early = steps_s[
                (steps_s >= (1.0 - _MOST_MISSING) * interval_s)
                & (steps_s <= interval_s + _LATE_S)
            ]
            enough = early.size >= _SHARE * steps_s.size and early.size >= _FEWEST - 1
            if not enough or float(np.std(early)) < _LEAST_SPREAD_S:
                continue
            frequency_hz = float(np.median(here.frequencies_hz))
            most_ms = 1e3 * (interval_s - float(early.min()))
            found.append(
                Beep(
                    kind=BeepKind.DOUBTFUL,
                    time_ns=start_ns + ns_from_s(float(here.times_s[-1])),
                    frequency_hz=frequency_hz,
                    interval_s=float(np.median(early)),
                    jitter_s=float(np.std(early)),
                    pulses=len(here),
                    level_db=float(np.median(here.levels_db)),
                    tag_ids=(tag.tag_id,),
                    offsets_hz=(frequency_hz - tag.frequency_hz,),
                    reason=f"up to {most_ms:.0f} ms of samples lost (USB?)",
                )
            )
            break
    return found
