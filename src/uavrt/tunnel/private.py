"""Our own tunnel messages, between a drone and a ground station that are both uavrt's.

They travel in a payload type of the private range (above 32767), so that no other program takes
them for the UAV-RT messages of payload type 0.

`Receipt`, payload type 60001, from the ground::

    offset  type   field
    0       u8     version, 1
    1       u8     number of hashes
    2       u16    zero
    4       u32    store: which collection of pulses the sender keeps, never 0
    8       u64[]  hashes of payloads that are safe in that store, at most 15

A receipt without hashes says only "I am here, and I acknowledge". A ground station that begins
with an empty store has a new number, which tells the drone to send the whole flight again.

A pulse is known by the 64-bit BLAKE2b hash of its payload: nothing is added to the message that
every ground station reads.
"""

import hashlib
import struct
from dataclasses import dataclass
from typing import Self

from uavrt.errors import TunnelError

RECEIPT_TYPE = 60_001
SEALED_TYPE = 60_002
"""A command with a keyed hash, see `uavrt.tunnel.seal`."""
SESSION_TYPE = 60_004
"""What sealed commands must be sealed for, see `uavrt.tunnel.seal`."""
MOTION_TYPE, MOTION_STATE_TYPE = 60_005, 60_006
"""Orders of motion, and what becomes of them, see `uavrt.tunnel.motion`."""
COURSE_TYPE, NEIGHBOUR_TYPE = 60_009, 60_010
"""What drones that search together say and are told, see `uavrt.tunnel.neighbours`."""
MAX_HASHES = 15
MAX_SEALED_HASHES = 12
"""What fits into a seal's 108 bytes."""
_HEAD = struct.Struct("<BBHI")
_VERSION = 1


def payload_hash(payload: bytes) -> int:
    """Identity of a payload: 64 bits of BLAKE2b, little-endian."""
    return int.from_bytes(hashlib.blake2b(payload, digest_size=8).digest(), "little")


@dataclass(frozen=True, slots=True, kw_only=True)
class Receipt:
    """What a ground station has received."""

    store: int
    hashes: tuple[int, ...] = ()

    def encode(self) -> bytes:
        """Bytes of the payload."""
        head = _HEAD.pack(_VERSION, len(self.hashes), 0, self.store)
        return head + struct.pack(f"<{len(self.hashes)}Q", *self.hashes)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Read the payload; raises `TunnelError` when it is no receipt."""
        if len(payload) < _HEAD.size:
            raise TunnelError("a receipt has at least 8 bytes", payload)
        version, count, _, store = _HEAD.unpack_from(payload)
        if version != _VERSION or store == 0 or count > MAX_HASHES:
            raise TunnelError("a receipt of another version", payload)
        if len(payload) != _HEAD.size + 8 * count:
            raise TunnelError(f"{count} hashes in a receipt of {len(payload)} bytes", payload)
        return cls(store=store, hashes=struct.unpack_from(f"<{count}Q", payload, _HEAD.size))
