"""Describe a record's fields for tables and files, from its dataclass.

A new field of `uavrt.core.messages.Pulse` becomes a column of the flight's database, of the
files of ``uavrt detect`` and of the page's records.
"""

from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from enum import StrEnum
from types import NoneType, UnionType
from typing import Any, Literal, get_args, get_origin, get_type_hints

Kind = Literal["whole", "real", "switch", "word", "wholes", "reals"]

IN_NO_TABLE = "in no table"
"""Metadata key that marks a field without a column, because its value is not a plain one."""
_KINDS: dict[Any, Kind] = {int: "whole", float: "real", bool: "switch", str: "word"}
SQL_TYPES: dict[Kind, str] = {
    "whole": "INTEGER",
    "real": "REAL",
    "switch": "INTEGER",
    "word": "TEXT",
    "wholes": "TEXT",
    "reals": "TEXT",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordField:
    """Name, type and limits of one field of a record."""

    name: str
    kind: Kind
    optional: bool
    """True if the value may be None."""
    defaulted: bool
    """True if the field may be missing, as in older files."""
    length: int | None = None
    """Required number of values in a tuple of numbers; None: any."""

    @property
    def to_sql(self) -> Callable[[Any], Any] | None:
        """Function that converts a value for the database; None if none is needed."""
        return _joined if self.kind in ("wholes", "reals") else None

    @property
    def from_sql(self) -> Callable[[Any], Any] | None:
        """Function that converts a database cell to a value; None if none is needed.

        NaN is stored as NULL, which each table's own reader converts.
        """
        match self.kind:
            case "switch":
                return bool
            case "wholes":
                return _parted
            case "reals":
                return _parted_reals
        return None


def fields_of(record: type) -> tuple[RecordField, ...]:
    """Describe a dataclass's fields; raises `TypeError` unless all are plain values."""
    hints = get_type_hints(record)
    return tuple(
        _field(item.name, hints[item.name], defaulted=item.default is not MISSING)
        for item in fields(record)
        if not item.metadata.get(IN_NO_TABLE)
    )


def _field(name: str, hint: Any, *, defaulted: bool) -> RecordField:
    optional = get_origin(hint) is UnionType and NoneType in get_args(hint)
    if optional:
        (hint,) = (one for one in get_args(hint) if one is not NoneType)
    kind: Kind = "word"
    length: int | None = None
    if get_origin(hint) is tuple:
        kind = "reals" if get_args(hint)[0] is float else "wholes"
        length = None if Ellipsis in get_args(hint) else len(get_args(hint))
    elif hint in _KINDS:
        kind = _KINDS[hint]
    elif get_origin(hint) is not Literal and not issubclass(hint, StrEnum):
        raise TypeError(f"{name} is {hint}: no column holds that")
    return RecordField(
        name=name, kind=kind, optional=optional, defaulted=defaulted, length=length
    )


def _joined(numbers: tuple[float, ...]) -> str | None:
    return " ".join(map(repr, numbers)) if numbers else None


def _parted(text: str | None) -> tuple[int, ...]:
    return tuple(map(int, str(text).split())) if text else ()


def _parted_reals(text: str | None) -> tuple[float, ...]:
    return tuple(map(float, str(text).split())) if text else ()
