"""Commands that are nothing but their number.

======  ====  =======
offset  type  field
======  ====  =======
0       u32   command
======  ====  =======

Size 4, in G0 and G1: START_TAGS 2, END_TAGS 3, STOP_DETECTION 6; in G0 only START_DETECTION 5
(later generations add fields, see `uavrt.tunnel.start_detection`); in G1 only SAVE_LOGS 12,
CLEAN_LOGS 13, AIRSPY_STATUS 14 (reference/control.md §2.2, §2.3).
"""

import struct
from dataclasses import dataclass
from typing import Self

from uavrt.errors import TunnelError
from uavrt.tunnel.wire import CommandId, pack

LAYOUT = struct.Struct("<I")

HEADER_COMMANDS = frozenset(
    {
        CommandId.START_TAGS,
        CommandId.END_TAGS,
        CommandId.START_DETECTION,
        CommandId.STOP_DETECTION,
        CommandId.SAVE_LOGS,
        CommandId.CLEAN_LOGS,
        CommandId.AIRSPY_STATUS,
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeaderMessage:
    """A command without fields; START_DETECTION in this form is G0."""

    command: CommandId

    def encode(self) -> bytes:
        """Bytes of the payload."""
        return pack(LAYOUT, self.command)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Read the payload; raises `TunnelError` unless it is one of these commands."""
        if len(payload) != LAYOUT.size:
            raise TunnelError(f"a bare command has 4 bytes, not {len(payload)}", payload)
        (number,) = LAYOUT.unpack(payload)
        if number not in HEADER_COMMANDS:
            raise TunnelError(f"no command {number} without fields is known", payload)
        return cls(command=CommandId(number))
