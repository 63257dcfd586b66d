"""Select and join rows of dataclasses whose array fields have one row for each item."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

R = TypeVar("R")


def chosen_rows(record: R, which: Any) -> R:
    """Copy a dataclass of arrays with the rows that a mask, slice or indices `which` select."""
    return replace(record, **{name: one[which] for name, one in _arrays(record)})  # type: ignore[type-var]


def joined_rows(records: Sequence[R], axis: int = 0) -> R:
    """Concatenate the arrays of several dataclasses along `axis`.

    Fields that are not arrays are copied from the first dataclass.
    """
    names = [name for name, _ in _arrays(records[0])]
    joined = {
        name: np.concatenate([getattr(one, name) for one in records], axis=axis)
        for name in names
    }
    return replace(records[0], **joined)  # type: ignore[type-var]


def _arrays(record: Any) -> list[tuple[str, Any]]:
    values = [(one.name, getattr(record, one.name)) for one in fields(record)]
    return [(name, value) for name, value in values if isinstance(value, np.ndarray)]
