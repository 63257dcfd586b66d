"""Describe a record's fields for tables and files, from its dataclass.

A new field of `uavrt.core.messages.Pulse` becomes a column of the flight's database, of the
files of ``uavrt detect`` and of the page's records.
"""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, fields
from enum import StrEnum
from functools import lru_cache
from operator import attrgetter
from types import NoneType, UnionType
from typing import Any, Generic, Literal, TypeVar, get_args, get_origin, get_type_hints

import msgspec

R = TypeVar("R")
Row = tuple[Any, ...]
Kind = Literal["whole", "real", "switch", "word", "wholes", "reals"]

IN_NO_TABLE = "in no table"
"""Key in a field's dataclass metadata: the field gets no column, as its value is nested."""
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
    """True if the field's value may be None."""
    defaulted: bool
    """True if the field may be missing, as in older files."""
    length: int | None = None
    """Required number of values in a tuple of numbers; None: any."""


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
        raise TypeError(f"{name} is {hint}: no database column holds that")
    return RecordField(
        name=name, kind=kind, optional=optional, defaulted=defaulted, length=length
    )


class Columns(Generic[R]):
    """Columns of a table of records, and the conversion of a record to a row and back.

    A list of numbers is stored as text, with spaces or (`lists_as_json`) as JSON; NaN as NULL.
    """

    def __init__(
        self, kind: type[R], order: Sequence[str] = (), *, lists_as_json: bool = False
    ) -> None:
        described = {one.name: one for one in fields_of(kind)}
        columns = [described[name] for name in order or described]
        self.types = {one.name: SQL_TYPES[one.kind] for one in columns}
        self.names = ", ".join(self.types)
        """Names of the table's columns in order, separated by commas as in SQL."""
        self.declared = ", ".join(f"{name} {sql}" for name, sql in self.types.items())
        self._kind = kind
        self._values = attrgetter(*self.types)
        self._lists: list[tuple[int, Callable[[Any], float]]] = []
        self._switches: list[int] = []
        self._reals: list[int] = []
        for place, one in enumerate(columns):
            if one.kind in ("wholes", "reals"):
                self._lists.append((place, int if one.kind == "wholes" else float))
            elif one.kind == "switch":
                self._switches.append(place)
            elif one.kind == "real" and not one.optional:
                self._reals.append(place)
        self._json = lists_as_json

    def row(self, record: R) -> Row:
        """A record's values, converted for SQLite, in the order of the columns."""
        row = list(self._values(record))
        for place, _ in self._lists:
            numbers = row[place]
            text = json.dumps(numbers) if self._json else " ".join(map(repr, numbers))
            row[place] = text if numbers else None
        return tuple(row)

    def values(self, row: Row) -> dict[str, Any]:
        """Values of a row by column name; raises `ValueError` or `TypeError` if invalid."""
        values = list(row)
        for place in self._reals:
            if values[place] is None:
                values[place] = math.nan
        for place in self._switches:
            values[place] = bool(values[place])
        for place, number in self._lists:
            text = values[place]
            parts = _from_json(text or "[]") if self._json else str(text or "").split()
            values[place] = tuple(map(number, parts))
        return dict(zip(self.types, values, strict=True))

    def record(self, row: Row) -> R:
        """Make a record from a row; raises `ValueError` or `TypeError` for invalid values."""
        return msgspec.convert(self.values(row), self._kind)  # faster than its constructor


_from_json = lru_cache(maxsize=256)(json.loads)
"""Parse a JSON list of numbers, cached because thousands of tags share few intervals."""
