"""G1: the newest messages without a version number (April 2026).

What it did not change is as in `uavrt.link.tunnel.generations.g0`; SAVE_LOGS 12, CLEAN_LOGS 13
and AIRSPY_STATUS 14 are new commands without fields.

ACK, size 128::

    offset  type       field
    0–11               as G0
    12      char[116]  message, NUL-terminated

The message holds the log directory after a successful START_DETECTION and the reason after a
failure.

TAG, size 88::

    0–47          as G0
    48      u32   channel_number, from 1
    52      u32   channel_center_frequency_hz
    56      f64   interval1_mean (NaN: unknown)
    64      f64   interval1_deviation
    72      f64   interval2_mean
    80      f64   interval2_deviation

Commands with fields have those of their row in `uavrt.core.commands`, aligned as in C.

START_DETECTION, begin to search for the uploaded tags, grew: sizes 12, 16, 32 and 40 are all in
the field and accepted; uavrt sends 40::

    0       u32   command = 5
    4       u32   radio_center_frequency_hz
    8       u32   gain
    12      u32   detection_mode: 0 ``uavrt_detection``, 1 Python   (from size 16)
    16      f64   detection_margin; 0: the default 0.90             (from size 32)
    24      f64   confidence_ratio; 0: the default 1.3              (from size 32)
    32      u32   debug_detector                                    (size 40)
    36      4     pad                                               (size 40)

RAW_CAPTURE, record a few seconds of samples to a file, sizes 8 and 12, the latter newest::

    0       u32   command = 8
    4       u32   gain
    8       u32   frequency_hz                                      (size 12)

HEARTBEAT, state of the drone once a second, size 12; a tunnel message, unrelated to MAVLink's
HEARTBEAT; the thesis had none::

    0       u32   command = 9
    4       u16   system_id: 1 controller, 2 channelizer
    6       u16   status: 0 idle, 1 receiving tags, 2 has tags, 3 detecting, 4 raw capture
    8       f32   cpu_temperature_c

PULSE, size 120::

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

Older senders named 104 to 119 a quaternion and filled it with degrees all the same. A pulse
with frequency 0 is a detector's heartbeat.
"""

import math
import struct
from dataclasses import dataclass
from typing import ClassVar

from uavrt.core.commands import CommandId, SystemState
from uavrt.link.tunnel.generations.g0 import HeaderMessage
from uavrt.link.tunnel.generations.wire import (
    CommandMessage,
    Decoders,
    Fixed,
    decoders_by_length,
    decoders_of,
)

STATUS_SUBTHRESHOLD = 0
STATUS_DETECTED = 1
STATUS_CONFIRMED = 2
STATUS_NOTHING_FOUND = 3

SYSTEM_CONTROLLER = 1

STATUS_NUMBERS: dict[SystemState, int] = {
    SystemState.IDLE: 0,
    SystemState.RECEIVING_TAGS: 1,
    SystemState.HAS_TAGS: 2,
    SystemState.DETECTING: 3,
    SystemState.CAPTURING: 4,
}
STATES: dict[int, SystemState] = {number: state for state, number in STATUS_NUMBERS.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class AckG1(Fixed):
    """Acknowledgement with a reason; the message is cut to 115 bytes."""

    COMMAND: ClassVar = CommandId.ACK
    LAYOUT: ClassVar = struct.Struct("<III116s")
    TEXT_SIZE: ClassVar = 116
    acked_command: int
    result: int
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TagG1(Fixed):
    """A tag to search for, as ground stations from G1 on send it."""

    COMMAND: ClassVar = CommandId.TAG
    LAYOUT: ClassVar = struct.Struct("<9I4xdII4d")
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


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldsG1(CommandMessage):
    """A command with fields, as ground stations from G1 on send it."""

    GENERATION: ClassVar = "G1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Heartbeat(Fixed):
    """Heartbeat of the drone: state and processor temperature."""

    COMMAND: ClassVar = CommandId.HEARTBEAT
    LAYOUT: ClassVar = struct.Struct("<IHHf")
    system_id: int
    status: int
    cpu_temperature_c: float

    @property
    def state(self) -> SystemState | None:
        """State of the drone; None for an unknown status number."""
        return STATES.get(self.status)


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseG1(Fixed):
    """A pulse for ground stations from G1 on; undetected and without pose by default."""

    COMMAND: ClassVar = CommandId.PULSE
    LAYOUT: ClassVar = struct.Struct("<III4x4dHH4xddBB6x3d3f4x")
    tag_id: int
    frequency_hz: int
    start_time_s: float
    predict_next_start_s: float = 0.0
    snr_db: float = 0.0
    stft_score: float = 0.0
    group_sequence: int = 0
    group_index: int = 0
    group_snr_db: float = 0.0
    noise_psd: float = 0.0
    detection_status: int = 0
    confirmed_status: int = 0
    latitude_deg: float = math.nan
    longitude_deg: float = math.nan
    altitude_relative_m: float = math.nan
    roll_deg: float = math.nan
    pitch_deg: float = math.nan
    yaw_deg: float = math.nan


Messages = AckG1 | TagG1 | FieldsG1 | Heartbeat | PulseG1
DECODERS: Decoders = {
    **decoders_by_length("G1", 4, HeaderMessage.decode),
    **decoders_of(AckG1, TagG1, Heartbeat, PulseG1),
    **FieldsG1.decoders(),
}
