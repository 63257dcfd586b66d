"""A pulse log as its reader returns it, whichever format it read."""

import math
from dataclasses import dataclass
from typing import Literal

from uavrt.messages import Pulse, PulsePose

LogKind = Literal[
    "flight",
    "uavrt-jsonl",
    "uavrt-csv",
    "pulse_pose_log",
    "tagtracker",
    "ucsd",
    "pyradiotracking",
    "sensorgnome",
    "detections",
]

WITHOUT_HEADINGS = frozenset({"ucsd", "sensorgnome", "detections"})
"""Logs without headings: read with a whip unless an antenna is named, and without bearings."""
NUMBERED_BY_FREQUENCY = frozenset({"ucsd", "pyradiotracking", "sensorgnome"})
"""Logs without a list of tags: the same number can be another tag in another log."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RotationMark:
    """Where the original's ground station started or stopped a rotation."""

    kind: Literal["start", "stop"]
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    before_pulse: int
    """Number of the log's pulses before the mark."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseLog:
    """A pulse log of any kind."""

    kind: LogKind
    pulse_poses: tuple[PulsePose, ...]
    marks: tuple[RotationMark, ...] = ()
    warnings: tuple[str, ...] = ()
    """Sentences on limits that users of these pulses must know."""
    passed_over: int = 0
    """Rows without a pulse: rotation slices with nothing found."""


def heard_pulse(
    tag_id: int,
    frequency_hz: float,
    start_ns: int,
    end_ns: int,
    snr_db: float,
    *,
    noise_db: float = math.nan,
    confirmed: bool = False,
) -> Pulse:
    """Make a pulse of a log without groups of pulses; `noise_db` is its noise density."""
    return Pulse(
        tag_id=tag_id,
        frequency_hz=frequency_hz,
        start_time_ns=start_ns,
        end_time_ns=end_ns,
        snr_db=snr_db,
        group_snr_db=snr_db,
        score=math.nan,
        group_index=1,
        group_sequence=0,
        noise_psd=10.0 ** (noise_db / 10.0),
        detection_status="confirmed" if confirmed else "detected",
        confirmed=confirmed,
        rate=1,
        predicted_next_start_ns=None,
        predicted_next_end_ns=None,
    )
