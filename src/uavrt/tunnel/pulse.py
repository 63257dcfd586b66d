"""PULSE: one detected pulse with the pose it was heard at.

G0, size 128 (reference/control.md §2.2):

======  ====  ==================================================================
offset  type  field
======  ====  ==================================================================
0       u32   command = 7
4       u32   tag_id
8       u32   frequency_hz
12      4     pad
16      f64   start_time_s, since 1970 UTC
24      f64   predict_next_start_s; 0: none
32      f64   snr_db
40      f64   stft_score
48      u16   group_index
50      6     pad
56      f64   group_snr_db
64      u8    detection_status
65      u8    confirmed_status
66      6     pad
72      f64   position_x: latitude_deg
80      f64   position_y: longitude_deg
88      f64   position_z: altitude_amsl_m
96      f64   orientation_x, 104 _y, 112 _z, 120 _w: unit quaternion
======  ====  ==================================================================

The thesis's header comments call x longitude and z height above launch; its code sends what
stands above, and so do we. Its ``frequency_hz`` was megahertz cut to an integer (148); ours is
hertz.

G1, size 120 (reference/control.md §2.3):

======  ====  ==================================================================
offset  type  field
======  ====  ==================================================================
0–47          as G0
48      u16   group_sequence
50      u16   group_index
52      4     pad
56      f64   group_snr_db
64      f64   noise_psd
72      u8    detection_status: 0 sub-threshold, 1 above, 2 confirmed,
              3 searched and nothing found
73      u8    confirmed_status
74      6     pad
80      f64   latitude_deg
88      f64   longitude_deg
96      f64   altitude_relative_m
104     f32   roll_deg
108     f32   pitch_deg
112     f32   yaw_deg
116     4     pad
======  ====  ==================================================================

Older G1 senders named 104 to 119 a quaternion and filled it with degrees all the same. A G1
pulse with frequency 0 is a detector's sign of life.
"""

import struct
from dataclasses import dataclass
from typing import Self

from uavrt.tunnel.wire import CommandId, pack, unpack

LAYOUT_G0 = struct.Struct("<III4x4dH6xdBB6x7d")
LAYOUT_G1 = struct.Struct("<III4x4dHH4xddBB6x3d3f4x")

STATUS_SUBTHRESHOLD = 0
STATUS_DETECTED = 1
STATUS_CONFIRMED = 2
STATUS_NOTHING_FOUND = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseG0:
    """A pulse as the thesis's ground station reads it."""

    tag_id: int
    frequency_hz: int
    start_time_s: float
    predict_next_start_s: float
    snr_db: float
    stft_score: float
    group_index: int
    group_snr_db: float
    detection_status: int
    confirmed_status: int
    position_x: float
    position_y: float
    position_z: float
    orientation_x: float
    orientation_y: float
    orientation_z: float
    orientation_w: float

    def encode(self) -> bytes:
        """Bytes of the payload."""
        fields = (getattr(self, name) for name in self.__slots__)
        return pack(LAYOUT_G0, CommandId.PULSE, *fields)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Read the payload; raises `TunnelError` for another length or command."""
        values = unpack(LAYOUT_G0, payload, CommandId.PULSE)
        return cls(**dict(zip(cls.__slots__, values, strict=True)))


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseG1:
    """A pulse as newer ground stations read it."""

    tag_id: int
    frequency_hz: int
    start_time_s: float
    predict_next_start_s: float
    snr_db: float
    stft_score: float
    group_sequence: int
    group_index: int
    group_snr_db: float
    noise_psd: float
    detection_status: int
    confirmed_status: int
    latitude_deg: float
    longitude_deg: float
    altitude_relative_m: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float

    def encode(self) -> bytes:
        """Bytes of the payload."""
        fields = (getattr(self, name) for name in self.__slots__)
        return pack(LAYOUT_G1, CommandId.PULSE, *fields)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Read the payload; raises `TunnelError` for another length or command."""
        values = unpack(LAYOUT_G1, payload, CommandId.PULSE)
        return cls(**dict(zip(cls.__slots__, values, strict=True)))
