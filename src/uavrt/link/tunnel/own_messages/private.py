"""Tunnel messages of uavrt alone, between its drones and ground stations.

These messages use payload types of the private range (above 32767), so that no other program
confuses them with the UAV-RT messages of payload type 0.

A receipt without hashes only announces a station that acknowledges. A ground station with an
empty store uses a new store number, so that the drone sends the whole flight again.

A pulse is identified by the 64-bit BLAKE2b hash of its payload. So the message that every
ground station reads stays unchanged.
"""

import hashlib
from dataclasses import dataclass
from typing import Self

from uavrt.link.tunnel.own_messages.field_layout import Layout

RECEIPT_TYPE = 60_001
SEALED_TYPE = 60_002
"""Payload type of a message with a keyed hash, see `uavrt.link.tunnel.own_messages.seal`."""
SESSION_TYPE = 60_004
"""Payload type of the session for sealed messages (`own_messages.seal`)."""
MOTION_TYPE, MOTION_STATE_TYPE = 60_005, 60_006
"""Payload types of motion orders and states (`own_messages.motion_messages`)."""
PROVEN_STATE_TYPE = 60_011
"""Payload type of an answer to a sealed motion order (`own_messages.seal`)."""
COURSE_TYPE, NEIGHBOUR_TYPE = 60_009, 60_010
"""Payload types for drones that search together (`own_messages.neighbour_messages`)."""
MAX_HASHES = 15
MAX_SEALED_HASHES = 12
"""Largest number of pulse hashes in a sealed receipt, which has at most 108 bytes."""
_LAYOUT = Layout(
    "a receipt",
    "version:B hashes#:B :2x store:I hashes*:Q",
    {"store": (1, 2**32 - 1), "hashes": (0, MAX_HASHES)},
    version=1,
)


def payload_hash(payload: bytes) -> int:
    """Return the 64-bit BLAKE2b hash that identifies a payload."""
    return int.from_bytes(hashlib.blake2b(payload, digest_size=8).digest(), "little")


@dataclass(frozen=True, slots=True, kw_only=True)
class Receipt:
    """Acknowledgement of the pulses that a ground station has stored."""

    store: int
    hashes: tuple[int, ...] = ()

    def encode(self) -> bytes:
        """Encode the receipt as payload bytes."""
        return _LAYOUT.pack(self)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Decode a receipt; raises `TunnelError` for anything else."""
        return cls(**_LAYOUT.unpack(payload))
