"""G0: the messages of the thesis (February 2023).

A command without fields is its number, u32, alone: START_TAGS 2, END_TAGS 3, START_DETECTION 5,
STOP_DETECTION 6. In G1 the other commands are unchanged, and START_DETECTION has fields.

ACK, size 12::

    offset  type  field
    0       u32   command = 1
    4       u32   acked_command
    8       u32   result: 1 success, 0 failure

The thesis's Table 2.16 prints 2 for failure; its header file, which is what ran, says 0.

TAG, size 48::

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

The original names are ``intra_pulse1_msecs`` and so on.

PULSE, size 128::

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

The thesis's header comments call x longitude and z height above launch; its code sends what
stands above, and so does uavrt. The thesis's ``frequency_hz`` was megahertz cut to an integer
(148); uavrt sends hertz.
"""

import struct
from dataclasses import dataclass
from typing import ClassVar

from uavrt.core.commands import CommandId
from uavrt.link.tunnel.generations.wire import (
    Decoders,
    Fixed,
    decoders_by_length,
    decoders_of,
)

SUCCESS = 1
FAILURE = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class HeaderMessage(Fixed):
    """A command without fields; START_DETECTION has no fields only in G0."""

    LAYOUT: ClassVar = struct.Struct("<I")
    command: CommandId


@dataclass(frozen=True, slots=True, kw_only=True)
class AckG0(Fixed):
    """Acknowledgement of generation G0, which has no text."""

    COMMAND: ClassVar = CommandId.ACK
    LAYOUT: ClassVar = struct.Struct("<III")
    acked_command: int
    result: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TagG0(Fixed):
    """A tag to search for, as the thesis's ground station sends it."""

    COMMAND: ClassVar = CommandId.TAG
    LAYOUT: ClassVar = struct.Struct("<9I4xd")
    tag_id: int
    frequency_hz: int
    pulse_width_ms: int
    interval1_ms: int
    interval2_ms: int
    interval_uncertainty_ms: int
    interval_jitter_ms: int
    k: int
    false_alarm_probability: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseG0(Fixed):
    """A pulse, as the thesis's ground station receives it."""

    COMMAND: ClassVar = CommandId.PULSE
    LAYOUT: ClassVar = struct.Struct("<III4x4dH6xdBB6x7d")
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


Messages = HeaderMessage | AckG0 | TagG0 | PulseG0
DECODERS: Decoders = {
    **decoders_by_length("G0", 4, HeaderMessage.decode),
    **decoders_of(AckG0, TagG0, PulseG0),
}
