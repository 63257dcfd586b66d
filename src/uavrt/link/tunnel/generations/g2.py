"""G2: the messages of the numbered versions of the protocol.

Version 1 ("G2v1") has the header of G1. From version 4 on ("G2") every payload begins with the
command and a request id. Layouts: the manual's tunnel reference.
"""

import struct
from dataclasses import dataclass
from typing import ClassVar, Self

from uavrt.core.commands import CommandId, Generation
from uavrt.link.tunnel.generations.g1 import PulseG1, TagG1
from uavrt.link.tunnel.generations.wire import (
    CommandMessage,
    Decoders,
    Fixed,
    check,
    decoders_by_length,
    decoders_of,
    pack,
)

HEADER = struct.Struct("<II")
UPLOAD = struct.Struct("<IIII")

RUNNING, COMPLETE, FAILED = 0, 1, 2
"""States of an operation in OPERATION_PROGRESS; the numbers are inferred."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BareG2(Fixed):
    """A command with only its number and a request id."""

    LAYOUT: ClassVar = HEADER
    command: CommandId
    request_id: int


@dataclass(frozen=True, slots=True, kw_only=True)
class UploadG2(Fixed):
    """START_TAGS or END_TAGS: id of an upload, and its number of tags."""

    LAYOUT: ClassVar = UPLOAD
    command: CommandId
    request_id: int
    upload_id: int
    tag_count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TagG2:
    """A tag of an upload, with an inferred layout."""

    request_id: int
    upload_id: int
    tag_index: int
    tag: TagG1

    def encode(self) -> bytes:
        """Encode the message as payload bytes."""
        old = self.tag.encode()
        head = pack(UPLOAD, CommandId.TAG, self.request_id, self.upload_id, self.tag_index)
        return head + old[4:36] + old[40:]

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Decode a payload; raises `TunnelError` if length or command do not match."""
        check(payload, CommandId.TAG, 96)
        _, request_id, upload_id, tag_index = UPLOAD.unpack(payload[:16])
        old = payload[:4] + payload[16:48] + bytes(4) + payload[48:]
        tag = TagG1.decode(old)
        return cls(request_id=request_id, upload_id=upload_id, tag_index=tag_index, tag=tag)


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldsG2(CommandMessage):
    """A command with fields and a request id, with an inferred layout."""

    GENERATION: ClassVar = "G2"
    HEAD: ClassVar = ("command", "request_id")
    request_id: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SetLogLevel(Fixed):
    """Request to set the log level (from version 6 on); number and layout are inferred."""

    COMMAND: ClassVar = CommandId.SET_LOG_LEVEL
    LAYOUT: ClassVar = struct.Struct("<III")
    request_id: int
    level: int


@dataclass(frozen=True, slots=True, kw_only=True)
class AckG2(Fixed):
    """Acknowledgement of one request; the message is cut to 107 bytes."""

    COMMAND: ClassVar = CommandId.ACK
    LAYOUT: ClassVar = struct.Struct("<I4xIII108s")
    TEXT_SIZE: ClassVar = 108
    acked_command: int
    request_id: int
    result: int
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class OperationProgress(Fixed):
    """Progress of a request after its acknowledgement (version 5 on); text up to 99 bytes."""

    COMMAND: ClassVar = CommandId.OPERATION_PROGRESS
    LAYOUT: ClassVar = struct.Struct("<I4xIIIII100s")
    TEXT_SIZE: ClassVar = 100
    operation: int
    """Number of the command that started the operation."""
    request_id: int
    state: int
    step: int
    step_count: int
    """Number of steps of the operation; 0: unknown."""
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class HeartbeatG2v1(Fixed):
    """Heartbeat of the drone with the protocol version (version 1)."""

    COMMAND: ClassVar = CommandId.HEARTBEAT
    LAYOUT: ClassVar = struct.Struct("<IIHHf")
    protocol_version: int
    system_id: int
    status: int
    cpu_temperature_c: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HeartbeatG2(Fixed):
    """Heartbeat of the drone with the protocol version (from version 4 on)."""

    COMMAND: ClassVar = CommandId.HEARTBEAT
    LAYOUT: ClassVar = struct.Struct("<I4xIHHf")
    protocol_version: int
    system_id: int
    status: int
    cpu_temperature_c: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectorHeartbeat(Fixed):
    """Heartbeat of a tag's detector (from version 6 on); number and layout are inferred."""

    COMMAND: ClassVar = CommandId.DETECTOR_HEARTBEAT
    LAYOUT: ClassVar = struct.Struct("<I4xII")
    tag_id: int
    detection_mode: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseG2v1:
    """A pulse of version 1, with the ids of its collection and slice, or 0."""

    pulse: PulseG1
    collection_id: int = 0
    slice_id: int = 0

    def encode(self) -> bytes:
        """Encode the message as payload bytes."""
        old = self.pulse.encode()
        ids = struct.pack("<II", self.collection_id, self.slice_id)
        return old[:4] + ids + old[4:]

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Decode a payload; raises `TunnelError` if length or command do not match."""
        check(payload, CommandId.PULSE, 128)
        collection_id, slice_id = struct.unpack("<II", payload[4:12])
        pulse = PulseG1.decode(payload[:4] + payload[12:])
        return cls(pulse=pulse, collection_id=collection_id, slice_id=slice_id)


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseG2:
    """A pulse from version 4 on, with an inferred layout."""

    pulse: PulseG1

    def encode(self) -> bytes:
        """Encode the message as payload bytes."""
        old = self.pulse.encode()
        return old[:4] + bytes(4) + old[4:12] + old[16:]

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Decode a payload; raises `TunnelError` if length or command do not match."""
        check(payload, CommandId.PULSE, 120)
        return cls(pulse=PulseG1.decode(payload[:4] + payload[8:16] + bytes(4) + payload[16:]))


Messages = (
    BareG2
    | UploadG2
    | TagG2
    | FieldsG2
    | SetLogLevel
    | AckG2
    | OperationProgress
    | HeartbeatG2v1
    | HeartbeatG2
    | DetectorHeartbeat
    | PulseG2v1
    | PulseG2
)
Requests = BareG2 | UploadG2 | TagG2 | FieldsG2 | SetLogLevel
"""Messages of a ground station from version 4 of the tunnel protocol on."""
INFERRED = (TagG2, FieldsG2, SetLogLevel)
"""Messages of a ground station whose layout is not published, but inferred."""
DECODERS: Decoders = {
    **decoders_by_length("G2", 8, BareG2.decode),
    (CommandId.START_TAGS, 16): UploadG2.decode,
    (CommandId.END_TAGS, 16): UploadG2.decode,
    (CommandId.TAG, 96): TagG2.decode,
    **FieldsG2.decoders(),
    **decoders_of(SetLogLevel, OperationProgress),
    **decoders_of(HeartbeatG2v1, HeartbeatG2, DetectorHeartbeat),
}
SAME_LENGTH: dict[Generation, Decoders] = {
    "G2v1": {(CommandId.PULSE, 128): PulseG2v1.decode},
    "G2": {(CommandId.PULSE, 120): PulseG2.decode, **decoders_of(AckG2)},
}
"""Drone messages as long as an older one; only the protocol generation distinguishes them."""
