"""What a reader of pulse logs hands out, whichever format it read."""

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
"""Taken with an upright whip unless an antenna is named: no bearings follow from them."""
NUMBERED_BY_FREQUENCY = frozenset({"ucsd", "pyradiotracking", "sensorgnome"})
"""Have no list of tags: a number in one of them is another tag's in the next."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RotationMark:
    """Where the original's ground station started or stopped a rotation."""

    kind: Literal["start", "stop"]
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    before_pulse: int
    """Place among the log's pulses: this many came before the mark."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseLog:
    """A pulse log of any kind."""

    kind: LogKind
    pulse_poses: tuple[PulsePose, ...]
    marks: tuple[RotationMark, ...] = ()
    warnings: tuple[str, ...] = ()
    """What somebody who works with these pulses must know; sentences."""
    passed_over: int = 0
    """Rows that report no pulse: rotation slices with nothing found."""


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
    """Make a pulse of a log that knows no groups of pulses; `noise_db` is its noise density."""
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
