"""Common parts of all tunnel messages: numbers, strict packing and unpacking.

A payload is a C struct with natural alignment, little-endian, whose first member is the command
as u32. The MAVLink message's ``payload_type`` is 0 in every version. Pads are written as zeros
and ignored, because the original senders never cleared theirs. Formats are explicit (``<`` and
``x``), so they are the same on every machine.
"""

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self

from uavrt.core.commands import COMMAND_OF_NUMBER, COMMANDS, CommandField
from uavrt.core.commands import CommandId as CommandId
from uavrt.core.commands import Generation as Generation
from uavrt.core.errors import TunnelError

MAX_PAYLOAD = 128
"""Largest payload of one MAVLink TUNNEL message [bytes]."""

PAYLOAD_TYPE = 0
"""Payload type of every version of the original protocol: MAV_TUNNEL_PAYLOAD_TYPE_UNKNOWN."""

Ids = tuple[int, int]
"""System and component id of a MAVLink component, such as a ground station."""


class Fixed:
    """Base of messages with a fixed length; the fields are in the order of the layout.

    A text is the last field: NUL-terminated, cut to its size. Where several commands have the
    same layout, the command is the first field.
    """

    __slots__: tuple[str, ...] = ()
    COMMAND: ClassVar[CommandId | None] = None
    LAYOUT: ClassVar[struct.Struct]
    TEXT_SIZE: ClassVar[int] = 0
    """Size of the message's text field with its NUL [bytes]; 0: no text."""

    def encode(self) -> bytes:
        """Encode the message as payload bytes."""
        values: list[Any] = [getattr(self, name) for name in self.__slots__]
        if self.TEXT_SIZE:
            values[-1] = bytes_from_text(values[-1], self.TEXT_SIZE)
        head = () if self.COMMAND is None else (self.COMMAND,)
        return pack(self.LAYOUT, *head, *values)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Decode a payload; raises `TunnelError` if length or command do not match."""
        if cls.COMMAND is None:
            number = command_of(int.from_bytes(payload[:4], "little"), payload)
            values = (number, *unpack(cls.LAYOUT, payload, number))
        else:
            values = unpack(cls.LAYOUT, payload, cls.COMMAND)
        if cls.TEXT_SIZE:
            values = (*values[:-1], text_from_bytes(values[-1]))
        return cls(**dict(zip(cls.__slots__, values, strict=True)))


class Message(Protocol):
    """Protocol of a tunnel message, which can be encoded."""

    def encode(self) -> bytes:
        """Encode the message as payload bytes."""


Decoder = Callable[[bytes], Message]
Decoders = dict[tuple[int, int], Decoder]
"""Decoders of tunnel messages, by command number and payload length [bytes]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandMessage:
    """A command with the fields of its row (`uavrt.core.commands`), aligned as in C.

    Older senders lack fields at the end.
    """

    GENERATION: ClassVar[Generation]
    HEAD: ClassVar[tuple[str, ...]] = ("command",)
    """Members of a command message before its fields, each a u32."""
    command: CommandId
    numbers: tuple[float, ...]

    @classmethod
    def of(cls, command: CommandId, values: Mapping[str, float | None], **head: int) -> Self:
        """Make the message with all fields: those in `values`, by name, and 0 for the rest."""
        given = [(one.kind, values.get(one.name) or 0.0) for one in cls._fields(command)]
        numbers = tuple(round(number) if kind == "u32" else number for kind, number in given)
        return cls(command=command, numbers=numbers, **head)

    def encode(self) -> bytes:
        """Encode the message; raises `TunnelError` for a wrong number of fields."""
        head = [getattr(self, name) for name in self.HEAD]
        for layout in self._layouts(self.command).values():
            if len(head) + len(self.numbers) == _values_in(layout):
                return pack(layout, *head, *self.numbers)
        raise TunnelError(f"{self.command.name} cannot have {len(self.numbers)} fields", b"")

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Decode a payload whose command and length are among `decoders`."""
        command = CommandId(int.from_bytes(payload[:4], "little"))
        _, *values = cls._layouts(command)[len(payload)].unpack(payload)
        head = dict(zip(cls.HEAD[1:], values, strict=False))
        return cls(command=command, numbers=tuple(values[len(head) :]), **head)

    @classmethod
    def decoders(cls) -> Decoders:
        """Make the decoders of all commands with fields, by command and length."""
        return {
            (number, length): cls.decode
            for number in COMMAND_OF_NUMBER
            for length in cls._layouts(CommandId(number))
        }

    @classmethod
    def _fields(cls, command: CommandId) -> list[CommandField]:
        """Layout of a command's fields in this protocol version."""
        fields = COMMAND_OF_NUMBER[command].fields
        return [one for one in fields if cls.GENERATION == "G2" or not one.from_g2]

    @classmethod
    def _layouts(cls, command: CommandId) -> dict[int, struct.Struct]:
        """Layouts of the payloads with all fields, or only the first ones, by length."""
        text, end, widest = "<" + "I" * len(cls.HEAD), 4 * len(cls.HEAD), 4
        layouts = {}
        for one in cls._fields(command):
            code, size = _CODES[one.kind]
            pad = -end % size
            text, end, widest = f"{text}{pad}x{code}", end + pad + size, max(widest, size)
            layouts[end + -end % widest] = struct.Struct(f"{text}{-end % widest}x")
        lengths = COMMAND_OF_NUMBER[command].lengths.get(cls.GENERATION, ()) if layouts else ()
        return {length: layouts[length] for length in lengths}


