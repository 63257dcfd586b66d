"""ACK: the drone's answer to a command.

======  =========  ============================================
offset  type       field
======  =========  ============================================
0       u32        command = 1
4       u32        acked_command
8       u32        result: 1 success, 0 failure
12      char[116]  message, NUL-terminated (G1 only)
======  =========  ============================================

Size 12 in G0, 128 in G1 (reference/control.md §2.2, §2.3). The thesis's Table 2.16 prints 2 for
failure; its header file, which is what ran, says 0. The message holds the log directory after a
successful START_DETECTION and the reason after a failure.
"""

import struct
from dataclasses import dataclass
from typing import Self

from uavrt.tunnel.wire import CommandId, bytes_from_text, pack, text_from_bytes, unpack

LAYOUT_G0 = struct.Struct("<III")
LAYOUT_G1 = struct.Struct("<III116s")
MESSAGE_SIZE = 116

SUCCESS = 1
FAILURE = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class AckG0:
    """The thesis's acknowledgement: no reason."""

    acked_command: int
    result: int

    def encode(self) -> bytes:
        """Bytes of the payload."""
        return pack(LAYOUT_G0, CommandId.ACK, self.acked_command, self.result)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Read the payload; raises `TunnelError` for another length or command."""
        acked, result = unpack(LAYOUT_G0, payload, CommandId.ACK)
        return cls(acked_command=acked, result=result)


@dataclass(frozen=True, slots=True, kw_only=True)
class AckG1:
    """Acknowledgement with a reason."""

    acked_command: int
    result: int
    message: str

    def encode(self) -> bytes:
        """Bytes of the payload; the message is cut to 115 bytes."""
        text = bytes_from_text(self.message, MESSAGE_SIZE)
        return pack(LAYOUT_G1, CommandId.ACK, self.acked_command, self.result, text)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Read the payload; raises `TunnelError` for another length or command."""
        acked, result, text = unpack(LAYOUT_G1, payload, CommandId.ACK)
        return cls(acked_command=acked, result=result, message=text_from_bytes(text))
