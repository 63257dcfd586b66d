"""Build hook: write the MAVLink dialect ``uavrt.mavlink.dialect`` from its XML.

It runs in every build, also of an editable install. The XML comes from pymavlink's wheel (a
build requirement, never needed at run time) and from ``src/uavrt/mavlink/extra.xml``; which
messages and enumerations are wanted stands in ``src/uavrt/mavlink/dialect.toml``. Nothing
generated is committed. By hand: ``python hatch_build.py``.

pymavlink's parser gives field order, sizes and checksum seeds; the code is written here and not
by its own generator for reasons in docs/decisions/0030.
"""

import os
import textwrap
import tomllib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PACKAGE = Path("src/uavrt/mavlink")
OUTPUT = PACKAGE / "dialect" / "__init__.py"

# First one wins where two define the same message.
XML_FILES = (
    "minimal", "standard", "common", "ardupilotmega", "development", "uAvionix", "icarous",
    "loweheiser", "cubepilot", "csAirLink", "storm32", "ASLUAV", "AVSSUAS", "ualberta",
)  # fmt: skip

STRUCT_CODES = {
    "float": "f", "double": "d", "char": "s",
    "int8_t": "b", "int16_t": "h", "int32_t": "i", "int64_t": "q",
    "uint8_t": "B", "uint16_t": "H", "uint32_t": "I", "uint64_t": "Q",
}  # fmt: skip

HEADER = '''\
"""MAVLink messages; written by hatch_build.py from XML, do not edit."""

from enum import IntEnum
from struct import Struct

from uavrt.mavlink.message import Message, bytes_of, text_of
'''


class CustomBuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Write the dialect before a wheel or an editable install is made."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Generate and declare the file, which git ignores, as part of the wheel."""
        generate(Path(self.root))
        build_data["artifacts"].append(f"/{OUTPUT.as_posix()}")


def generate(root: Path) -> None:
    """Write the dialect below `root`; leave the file alone when nothing has changed."""
    from pymavlink.dialects import v20
    from pymavlink.generator import mavparse

    folder = Path(next(iter(v20.__path__)))
    wanted = tomllib.loads((root / PACKAGE / "dialect.toml").read_text())
    paths = [root / PACKAGE / "extra.xml", *(folder / f"{name}.xml" for name in XML_FILES)]
    files = [mavparse.MAVXML(str(path), mavparse.PROTOCOL_2_0) for path in paths]
    source = module_source(files, wanted["messages"], wanted["enums"])
    output = root / OUTPUT
    if output.exists() and output.read_text() == source:
        return
    output.parent.mkdir(parents=True, exist_ok=True)
    draft = output.with_name(f".draft-{os.getpid()}")
    draft.write_text(source)
    draft.replace(output)  # whole or not at all: others may be importing it


def module_source(files: list[Any], messages: list[str], enums: dict[str, list[str]]) -> str:
    """Text of the module."""
    by_id: dict[int, Any] = {}
    for file in files:
        for message in file.message:
            by_id.setdefault(message.id, message)
    by_name = {message.name: message for message in by_id.values()}
    missing = sorted(set(messages) - set(by_name))
    if missing:
        raise ValueError(f"no XML defines {', '.join(missing)}")
    chosen = sorted((by_name[name] for name in messages), key=lambda message: message.id)
    parts = [HEADER]
    parts += [enum_source(files, name, entries) for name, entries in enums.items()]
    parts += [message_source(message) for message in chosen]
    lines = [
        f"    {class_name(message.name)}.ID: {class_name(message.name)},\n"
        for message in chosen
    ]
    parts.append("MESSAGES: dict[int, type[Message]] = {\n" + "".join(lines) + "}\n")
    seeds = ", ".join(f"{number}: {m.crc_extra}" for number, m in sorted(by_id.items()))
    seeds = textwrap.fill(seeds, 92, initial_indent="    ", subsequent_indent="    ")
    parts.append(f"CRC_EXTRAS: dict[int, int] = {{\n{seeds}\n}}\n")
    return "\n\n".join(parts)


def class_name(name: str) -> str:
    """``ATTITUDE_QUATERNION`` to ``AttitudeQuaternion``."""
    return "".join(word.capitalize() for word in name.split("_"))


def enum_source(files: list[Any], name: str, entries: list[str]) -> str:
    """Source of one enumeration, with all its entries or those named."""
    values: dict[str, int] = {}
    for enum in (enum for file in files for enum in file.enum if enum.name == name):
        for entry in enum.entry:
            short = entry.name.removeprefix("MAV_")
            values.setdefault(short.removeprefix(name.removeprefix("MAV_") + "_"), entry.value)
    chosen = entries or [key for key in values if not key.endswith("ENUM_END")]
    lines = [f"    {key} = {values[key]}" for key in chosen]
    return (
        f'class {class_name(name)}(IntEnum):\n    """{name}."""\n\n' + "\n".join(lines) + "\n"
    )


def message_source(message: Any) -> str:
    """Source of one message class; arrays of bytes are one value, not 128 integers."""
    first_extension = message.base_fields()
    arguments = [
        f"{field.name}: {type_of(field)}" + (f" = {default_of(field)}" if extension else "")
        for field, extension in (
            (field, place >= first_extension) for place, field in enumerate(message.fields)
        )
    ]
    layout, packed, unpacked, place = "<", [], [], 0
    for field in message.ordered_fields:
        value, cell, cells = f"self.{field.name}", f"values[{place}]", 1
        if is_text(field):
            value, cell = f"bytes_of({value})", f"text_of({cell})"
        elif field.array_length and not is_bytes(field):
            cells = field.array_length
            value, cell = f"*{value}", f"values[{place}:{place + cells}]"
        code = "s" if is_bytes(field) else STRUCT_CODES[field.type]
        layout += f"{field.array_length or ''}{code}"
        packed.append(value)
        unpacked.append(f"{field.name}={cell}")
        place += cells
    text = " ".join(message.description.split()).replace("\\", "/").replace('"', "'")
    names = [field.name for field in message.fields]
    return f'''\
class {class_name(message.name)}(Message):
    """{text}"""

    __slots__ = ({"".join(f"{name!r}, " for name in names)})
    ID = {message.id}
    NAME = "{message.name}"
    CRC_EXTRA = {message.crc_extra}
    LAYOUT = Struct("{layout}")

    def __init__(self, *, {", ".join(arguments)}) -> None:
        {"; ".join(f"self.{name} = {name}" for name in names)}

    def pack(self) -> bytes:
        return self.LAYOUT.pack({", ".join(packed)})

    @classmethod
    def unpack(cls, payload: bytes) -> "{class_name(message.name)}":
        values = cls.LAYOUT.unpack(payload)
        return cls({", ".join(unpacked)})
'''


def is_text(field: Any) -> bool:
    """Tell whether a field is text."""
    return bool(field.type == "char" and field.array_length)


def is_bytes(field: Any) -> bool:
    """Tell whether a field is a run of bytes."""
    return bool(field.type == "uint8_t" and field.array_length)


def type_of(field: Any) -> str:
    """Python type of a field."""
    if is_text(field):
        return "str"
    if is_bytes(field):
        return "bytes"
    number = "float" if field.type in ("float", "double") else "int"
    return f"tuple[{number}, ...]" if field.array_length else number


def default_of(field: Any) -> str:
    """Zero, as MAVLink 2 fills extension fields that a sender does not know."""
    if is_text(field):
        return '""'
    if is_bytes(field):
        return f"bytes({field.array_length})"
    return f"(0,) * {field.array_length}" if field.array_length else "0"


if __name__ == "__main__":
    generate(Path(__file__).parent)
