"""Explore all sequences of some events, breadth first, and merge equal states.

Two states are equal if everything that determines their further behaviour is equal; times
count by their age. Records that cannot change are shared between the copies of a state.
"""

import gc
from collections import Counter, deque
from collections.abc import Callable, Mapping
from enum import Enum
from functools import cache
from types import FunctionType, MappingProxyType, NoneType
from typing import Any, Protocol, TypeVar

from uavrt.core.newest import Newest

T = TypeVar("T")
Key = Callable[[Any, float], object]
_ATOMS: frozenset[type] = frozenset({int, str, bool, bytes, NoneType})
_unchanged: set[type] = {*_ATOMS, float}
"""Types whose objects never change."""


class Explored(Protocol):
    """A world that events change."""

    now_s: float

    @property
    def kind(self) -> str:
        """Kind of state, for the counts."""

    @property
    def events(self) -> tuple[str, ...]:
        """Events that are possible in this state."""

    def after(self, event: str) -> None:
        """Apply an event and advance the time by its duration."""

    def check(self) -> None:
        """Raise `AssertionError` if this state is not allowed."""


W = TypeVar("W", bound=Explored)


def explore(start: W, depth: int, keys: "Keys") -> Counter[str]:
    """Visit all states within `depth` events; an `AssertionError` names the events."""
    gc.disable()  # it would scan all kept states again and again
    try:
        return _explored(start, depth, keys)
    finally:
        gc.enable()


def _explored(start: W, depth: int, keys: "Keys") -> Counter[str]:
    counts: Counter[str] = Counter()
    seen = {hash(keys.of(start))}
    front: list[tuple[W, tuple[str, ...]]] = [(start, ())]
    for level in range(depth):
        following: list[tuple[W, tuple[str, ...]]] = []
        front.reverse()
        while front:
            world, story = front.pop()
            for event in world.events:
                after = copied(world)
                counts["transitions"] += 1
                try:
                    after.after(event)
                    key = hash(keys.of(after))
                    if key in seen:
                        continue
                    after.check()
                except AssertionError as error:
                    events = ", ".join((*story, event))
                    raise AssertionError(f"{events}: {error}") from error
                seen.add(key)
                counts[after.kind] += 1
                if level + 1 < depth:
                    following.append((after, (*story, event)))
        front = following
    counts["states"] = len(seen)
    return counts


def assert_equal_states_stay_equal(start: W, depth: int, keys: "Keys") -> int:
    """Check that states with equal keys behave equally; return the number of comparisons."""
    compared = 0
    follow: dict[object, list[tuple[object, ...]]] = {}
    front = [start]
    for _ in range(depth):
        following = []
        for world in front:
            key, events = keys.of(world), world.events
            afters = [copied(world) for _ in events]
            for after, event in zip(afters, events, strict=True):
                after.after(event)
            led = [keys.of(after) for after in afters]
            if key not in follow:
                follow[key] = led
                following += afters
            else:
                compared += 1
                differ = [e for e, a, b in zip(events, led, follow[key], strict=True) if a != b]
                assert not differ, f"two states with the key {key} differ after {differ}"
        front = following
    return compared


def copied(thing: T) -> T:
    """Copy mutable parts, and share the others."""
    if thing.__class__ in _unchanged:
        return thing
    kind: Any = type(thing)
    copy: Callable[[T], T] = _copier(kind)
    return copy(thing)


@cache
def _copier(kind: Any) -> Callable[[Any], Any]:
    parameters = getattr(kind, "__dataclass_params__", getattr(kind, "__struct_config__", None))
    frozen = parameters is not None and parameters.frozen
    if frozen or issubclass(kind, Enum | FunctionType | frozenset):
        _unchanged.add(kind)
        return lambda thing: thing
    if kind in (list, deque, tuple, set):
        return lambda thing: kind([copied(one) for one in thing])
    if issubclass(kind, Newest):
        return _copied_newest
    if issubclass(kind, dict):
        return lambda thing: kind({key: copied(one) for key, one in thing.items()})
    slots = _slots(kind)
    if not slots:
        return _copied_by_attributes
    return _made(  # type: ignore[no-any-return]
        "copy = new(kind)",
        *[
            f"copy.{one} = it if (it := thing.{one}).__class__ in unchanged else copied(it)"
            for one in slots
        ],
        "return copy",
        copied=copied,
        unchanged=_unchanged,
        new=object.__new__,
        kind=kind,
    )


