"""Convert messages to CDR bytes and back, the encoding of ROS 2 on the wire and in recordings.

Plain CDR (version 1 of XCDR) in the writer's byte order behind a header of four bytes::

    00 01 00 00          little-endian (00 00 00 00: big-endian)
    …                    each primitive at a multiple of its size, counted after the header
    string               uint32 length with the closing NUL, the bytes, NUL
    sequence             uint32 count, the elements

Reference: OMG DDSI-RTPS 2.3 §10; checked byte for byte against an independent implementation.
"""

import struct
from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter
from typing import Any, TypeVar

from uavrt.core.errors import FormatError
from uavrt.link.ros2.types.interface import Field, fields_of
from uavrt.link.ros2.types.ros_messages import RosMessage

M = TypeVar("M", bound=RosMessage)

_HEADER_BYTES = 4
_LITTLE, _BIG = b"\x00\x01\x00\x00", b"\x00\x00\x00\x00"
_CODES = {
    "bool": "?",
    "byte": "B",
    "uint8": "B",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float64": "d",
}

Encoder = Callable[[bytearray, Any], None]


def encode(message: RosMessage) -> bytes:
    """Encode a message as little-endian CDR; raises `FormatError` if a number does not fit."""
    data = bytearray(_LITTLE)
    try:
        _encoder(type(message))(data, message)
    except struct.error as error:
        raise FormatError(f"{message.ros_name} cannot be encoded: {error}") from error
    return bytes(data)


_ENCODERS: dict[type, Encoder] = {}


def _encoder(message: type[RosMessage]) -> Encoder:
    if message not in _ENCODERS:
        _ENCODERS[message] = _make_encoder(message)
    return _ENCODERS[message]


def _make_encoder(message: type[RosMessage]) -> Encoder:
    """Compile the encoder of a message: adjacent numbers, also nested, become one `struct`.

    Ten times faster than field by field; at 100 tags that is 1 % of a core.
    """
    steps: list[Encoder] = []
    codes: list[str] = []
    paths: list[str] = []
    for path, entry in _flat_fields(message):
        if not entry.sequence and entry.primitive in _CODES and entry.length is None:
            codes.append(_CODES[entry.primitive])
            paths.append(path)
            continue
        if codes:
            steps.append(_numbers_encoder(codes, paths))
            codes, paths = [], []
        steps.append(_field_encoder(path, entry))
    if codes:
        steps.append(_numbers_encoder(codes, paths))

    def write(data: bytearray, value: Any) -> None:
        for step in steps:
            step(data, value)

    return write


def _flat_fields(message: type[RosMessage], prefix: str = "") -> Iterator[tuple[str, Field]]:
    """Yield path and field of every field that is not a nested message, at any depth."""
    for entry in fields_of(message):
        path = prefix + entry.name
        if entry.message is not None and not entry.sequence:
            yield from _flat_fields(entry.message, f"{path}.")
        else:
            yield path, entry


def _numbers_encoder(codes: Sequence[str], paths: Sequence[str]) -> Encoder:
    """Make the encoder of adjacent numbers, whose padding depends on the first offset."""
    packs = [struct.Struct("<" + _aligned(codes, phase)).pack for phase in range(8)]
    get = attrgetter(*paths)
    if len(paths) == 1:
        return lambda data, value: data.extend(packs[(len(data) - 4) % 8](get(value)))
    return lambda data, value: data.extend(packs[(len(data) - 4) % 8](*get(value)))


def _aligned(codes: Sequence[str], phase: int) -> str:
    """Format of adjacent numbers with padding, for an offset of `phase` modulo 8 bytes."""
    text, at = "", phase
    for code in codes:
        size = struct.calcsize(code)
        padding = -at % size
        text += "x" * padding + code
        at += padding + size
    return text


def _field_encoder(path: str, entry: Field) -> Encoder:
    get = attrgetter(path)
    if entry.sequence and entry.message is not None:
        element = _encoder(entry.message)

        def write_sequence(data: bytearray, value: Any) -> None:
            items = get(value)
            _write_count(data, len(items))
            for item in items:
                element(data, item)

        return write_sequence
    if entry.sequence:
        return _plain_sequence_encoder(get, entry.primitive)
    if entry.length is not None:
        return lambda data, value: data.extend(get(value))
    return lambda data, value: _write_string(data, get(value))


def _plain_sequence_encoder(get: Callable[[Any], Any], primitive: str) -> Encoder:
    """Make the encoder of a sequence of numbers or strings, with its count."""

    def write(data: bytearray, value: Any) -> None:
        items = get(value)
        _write_count(data, len(items))
        if primitive not in _CODES:
            for item in items:
                _write_string(data, item)
        elif items:
            code = _CODES[primitive]
            data.extend(bytes(-(len(data) - _HEADER_BYTES) % struct.calcsize(code)))
            data.extend(struct.pack(f"<{len(items)}{code}", *items))

    return write


_COUNT = struct.Struct("<I")


def _write_count(data: bytearray, count: int) -> None:
    data.extend(_PADDING[-len(data) % 4])
    data.extend(_COUNT.pack(count))


_PADDING = [bytes(count) for count in range(4)]


def _write_string(data: bytearray, value: str) -> None:
    text = value.encode("utf-8", "replace").replace(b"\0", b"")
    _write_count(data, len(text) + 1)
    data.extend(text + b"\0")


def decode(message: type[M], data: bytes) -> M:
    """Decode a message from CDR of either byte order; raises `FormatError` if it is invalid."""
    if data[:2] not in (_LITTLE[:2], _BIG[:2]):
        raise FormatError(f"the data are not CDR: first bytes {data[:4].hex()}")
    reader = _Reader(data, "<" if data[:2] == _LITTLE[:2] else ">")
    try:
        value: M = reader.message(message)
    except (struct.error, UnicodeDecodeError) as error:
        raise FormatError(f"the bytes are not a valid {message.ros_name}: {error}") from error
    return value


class _Reader:
    """Reads numbers and strings from a buffer, from front to back."""

    def __init__(self, data: bytes, order: str) -> None:
        self._data = data
        self._order = order
        self._at = _HEADER_BYTES

    def message(self, message: type[RosMessage]) -> Any:
        values = {entry.name: self._field(entry) for entry in fields_of(message)}
        return message(**values)

    def _field(self, entry: Field) -> Any:
        if entry.message is not None:
            if not entry.sequence:
                return self.message(entry.message)
            return tuple(self.message(entry.message) for _ in range(self._count()))
        if entry.length is not None:
            return self._bytes(entry.length)
        if entry.sequence:
            return tuple(self._plain(entry.primitive) for _ in range(self._count()))
        return self._plain(entry.primitive)

    def _plain(self, primitive: str) -> Any:
        if primitive.startswith("string"):
            return self._bytes(self._count()).rstrip(b"\0").decode("utf-8")
        return self._number(_CODES[primitive])

    def _number(self, code: str) -> Any:
        size = struct.calcsize(code)
        self._at += -(self._at - _HEADER_BYTES) % size
        (value,) = struct.unpack_from(self._order + code, self._data, self._at)
        self._at += size
        return value

    def _count(self) -> int:
        """Read a length; the remaining bytes limit it, as each element takes at least one."""
        count = int(self._number("I"))
        if count > len(self._data) - self._at:
            raise struct.error(
                f"{count} bytes are needed, but only {len(self._data) - self._at} are left"
            )
        return count

    def _bytes(self, count: int) -> bytes:
        end = self._at + count
        if end > len(self._data):
            raise struct.error("the data are truncated")
        value = self._data[self._at : end]
        self._at = end
        return value
