"""Convert bytes of a link to frames and back, without I/O.

A frame (MAVLink 2)::

    0xFD len incompat compat seq sysid compid id (3) | payload (len) | crc16 | [signature 13]

Trailing zeros of the payload are cut by the sender. The checksum is CRC-16/MCRF4XX over
everything between marker and checksum, then the message's own seed byte. MAVLink 1 frames (0xFE
len seq sysid compid id) are read too, because some radios still send RADIO_STATUS in them.

After a bad checksum, parsing resumes at the byte after the false marker, not after the false
frame. Otherwise a stray 0xFD on a noisy serial line would discard up to 280 good bytes.
"""

import binascii
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from uavrt.link.mavlink.dialect import CRC_EXTRAS, MESSAGES
from uavrt.link.mavlink.message import Message

MARKER_V1 = 0xFE
MARKER_V2 = 0xFD
HEADER_V1 = 6
HEADER_V2 = 10
SIGNED = 0x01
SIGNATURE_SIZE = 13

M = TypeVar("M", bound=Message)

_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def crc16_mcrf4xx(data: bytes) -> int:
    """Compute MAVLink's checksum of some bytes.

    CRC-16/MCRF4XX is CRC-CCITT with input and output bits mirrored. The standard library has
    the latter in C, 40 times as fast as a Python loop on a 145-byte frame.
    """
    crc = binascii.crc_hqx(data.translate(_REVERSED), 0xFFFF)
    return _REVERSED[crc & 0xFF] << 8 | _REVERSED[crc >> 8]


@dataclass(frozen=True, slots=True)
class Frame:
    """A received frame: its checksum is valid, or its message unknown."""

    raw: bytes
    """The whole frame as received, for forwarding."""
    message_id: int
    system_id: int
    component_id: int
    sequence: int
    payload: bytes
    signed: bool = False

    @property
    def known(self) -> bool:
        """True if the dialect has the message, so that `message` can decode it."""
        return self.message_id in MESSAGES

    def message(self) -> Message | None:
        """The decoded message; None if the dialect does not contain it."""
        kind = MESSAGES.get(self.message_id)
        return None if kind is None else kind.decode(self.payload)


Sign = Callable[[bytes], bytes]
"""Function that signs a frame with the signed flag (`uavrt.link.mavlink.sending.signing`)."""


def encode_frame(
    message: Message,
    *,
    system_id: int,
    component_id: int,
    sequence: int,
    sign: Sign | None = None,
) -> bytes:
    """Encode a MAVLink 2 frame, unsigned unless `sign` is given."""
    payload = message.pack().rstrip(b"\0") or b"\0"
    flags = 0 if sign is None else SIGNED
    head = bytes((len(payload), flags, 0, sequence & 0xFF, system_id, component_id))
    body = head + message.ID.to_bytes(3, "little") + payload
    crc = crc16_mcrf4xx(body + bytes((message.CRC_EXTRA,)))
    frame = bytes((MARKER_V2,)) + body + crc.to_bytes(2, "little")
    return frame if sign is None else frame + sign(frame)


class FrameWriter:
    """Numbers the frames of one sender on one link."""

    def __init__(self, system_id: int, component_id: int, sign: Sign | None = None) -> None:
        self.system_id = system_id
        self.component_id = component_id
        self._sign = sign
        self._sequence = 0

    def encode(self, message: Message) -> bytes:
        """Encode a message as the next frame; sequence numbers rise from 0 to 255."""
        frame = encode_frame(
            message,
            system_id=self.system_id,
            component_id=self.component_id,
            sequence=self._sequence,
            sign=self._sign,
        )
        self._sequence = (self._sequence + 1) & 0xFF
        return frame


class FrameParser:
    """Splits a stream of bytes, or datagrams, into frames; counts faults.

    `received`: frames with a right checksum. `bad_crc`: frames (or stray markers) with a wrong
    one. `skipped_bytes`: bytes that belonged to no frame.
    """

    def __init__(self) -> None:
        self._buffer = b""
        self.received = 0
        self.bad_crc = 0
        self.skipped_bytes = 0

    def feed(self, data: bytes) -> list[Frame]:
        """Add received bytes; return the frames that are now complete."""
        buffer = self._buffer + data if self._buffer else bytes(data)
        frames: list[Frame] = []
        place, size = 0, len(buffer)
        while place < size:
            marker = buffer[place]
            if marker not in (MARKER_V1, MARKER_V2):
                place = self._skip_to_marker(buffer, place)
                continue
            length = _frame_length(buffer, place)
            if length is None or place + length > size:
                break
            frame = _check(buffer[place : place + length], _next_byte(buffer, place + length))
            if frame is None:
                self.bad_crc += 1
                self.skipped_bytes += 1
                place += 1
            else:
                self.received += 1
                frames.append(frame)
                place += length
        self._buffer = buffer[place:]
        return frames

    def reset(self) -> None:
        """Drop an incomplete frame: the datagram has ended or the link was reopened."""
        self.skipped_bytes += len(self._buffer)
        self._buffer = b""

    def _skip_to_marker(self, buffer: bytes, place: int) -> int:
        found = [buffer.find(bytes((m,)), place) for m in (MARKER_V1, MARKER_V2)]
        end = min((index for index in found if index >= 0), default=len(buffer))
        self.skipped_bytes += end - place
        return end


def _frame_length(buffer: bytes, place: int) -> int | None:
    """Length of the frame that starts at `place` [bytes]; None if its header is incomplete."""
    if place + 3 > len(buffer):
        return None
    length = buffer[place + 1]
    if buffer[place] == MARKER_V1:
        return HEADER_V1 + length + 2
    return HEADER_V2 + length + 2 + (SIGNATURE_SIZE if buffer[place + 2] & SIGNED else 0)


def _next_byte(buffer: bytes, place: int) -> int | None:
    return buffer[place] if place < len(buffer) else None


def _check(raw: bytes, following: int | None) -> Frame | None:
    """Read a frame of the right length; None if its checksum is wrong.

    An unknown message has no known checksum; it is accepted if a frame or nothing follows.
    """
    if raw[0] == MARKER_V2:
        _, length, incompatible, _, sequence, system_id, component_id = raw[:7]
        message_id, header = int.from_bytes(raw[7:10], "little"), HEADER_V2
    else:
        _, length, sequence, system_id, component_id, message_id = raw[:6]
        incompatible, header = 0, HEADER_V1
    if incompatible & ~SIGNED:
        return None
    end = header + length
    seed = CRC_EXTRAS.get(message_id)
    if seed is None:
        if following not in (None, MARKER_V1, MARKER_V2):
            return None
    else:
        crc = crc16_mcrf4xx(raw[1:end] + bytes((seed,)))
        if crc != int.from_bytes(raw[end : end + 2], "little"):
            return None
    payload = raw[header:end]
    signed = bool(incompatible & SIGNED)
    return Frame(raw, message_id, system_id, component_id, sequence, payload, signed)