_CODES = {"u32": ("I", 4), "f64": ("d", 8)}
"""Code of `struct` and size [bytes] of each type of a command's field."""


def _values_in(layout: struct.Struct) -> int:
    return len(layout.unpack(bytes(layout.size)))


def decoders_of(*kinds: type[Fixed]) -> Decoders:
    """Make the decoders of messages that have one command and one length."""
    return {(kind.COMMAND or 0, kind.LAYOUT.size): kind.decode for kind in kinds}


def decoders_by_length(generation: Generation, length: int, decode: Decoder) -> Decoders:
    """Make one decoder for a generation's commands whose payload has this length [bytes]."""
    return {
        (row.number, length): decode
        for row in COMMANDS.values()
        if row.number is not None and length in row.lengths.get(generation, ())
    }


def command_name(number: int) -> str:
    """Name of a command for the operator: ``"stop detection"``; else its number as text."""
    try:
        return CommandId(number).name.lower().replace("_", " ")
    except ValueError:
        return f"command {number}"


def command_of(number: int, payload: bytes) -> CommandId:
    """Command with a number on the wire; raises `TunnelError` for an unknown number."""
    try:
        return CommandId(number)
    except ValueError:
        raise TunnelError(f"unknown command {number}", payload) from None


def pack(layout: struct.Struct, *values: object) -> bytes:
    """Pack values, zeros in the pads; raises `TunnelError` for a value that does not fit."""
    try:
        return layout.pack(*values)
    except (struct.error, OverflowError) as error:
        raise TunnelError(f"a value does not fit the tunnel's field: {error}", b"") from error


def unpack(layout: struct.Struct, payload: bytes, command: CommandId) -> tuple[Any, ...]:
    """Unpack a payload; raises `TunnelError` if length or command do not match."""
    if len(payload) != layout.size:
        check(payload, command, layout.size)
    number, *values = layout.unpack(payload)
    if number != command:
        check(payload, command, layout.size)
    return tuple(values)


def check(payload: bytes, command: CommandId, size: int) -> None:
    """Raise `TunnelError` unless a payload has this length and command."""
    if len(payload) != size:
        raise TunnelError(f"{command.name} has {len(payload)} bytes, not {size}", payload)
    number = int.from_bytes(payload[:4], "little")
    if number != command:
        raise TunnelError(
            f"the command number is {number}, but must be that of {command.name}", payload
        )


def text_from_bytes(field: bytes) -> str:
    """Read a NUL-terminated text; invalid UTF-8 becomes replacement marks."""
    return field.split(b"\0", 1)[0].decode("utf-8", errors="replace")


def bytes_from_text(text: str, size: int) -> bytes:
    """Encode a text as UTF-8, cut at a whole character, in at most `size` - 1 bytes."""
    return text.encode("utf-8", errors="replace")[: size - 1].decode(errors="ignore").encode()
