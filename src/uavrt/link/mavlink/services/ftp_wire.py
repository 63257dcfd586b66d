"""Wire format of MAVLink FTP: the 251 bytes inside FILE_TRANSFER_PROTOCOL; no I/O.

::

    offset  type      field
    0       u16       sequence number; a reply has its request's plus one
    2       u8        session
    3       u8        opcode
    4       u8        number of data bytes, or of those wanted
    5       u8        opcode of the request (in replies)
    6       u8        burst complete (1: ask for the next burst)
    7       u8        pad
    8       u32       offset in the file, or index in the directory
    12      u8[239]   data

Source: the MAVLink FTP service's description at mavlink.io.
"""

import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum
from typing import Self

_LAYOUT = struct.Struct("<HBBBBBxI")
DATA_SIZE = 239
PAYLOAD_SIZE = 251


class Opcode(IntEnum):
    """Client requests, and the two kinds of reply."""

    NONE = 0
    TERMINATE_SESSION = 1
    RESET_SESSIONS = 2
    LIST_DIRECTORY = 3
    OPEN_FILE_RO = 4
    READ_FILE = 5
    CREATE_FILE = 6
    WRITE_FILE = 7
    REMOVE_FILE = 8
    CREATE_DIRECTORY = 9
    REMOVE_DIRECTORY = 10
    OPEN_FILE_WO = 11
    TRUNCATE_FILE = 12
    RENAME = 13
    CALC_FILE_CRC32 = 14
    BURST_READ_FILE = 15
    ACK = 128
    NAK = 129


WRITING = frozenset(
    {
        Opcode.CREATE_FILE,
        Opcode.WRITE_FILE,
        Opcode.REMOVE_FILE,
        Opcode.CREATE_DIRECTORY,
        Opcode.REMOVE_DIRECTORY,
        Opcode.OPEN_FILE_WO,
        Opcode.TRUNCATE_FILE,
        Opcode.RENAME,
    }
)
"""Opcodes of requests that would change a file; this server refuses them."""


class FtpError(IntEnum):
    """Reason for refusing a request: the first data byte of a NAK."""

    FAIL = 1
    FAIL_ERRNO = 2
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    NO_SESSIONS_AVAILABLE = 5
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    FILE_EXISTS = 8
    FILE_PROTECTED = 9
    FILE_NOT_FOUND = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class FtpPacket:
    """A request or reply of MAVLink FTP."""

    sequence: int
    session: int = 0
    opcode: int
    size: int | None = None
    """Number of data bytes in the packet, or requested from the server."""
    request_opcode: int = 0
    burst_complete: bool = False
    offset: int = 0
    data: bytes = b""

    def encode(self) -> bytes:
        """Encode the packet as payload bytes, always 251."""
        size = len(self.data) if self.size is None else self.size
        head = _LAYOUT.pack(
            self.sequence & 0xFFFF,
            self.session,
            self.opcode,
            size,
            self.request_opcode,
            self.burst_complete,
            self.offset,
        )
        return (head + self.data).ljust(PAYLOAD_SIZE, b"\0")

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Decode a payload of 251 bytes; any content is valid."""
        sequence, session, opcode, size, request, complete, offset = _LAYOUT.unpack_from(
            payload
        )
        return cls(
            sequence=sequence,
            session=session,
            opcode=opcode,
            size=size,
            request_opcode=request,
            burst_complete=bool(complete),
            offset=offset,
            data=bytes(payload[12 : 12 + min(size, DATA_SIZE)]),
        )


def checksum(data: bytes, so_far: int = 0) -> int:
    """CRC-32 of MAVLink FTP and PX4: it starts at zero and is not inverted at the end."""
    return zlib.crc32(data, so_far ^ 0xFFFFFFFF) ^ 0xFFFFFFFF
