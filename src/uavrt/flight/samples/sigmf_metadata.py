"""Create SigMF metadata for a recording with gaps.

Each stretch of samples without a gap is an entry of ``captures`` with its time and its position
in the radio's stream (``core:global_index``). Each gap is also an annotation, which viewers
display (SigMF 1.2, https://sigmf.org).
"""

import itertools
from dataclasses import dataclass
from typing import Any

import uavrt
from uavrt.core.clock import iso_utc
from uavrt.core.units import NANOSECONDS_PER_SECOND, SIGMF_FULL_SCALE

FULL_SCALE = {8: 128.0, 16: 32_768.0}
"""Stored value for an input of 1.0, by bits per value; readers divide stored values by it."""
_DATATYPES = {8: "ci8", 16: "ci16_le"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """Position and time of a stretch of samples without a gap."""

    sample_start: int
    """Index in the file of the stretch's first sample."""
    global_index: int
    """Index of the stretch's first sample in the radio's stream; lost samples are counted."""
    time_ns: int


def sigmf_metadata(
    stretches: list[Stretch],
    *,
    sample_rate_hz: float,
    center_frequency_hz: float,
    hardware: str,
    description: str,
    full_scale: float = 1.0,
    bits: int = 16,
) -> dict[str, Any]:
    """Create the metadata of a recording in ``ci16_le``, or in ``ci8`` with 8 `bits`."""
    annotations = []
    for before, after in itertools.pairwise(stretches):
        recorded = after.sample_start - before.sample_start
        missing = after.global_index - before.global_index - recorded
        if not missing:
            continue  # the clock has moved
        annotations.append(
            {
                "core:sample_start": after.sample_start,
                "core:sample_count": 0,
                "core:label": "gap",
                "core:comment": f"{missing} samples are missing before this one",
                "core:generator": "uavrt",
            }
        )
    return {
        "global": {
            "core:datatype": _DATATYPES[bits],
            "core:version": "1.2.0",
            "core:sample_rate": sample_rate_hz,
            "core:num_channels": 1,
            "core:hw": hardware,
            "core:description": description,
            "core:recorder": f"uavrt {uavrt.__version__}",
            **_own_scale(full_scale),
        },
        "captures": [
            {
                "core:sample_start": stretch.sample_start,
                "core:global_index": stretch.global_index,
                "core:frequency": center_frequency_hz,
                "core:datetime": _nanosecond_stamp(stretch.time_ns),
            }
            for stretch in stretches
        ],
        "annotations": annotations,
    }


def _own_scale(full_scale: float) -> dict[str, Any]:
    """Metadata entries for a full scale that differs from the default."""
    if full_scale == 1.0:
        return {}
    extension = {"name": "uavrt", "version": "1.0.0", "optional": True}
    return {"core:extensions": [extension], SIGMF_FULL_SCALE: full_scale}


def _nanosecond_stamp(time_ns: int) -> str:
    seconds = iso_utc(time_ns // NANOSECONDS_PER_SECOND * NANOSECONDS_PER_SECOND)[:19]
    return f"{seconds}.{time_ns % NANOSECONDS_PER_SECOND:09d}Z"
