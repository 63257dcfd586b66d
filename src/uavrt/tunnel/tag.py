"""TAG: one radio tag to search for.

======  ====  ===========================================================
offset  type  field
======  ====  ===========================================================
0       u32   command = 4
4       u32   tag_id
8       u32   frequency_hz
12      u32   pulse_width_ms
16      u32   interval1_ms, first rate
20      u32   interval2_ms, second rate; 0: none
24      u32   interval_uncertainty_ms
28      u32   interval_jitter_ms
32      u32   k
36      4     pad
40      f64   false_alarm_probability
48      u32   channel_number, from 1 (G1 only)
52      u32   channel_center_frequency_hz (G1 only)
56      f64   interval1_mean (G1 only; NaN: unknown)
64      f64   interval1_deviation (G1 only; NaN: unknown)
72      f64   interval2_mean (G1 only; NaN: unknown)
80      f64   interval2_deviation (G1 only; NaN: unknown)
======  ====  ===========================================================

Size 48 in G0, 88 in G1 (reference/control.md §2.2, §2.3). The original names are
``intra_pulse1_msecs`` and so on, and ``ip1_mu``, ``ip1_sigma``.
"""

import math
import struct
from dataclasses import dataclass
from typing import Self

from uavrt.tunnel.wire import CommandId, pack, unpack

LAYOUT_G0 = struct.Struct("<9I4xd")
LAYOUT_G1 = struct.Struct("<9I4xdII4d")


@dataclass(frozen=True, slots=True, kw_only=True)
class TagG0:
    """A tag as the thesis's ground station sends it."""

    tag_id: int
    frequency_hz: int
    pulse_width_ms: int
    interval1_ms: int
    interval2_ms: int
    interval_uncertainty_ms: int
    interval_jitter_ms: int
    k: int
    false_alarm_probability: float

    def encode(self) -> bytes:
        """Bytes of the payload."""
        fields = (getattr(self, name) for name in self.__slots__)
        return pack(LAYOUT_G0, CommandId.TAG, *fields)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Read the payload; raises `TunnelError` for another length or command."""
        values = unpack(LAYOUT_G0, payload, CommandId.TAG)
        return cls(**dict(zip(cls.__slots__, values, strict=True)))


@dataclass(frozen=True, slots=True, kw_only=True)
class TagG1:
    """A tag as newer ground stations send it."""

    tag_id: int
    frequency_hz: int
    pulse_width_ms: int
    interval1_ms: int
    interval2_ms: int
    interval_uncertainty_ms: int
    interval_jitter_ms: int
    k: int
    false_alarm_probability: float
    channel_number: int = 0
    channel_center_frequency_hz: int = 0
    interval1_mean: float = math.nan
    interval1_deviation: float = math.nan
    interval2_mean: float = math.nan
    interval2_deviation: float = math.nan

    def encode(self) -> bytes:
        """Bytes of the payload."""
        fields = (getattr(self, name) for name in self.__slots__)
        return pack(LAYOUT_G1, CommandId.TAG, *fields)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Read the payload; raises `TunnelError` for another length or command."""
        values = unpack(LAYOUT_G1, payload, CommandId.TAG)
        return cls(**dict(zip(cls.__slots__, values, strict=True)))
