"""Descriptions of message types for ROS 2, derived from their dataclasses.

Type hashes are those of REP 2011: SHA-256 over the type's description as JSON, as shown by
``ros2 topic info -v`` and kept in recordings.
"""

import hashlib
import json
import typing
from dataclasses import dataclass, fields, replace
from typing import Any

from uavrt.link.ros2.types.ros_messages import RosMessage

_TYPE_IDS = {
    "uint8": 3,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float64": 11,
    "bool": 15,
    "byte": 16,
    "string": 17,
    "string<=256": 21,
}
"""Type numbers of type_description_interfaces/FieldType; bounded strings have other ones."""
_NESTED = 1
_ARRAY, _SEQUENCE = 48, 144
"""Offsets added to an element's type number for an array and a sequence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Field:
    """One field of a message: name, type, and array or sequence."""

    name: str
    primitive: str = ""
    """Primitive type such as ``float64``; empty for a nested message."""
    message: type[RosMessage] | None = None
    """Type of a nested message; None for a primitive."""
    length: int | None = None
    """Number of bytes of a fixed array; None for any other field."""
    sequence: bool = False


_FIELDS: dict[type, tuple[Field, ...]] = {}
_HASHES: dict[type, str] = {}


def fields_of(message: type[RosMessage]) -> tuple[Field, ...]:
    """Fields of a message class, in order."""
    if message not in _FIELDS:
        hints = typing.get_type_hints(message, include_extras=True)
        kind: Any = message
        _FIELDS[message] = tuple(_field(e.name, hints[e.name]) for e in fields(kind))
    return _FIELDS[message]


def _field(name: str, hint: Any) -> Field:
    if typing.get_origin(hint) is tuple:
        return replace(_field(name, typing.get_args(hint)[0]), sequence=True)
    if typing.get_origin(hint) is typing.Annotated:
        meaning = typing.get_args(hint)[1]
        if isinstance(meaning, int):
            return Field(name=name, primitive="uint8", length=meaning)
        return Field(name=name, primitive=meaning)
    return Field(name=name, message=hint)


def full_name(message: type[RosMessage]) -> str:
    """Name of a message type in ROS 2: ``uavrt_interfaces/msg/Pulse``."""
    return message.ros_name.replace("/", f"/{message.interface}/")


def dds_name(message: type[RosMessage]) -> str:
    """Name of a message type on the wire: ``uavrt_interfaces::msg::dds_::Pulse_``."""
    return message.ros_name.replace("/", f"::{message.interface}::dds_::") + "_"


def definition(message: type[RosMessage]) -> str:
    """Text lines of a message's ``.msg`` file."""
    return "".join(f"{_type_text(entry)} {entry.name}\n" for entry in fields_of(message))


def _type_text(entry: Field) -> str:
    element = entry.primitive or (entry.message.ros_name if entry.message else "")
    if entry.length is not None:
        return f"{element}[{entry.length}]"
    return f"{element}[]" if entry.sequence else element


def full_definition(message: type[RosMessage]) -> str:
    """Definition of a message and all nested ones, in MCAP's schema encoding ``ros2msg``."""
    return definition(message) + "".join(
        f"{'=' * 80}\nMSG: {nested.ros_name}\n{definition(nested)}"
        for nested in nested_messages(message)
    )


def nested_messages(message: type[RosMessage]) -> tuple[type[RosMessage], ...]:
    """All message types inside a message, each once, sorted by name."""
    found: dict[str, type[RosMessage]] = {}
    waiting = [message]
    while waiting:
        for entry in fields_of(waiting.pop()):
            if entry.message is not None and entry.message.ros_name not in found:
                found[entry.message.ros_name] = entry.message
                waiting.append(entry.message)
    return tuple(found[name] for name in sorted(found))


def type_hash(message: type[RosMessage]) -> str:
    """Type hash of a message: ``RIHS01_`` and 64 hexadecimal digits."""
    if message not in _HASHES:
        text = json.dumps(_all_descriptions(message), separators=(", ", ": "))
        _HASHES[message] = "RIHS01_" + hashlib.sha256(text.encode()).hexdigest()
    return _HASHES[message]


def _all_descriptions(message: type[RosMessage]) -> dict[str, Any]:
    return {
        "type_description": _description(message),
        "referenced_type_descriptions": [
            _description(nested) for nested in nested_messages(message)
        ],
    }


def _description(message: type[RosMessage]) -> dict[str, Any]:
    return {
        "type_name": full_name(message),
        "fields": [
            {"name": entry.name, "type": _type_description(entry)}
            for entry in fields_of(message)
        ],
    }


def _type_description(entry: Field) -> dict[str, Any]:
    number = _NESTED if entry.message is not None else _TYPE_IDS[entry.primitive]
    if entry.length is not None:
        number += _ARRAY
    elif entry.sequence:
        number += _SEQUENCE
    return {
        "type_id": number,
        "capacity": entry.length or 0,
        "string_capacity": 256 if entry.primitive == "string<=256" else 0,
        "nested_type_name": "" if entry.message is None else full_name(entry.message),
    }
