"""Recognise tags in a stream with missing samples, whose pulses come early by varying times."""

from collections.abc import Sequence

import numpy as np

from uavrt.core.messages import Beep, BeepKind, Tag
from uavrt.core.units import ns_from_s
from uavrt.detection.beeps.beep_points import Points
from uavrt.detection.beeps.tuning import NAMING


def gapped_tags(
    points: Points, tags: Sequence[Tag], frequency_window_hz: float, start_ns: int
) -> list[Beep]:
    """Find tags whose strong pulses come early by varying times, as if samples are missing.

    `points`: pulses at absolute frequencies, in order of time. `tags`: tags without a train of
    pulses.
    """
    found = []
    strong = points.take(points.levels_db >= NAMING.gap_level_db)
    for tag in tags:
        near = np.abs(strong.frequencies_hz - tag.frequency_hz) <= frequency_window_hz
        here = strong.take(near)
        if len(here) < NAMING.gap_pulses:
            continue
        steps_s = np.diff(here.times_s)
        for interval_s in tag.pulse_intervals_s:
            early = steps_s[
                (steps_s >= (1.0 - NAMING.most_missing_share) * interval_s)
                & (steps_s <= interval_s + NAMING.late_s)
            ]
            enough = (
                early.size >= NAMING.gap_share * steps_s.size
                and early.size >= NAMING.gap_pulses - 1
            )
            if not enough or float(np.std(early)) < NAMING.least_gap_spread_s:
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
