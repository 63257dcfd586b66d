"""G1: the newest messages without a version number (April 2026).

Layouts: the manual's tunnel reference. What G1 did not change is in `generations.g0`.
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
