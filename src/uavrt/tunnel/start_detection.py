"""START_DETECTION: begin to search for the uploaded tags.

======  ====  =====================================================================
offset  type  field
======  ====  =====================================================================
0       u32   command = 5
4       u32   radio_center_frequency_hz
8       u32   gain
12      u32   detection_mode: 0 ``uavrt_detection``, 1 Python   (from size 16)
16      f64   detection_margin; 0: the default 0.90             (from size 32)
24      f64   confidence_ratio; 0: the default 1.3              (from size 32)
32      u32   debug_detector                                    (size 40)
36      4     pad                                               (size 40)
======  ====  =====================================================================

G1 grew: sizes 12, 16, 32 and 40 are all in the field and accepted; 40 is what we send. The
thesis's form has the command only, see `uavrt.tunnel.header` (reference/control.md §2.3).
"""

import struct
from dataclasses import dataclass
from typing import Self

from uavrt.errors import TunnelError
from uavrt.tunnel.wire import CommandId, pack, unpack

LAYOUTS = {
    12: struct.Struct("<III"),
    16: struct.Struct("<IIII"),
    32: struct.Struct("<IIIIdd"),
    40: struct.Struct("<IIIIddI4x"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class StartDetection:
    """Start with a radio frequency and gain; None marks what an older sender left out."""

    radio_center_frequency_hz: int
    gain: int
    detection_mode: int | None = 0
    detection_margin: float | None = 0.0
    confidence_ratio: float | None = 0.0
    debug_detector: int | None = 0

    def encode(self) -> bytes:
        """Bytes of the payload, as long as its last field that is not None needs."""
        fields: tuple[float | None, ...] = (
            self.radio_center_frequency_hz,
            self.gain,
            self.detection_mode,
            self.detection_margin,
            self.confidence_ratio,
            self.debug_detector,
        )
        present = [field for field in fields if field is not None]
        if fields[: len(present)] != tuple(present):
            raise TunnelError("START_DETECTION has a hole before its last field", b"")
        layout = {2: 12, 3: 16, 5: 32, 6: 40}.get(len(present))
        if layout is None:
            raise TunnelError("START_DETECTION has a margin without a ratio", b"")
        return pack(LAYOUTS[layout], CommandId.START_DETECTION, *present)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Read the payload; raises `TunnelError` for another length or command."""
        layout = LAYOUTS.get(len(payload))
        if layout is None:
            raise TunnelError(f"START_DETECTION never has {len(payload)} bytes", payload)
        values = unpack(layout, payload, CommandId.START_DETECTION)
        padded = values + (None,) * (6 - len(values))
        return cls(**dict(zip(cls.__slots__, padded, strict=True)))
