"""What all tunnel messages share: numbers, strict packing and unpacking.

A payload is a C struct with natural alignment, little-endian, whose first member is the
command as u32; ``payload_type`` of the MAVLink message is 0 in every version
(reference/control.md §2.1). Pads are written as zeros and never looked at, because the original
senders never cleared theirs. Formats are explicit (``<`` and ``x``), so they are the same on
every machine.
"""

import struct
from enum import IntEnum
from typing import Any, Literal

from uavrt.errors import TunnelError

Generation = Literal["G0", "G1", "G2v1", "G2"]
"""G0: the thesis (February 2023); G1: the newest without a version number (April 2026); G2v1:
version 1; G2: versions 4 to 7."""

MAX_PAYLOAD = 128
"""Payload bytes of one MAVLink TUNNEL message."""

PAYLOAD_TYPE = 0
"""MAV_TUNNEL_PAYLOAD_TYPE_UNKNOWN, as every version of the original sends it."""


class CommandId(IntEnum):
    """First member of every payload (reference/control.md §2.2, §2.3)."""

    ACK = 1
    START_TAGS = 2
    END_TAGS = 3
    TAG = 4
    START_DETECTION = 5
    STOP_DETECTION = 6
    PULSE = 7
    RAW_CAPTURE = 8
    HEARTBEAT = 9
    SAVE_LOGS = 12
    CLEAN_LOGS = 13
    AIRSPY_STATUS = 14
    OPERATION_PROGRESS = 21
    SET_LOG_LEVEL = 22
    DETECTOR_HEARTBEAT = 23


def command_name(number: int) -> str:
    """Write a command for people: ``"stop detection"``; a number that nobody knows as such."""
    try:
        return CommandId(number).name.lower().replace("_", " ")
    except ValueError:
        return f"command {number}"


def command_of(number: int, payload: bytes) -> CommandId:
    """Get the command of a number that came by a wire.

    Raises
    ------
    TunnelError
        There is none.
    """
    try:
        return CommandId(number)
    except ValueError:
        raise TunnelError(f"unknown command {number}", payload) from None


def pack(layout: struct.Struct, *values: object) -> bytes:
    """Pack values, zeros in the pads.

    Raises
    ------
    TunnelError
        A value does not fit its field; the caller should not have let it come here.
    """
    try:
        return layout.pack(*values)
    except (struct.error, OverflowError) as error:
        raise TunnelError(f"a value does not fit the tunnel's field: {error}", b"") from error


def unpack(layout: struct.Struct, payload: bytes, command: CommandId) -> tuple[Any, ...]:
    """Unpack a payload of exactly the layout's length and the given command.

    Raises
    ------
    TunnelError
        Another length or another command.
    """
    if len(payload) != layout.size:
        raise TunnelError(
            f"{command.name} has {len(payload)} bytes in place of {layout.size}", payload
        )
    values: tuple[Any, ...] = layout.unpack(payload)
    if values[0] != command:
        raise TunnelError(f"command {values[0]} in place of {command.name}", payload)
    return values[1:]


def text_from_bytes(field: bytes) -> str:
    """Read a NUL-terminated text; bytes that are no UTF-8 become replacement marks."""
    return field.split(b"\0", 1)[0].decode("utf-8", errors="replace")


def bytes_from_text(text: str, size: int) -> bytes:
    """Cut a text to `size` - 1 bytes of whole UTF-8 characters, so that a NUL ends it."""
    return text.encode("utf-8", errors="replace")[: size - 1].decode(errors="ignore").encode()
