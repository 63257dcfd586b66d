"""Pulses of a log in memory, as the readers of all formats return them."""

import math
from dataclasses import dataclass
from typing import Literal

from uavrt.core.messages import Pulse, PulsePose

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
"""Kinds of logs that contain no compass headings. They give no bearings, and a whip antenna is
assumed unless another antenna is named."""
NUMBERED_BY_FREQUENCY = frozenset({"ucsd", "pyradiotracking", "sensorgnome"})
"""Kinds of pulse logs that have no tag list; in two such logs, a number can mean different
tags."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RotationMark:
    """Position at which the original system's ground station started or stopped a rotation."""

    kind: Literal["start", "stop"]
    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    before_pulse: int
    """Number of pulses in the log before the rotation's mark."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseLog:
    """Pulses, rotation marks and warnings from a pulse log of any kind."""

    kind: LogKind
    pulse_poses: tuple[PulsePose, ...]
    marks: tuple[RotationMark, ...] = ()
    warnings: tuple[str, ...] = ()
    """Sentences for the user about limitations of the pulses in this log."""
    passed_over: int = 0
    """Number of rows without a pulse; each is a rotation slice without a detection."""


def ungrouped_pulse(
    tag_id: int,
    frequency_hz: float,
    start_ns: int,
    end_ns: int,
    snr_db: float,
    *,
    noise_db: float = math.nan,
    confirmed: bool = False,
) -> Pulse:
    """Create a pulse for a log that has no pulse groups; `noise_db` is the noise density."""
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
