"""HEARTBEAT: state of the drone side, once a second (G1).

======  ====  ==============================================================
offset  type  field
======  ====  ==============================================================
0       u32   command = 9
4       u16   system_id: 1 controller, 2 channelizer
6       u16   status: 0 idle, 1 receiving tags, 2 has tags, 3 detecting,
              4 raw capture
8       f32   cpu_temperature_c
======  ====  ==============================================================

Size 12 (reference/control.md §2.3). It is the tunnel's own and has nothing to do with MAVLink's
HEARTBEAT; the thesis had none.
"""

import struct
from dataclasses import dataclass
from typing import Self

from uavrt.messages import SystemState
from uavrt.tunnel.wire import CommandId, pack, unpack

LAYOUT = struct.Struct("<IHHf")

SYSTEM_CONTROLLER = 1
SYSTEM_CHANNELIZER = 2

STATUS_NUMBERS: dict[SystemState, int] = {
    SystemState.IDLE: 0,
    SystemState.RECEIVING_TAGS: 1,
    SystemState.HAS_TAGS: 2,
    SystemState.DETECTING: 3,
    SystemState.CAPTURING: 4,
}
STATES: dict[int, SystemState] = {number: state for state, number in STATUS_NUMBERS.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Heartbeat:
    """State of the drone side."""

    system_id: int
    status: int
    cpu_temperature_c: float

    def encode(self) -> bytes:
        """Bytes of the payload."""
        fields = (self.system_id, self.status, self.cpu_temperature_c)
        return pack(LAYOUT, CommandId.HEARTBEAT, *fields)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Read the payload; raises `TunnelError` for another length or command."""
        system_id, status, temperature = unpack(LAYOUT, payload, CommandId.HEARTBEAT)
        return cls(system_id=system_id, status=status, cpu_temperature_c=temperature)

    @property
    def state(self) -> SystemState | None:
        """The state the status number stands for; None for an unknown number."""
        return STATES.get(self.status)
