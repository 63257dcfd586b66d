"""G0: the messages of the thesis (February 2023); layouts: the manual's tunnel reference."""

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
