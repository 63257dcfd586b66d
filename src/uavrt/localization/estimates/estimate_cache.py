"""Cache of results for repeated estimates; the key of a result consists of all its inputs."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")


class Cache:
    """Cache for a caller that repeats estimates while data arrive.

    A function computes each value from its inputs, which are also the value's key: so the key
    cannot lack an input.
    """

    def __init__(self) -> None:
        self.more = False
        """True if the last estimate reached its limit and deferred new values to the next."""
        self._before: dict[Hashable, Any] = {}
        self._now: dict[Hashable, Any] = {}
        self._left: dict[str, int] = {}
        self._last: dict[Hashable, Any] = {}
        self._made: dict[Hashable, int] = {}

    def begin(self, at_once: Mapping[str, int] = MappingProxyType({})) -> None:
        """Begin an estimate; values that the last estimate did not use are removed.

        `at_once` limits the number of new values of each kind. Beyond the limit, a subject
        (such as a turn) keeps its last value; the next estimate updates the oldest values
        first. A kind that is not in `at_once` has no limit.
        """
        self._before, self._now = self._now, {}
        self._left, self.more = dict(at_once), False

    def get(self, make: Callable[..., T], *inputs: object, **named: object) -> T:
        """Return the cached result of a function for these inputs; it is computed if it is
        missing.
        """
        return self._get(_key(make, inputs, named), make, inputs, named)

    def latest(
        self, kind: str, subject: Hashable, make: Callable[..., T], *inputs: object
    ) -> T | None:
        """Return the value for a subject and inputs; if the limit is reached, the subject's
        last value or None.
        """
        key = _key(make, inputs, {})
        if key not in self._now and key not in self._before:
            if self._left.get(kind, 1) <= 0:
                self.more = True
                last: T | None = self._last.get((kind, subject))
                return last
            if kind in self._left:
                self._left[kind] -= 1
            self._made[kind, subject] = max(self._made.values(), default=0) + 1
        found = self._last[kind, subject] = self._get(key, make, inputs, {})
        return found

    def waiting(self, kind: str, subjects: Sequence[Hashable]) -> list[int]:
        """Indices of the subjects, sorted by the age of their values, oldest first."""
        made = [self._made.get((kind, one), 0) for one in subjects]
        return sorted(range(len(subjects)), key=made.__getitem__)

    def _get(
        self,
        key: Hashable,
        make: Callable[..., T],
        inputs: tuple[object, ...],
        named: Mapping[str, object],
    ) -> T:
        if key not in self._now:
            found = self._before[key] if key in self._before else make(*inputs, **named)
            self._now[key] = found
        kept: T = self._now[key]
        return kept


def _key(
    make: Callable[..., object], inputs: tuple[object, ...], named: Mapping[str, object]
) -> Hashable:
    return make, _content(inputs), _content(named)


def _content(value: object) -> Hashable:
    if isinstance(value, np.ndarray):
        return value.dtype.char, value.shape, value.tobytes()
    if isinstance(value, Mapping):
        return tuple((key, _content(one)) for key, one in value.items())
    if isinstance(value, tuple | list):
        return tuple(map(_content, value))
    if is_dataclass(value) and type(value).__eq__ is object.__eq__:  # of arrays
        held = (_content(getattr(value, one.name)) for one in fields(value))
        return type(value), *held
    if isinstance(value, float) and value != value:
        return "not a number"
    assert isinstance(value, Hashable)
    return value
