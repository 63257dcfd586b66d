"""RAW_CAPTURE: record a few seconds of samples to a file (G1).

======  ====  ======================================
offset  type  field
======  ====  ======================================
0       u32   command = 8
4       u32   gain
8       u32   frequency_hz              (size 12)
======  ====  ======================================

Sizes 8 and 12, the latter newest (reference/control.md §2.3).
"""

import struct
from dataclasses import dataclass
from typing import Self

from uavrt.errors import TunnelError
from uavrt.tunnel.wire import CommandId, pack, unpack

LAYOUTS = {8: struct.Struct("<II"), 12: struct.Struct("<III")}


@dataclass(frozen=True, slots=True, kw_only=True)
class RawCapture:
    """Capture with a gain; a frequency of None was left out by an older sender."""

    gain: int
    frequency_hz: int | None = None

    def encode(self) -> bytes:
        """Bytes of the payload."""
        if self.frequency_hz is None:
            return pack(LAYOUTS[8], CommandId.RAW_CAPTURE, self.gain)
        return pack(LAYOUTS[12], CommandId.RAW_CAPTURE, self.gain, self.frequency_hz)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Read the payload; raises `TunnelError` for another length or command."""
        layout = LAYOUTS.get(len(payload))
        if layout is None:
            raise TunnelError(f"RAW_CAPTURE never has {len(payload)} bytes", payload)
        values = unpack(layout, payload, CommandId.RAW_CAPTURE)
        return cls(gain=values[0], frequency_hz=values[1] if len(values) > 1 else None)