def _copied_newest(thing: Newest[Any, Any]) -> Newest[Any, Any]:
    copy: Newest[Any, Any] = Newest(thing.most)
    copy.update({key: copied(one) for key, one in thing.items()})
    return copy


def _copied_by_attributes(thing: Any) -> Any:
    copy = object.__new__(type(thing))
    copy.__dict__ = attributes = thing.__dict__.copy()
    for name, one in attributes.items():
        if one.__class__ not in _unchanged:
            attributes[name] = copied(one)
    return copy


def _slots(kind: type) -> list[str]:
    return [name for one in kind.__mro__ for name in getattr(one, "__slots__", ())]


def _made(*lines: str, **names: Any) -> Any:
    """Compile a function over the attributes, which is much faster than a loop."""
    exec("\n    ".join(("def made(thing, now_s=0.0):", *lines)), names)
    return names["made"]


class Keys:
    """Reduce a state to a key: two states with equal keys behave equally from then on.

    `undecided`: attributes (``"Class.name"``, or ``".name"`` in any class) left out of the key:
    always, or when the function of their object is true.
    `oldest_s`: greatest distinguished age of a time, by the name of its attribute; ``""``: of
    all others.
    `reduced`: function of its object that replaces an attribute (``"Class.name"``) in the key.
    """

    def __init__(
        self,
        undecided: Mapping[str, Callable[[Any], bool] | None],
        oldest_s: Mapping[str, float],
        reduced: Mapping[str, Callable[[Any], Any]] = MappingProxyType({}),
    ) -> None:
        self._undecided, self._oldest_s, self._reduced = undecided, oldest_s, reduced
        self._by_kind: dict[type, Key] = {}

    def of(self, world: Explored) -> tuple[object, ...]:
        """Get the key of a state, one item for each attribute that decides."""
        key = self._key(world, world.now_s)
        assert isinstance(key, tuple)
        return key

    def _key(self, thing: Any, now_s: float) -> object:
        kind = type(thing)
        if kind in _ATOMS:
            return thing
        if kind is float:
            return round(thing, 7)
        key = self._by_kind.get(kind)
        if key is None:
            key = self._by_kind[kind] = self._key_of(kind, thing)
        return key(thing, now_s)

    def _key_of(self, kind: type, thing: object) -> Key:
        one_key = self._key
        if hasattr(kind, "state_key"):
            return kind.state_key  # type: ignore[no-any-return]
        if kind in (tuple, list, deque):
            return lambda many, now_s: tuple([one_key(one, now_s) for one in many])
        if issubclass(kind, set | frozenset):
            return lambda many, _: tuple(sorted(many))
        if issubclass(kind, dict):
            return lambda many, now_s: tuple(
                [(key, one_key(one, now_s)) for key, one in sorted(many.items())]
            )
        if issubclass(kind, Enum):
            return lambda one, _: one.value
        names: dict[str, Any] = {"one_key": one_key, "atoms": _ATOMS}
        parts = []
        for name in _slots(kind) or list(vars(thing)):
            part = self._part(name)
            full = f"{kind.__name__}.{name}"
            for rule in (f".{name}", full):
                if rule in self._undecided:
                    names[f"{name}_undecided"] = self._undecided[rule]
                    part = (
                        ""
                        if self._undecided[rule] is None
                        else f"None if {name}_undecided(thing) else {part}"
                    )
            if full in self._reduced:
                names[f"{name}_reduced"] = self._reduced[full]
                part = f"one_key({name}_reduced(thing), now_s)"
            if part:
                parts.append(part)
        key: Key = _made(f"return ({', '.join(parts)},)", **names)
        return key

    def _part(self, name: str) -> str:
        """Expression for one attribute."""
        it = f"it if (it := thing.{name}).__class__ in atoms else "
        if not name.endswith("_s") or name.endswith(("m_s", "deg_s")):
            return f"{it}one_key(it, now_s)"
        oldest_s = self._oldest_s.get(name.lstrip("_"), self._oldest_s[""])
        return f"{it}{oldest_s} if now_s - it > {oldest_s} else round(now_s - it, 2)"
