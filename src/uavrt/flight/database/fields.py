"""Describe the fields of a record for tables and files, as derived from its dataclass.

A new field of `uavrt.core.messages.Pulse` thus becomes a column of the flight's database, of
the files of ``uavrt detect`` and of the records on the web page.
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from enum import StrEnum
from functools import lru_cache
from operator import attrgetter
from types import MappingProxyType, NoneType, UnionType
from typing import Any, Generic, Literal, TypeVar, get_args, get_origin, get_type_hints

import msgspec

R = TypeVar("R")
Row = tuple[Any, ...]
Kind = Literal["whole", "real", "switch", "word", "wholes", "reals", "named"]

IN_NO_TABLE = "in no table"
"""Metadata key of a dataclass field that gets no column, as its value is nested."""
_KINDS: dict[Any, Kind] = {int: "whole", float: "real", bool: "switch", str: "word"}
SQL_TYPES: dict[Kind, str] = {
    "whole": "INTEGER",
    "real": "REAL",
    "switch": "INTEGER",
    "word": "TEXT",
    "wholes": "TEXT",
    "reals": "TEXT",
    "named": "TEXT",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordField:
    """Name, type and limits of one field of a record."""

    name: str
    kind: Kind
    optional: bool
    """True if the field's value may be None."""
    defaulted: bool
    """True if the field has a default, so that files of older versions may lack it."""
    length: int | None = None
    """Required number of values, if the field is a tuple of numbers; None: any number."""


def fields_of(record: type) -> tuple[RecordField, ...]:
    """Describe a dataclass's fields; raises `TypeError` for a field that no column can hold."""
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
    elif get_origin(hint) is dict:
        kind = "named"
    elif hint in _KINDS:
        kind = _KINDS[hint]
    elif get_origin(hint) is not Literal and not issubclass(hint, StrEnum):
        raise TypeError(
            f"the field {name} has the type {hint}, which no database column can hold"
        )
    return RecordField(
        name=name, kind=kind, optional=optional, defaulted=defaulted, length=length
    )


class Columns(Generic[R]):
    """Columns of a table of records, and the conversion of a record to a row and back.

    A list of numbers is stored as text: separated by spaces, or as JSON with `lists_as_json`. A
    dictionary of numbers is stored as JSON, and NaN as NULL. For a field in `spread`, each
    number has its own column.
    """

    def __init__(
        self,
        kind: type[R],
        order: Sequence[str] = (),
        *,
        lists_as_json: bool = False,
        spread: Mapping[str, Sequence[str]] = MappingProxyType({}),
    ) -> None:
        described = {one.name: one for one in fields_of(kind)}
        self._kind = kind
        self._names = tuple(order or described)
        self._values = attrgetter(*self._names)
        self.types: dict[str, str] = {}
        self._spread: list[slice] = []
        self._encode: list[tuple[int, Callable[[Any], Any]]] = []
        self._decode: list[tuple[int, Callable[[Any], Any]]] = []
        self._reals: list[int] = []
        for place, one in enumerate(described[name] for name in self._names):
            if one.name in spread:
                first = len(self.types)
                self.types |= dict.fromkeys(spread[one.name], "REAL")
                self._spread.append(slice(first, len(self.types)))
                continue
            self.types[one.name] = SQL_TYPES[one.kind]
            if one.kind == "switch":
                self._decode.append((place, bool))
            elif one.kind == "real" and not one.optional:
                self._reals.append(place)
            elif one.kind in ("wholes", "reals", "named"):
                encode, decode = _text_codec(one.kind, as_json=lists_as_json)
                self._encode.append((place, encode))
                self._decode.append((place, decode))
        self.names = ", ".join(self.types)
        """Names of the table's columns in order, separated by commas as in SQL."""
        self.declared = ", ".join(f"{name} {sql}" for name, sql in self.types.items())

    def row(self, record: R) -> Row:
        """A record's values, converted for SQLite, in the order of the columns."""
        row = list(self._values(record))
        for place, encode in self._encode:
            row[place] = encode(row[place])
        for cells in self._spread:
            row[cells.start : cells.start + 1] = row[cells.start]
        return tuple(row)

    def values(self, row: Row) -> dict[str, Any]:
        """Values of a row by field name; raises `ValueError` or `TypeError` if invalid."""
        values = list(row)
        for cells in reversed(self._spread):
            numbers = tuple(math.nan if one is None else one for one in values[cells])
            values[cells] = [numbers]
        for place in self._reals:
            if values[place] is None:
                values[place] = math.nan
        for place, decode in self._decode:
            values[place] = decode(values[place])
        return dict(zip(self._names, values, strict=True))

    def record(self, row: Row) -> R:
        """Create a record from a row; raises `ValueError` or `TypeError` for invalid values."""
        return msgspec.convert(self.values(row), self._kind)  # faster than its constructor


_from_json = lru_cache(maxsize=256)(json.loads)
"""Parse a JSON list of numbers; results are cached, as thousands of tags share few lists."""


def _text_codec(
    kind: Kind, *, as_json: bool
) -> tuple[Callable[[Any], str | None], Callable[[Any], Any]]:
    """Two functions: one converts numbers to text, one reverses this; an empty list is NULL."""
    if kind == "named":
        return json.dumps, json.loads
    number = int if kind == "wholes" else float
    if as_json:
        return (
            lambda numbers: json.dumps(numbers) if numbers else None,
            lambda text: tuple(map(number, _from_json(text or "[]"))),
        )
    return (
        lambda numbers: " ".join(map(repr, numbers)) or None,
        lambda text: tuple(map(number, str(text or "").split())),
    )
