"""Convert link messages to bytes and back by a written list of their fields.

A layout is a text, one word for each field, in the order of the bytes (little-endian, no
alignment; types are those of `struct`):

===================  =====================================================================
``name:I``           one value; of several letters (``interval:ff``) a tuple
``name?:f``          a float that may be None, which is NaN on the wire
``a,b,c:B``          booleans, the first in bit 0
``:3x``              zero bytes; ignored when read
``name#:B``          number of items in the list of that name
``name*:H``          the list; ``name*other:H`` has as many items as the list ``other``
``name~``            remaining bytes
===================  =====================================================================
"""

import math
import struct
from collections.abc import Mapping, MutableMapping
from types import MappingProxyType
from typing import Any

from uavrt.core.errors import TunnelError

Limits = Mapping[str, tuple[float, float]]


class Layout:
    """Encoder and decoder of one link message.

    `what`: the message with its article, for errors.
    `fields`: see the module's text.
    `limits`: least and greatest value of a field, or number of items of a list.
    `**fixed`: fields that always have this value; a message with another is refused.
    """

    def __init__(
        self, what: str, fields: str, limits: Limits = MappingProxyType({}), **fixed: int
    ) -> None:
        self._what, self._limits, self._fixed = what, limits, fixed
        self._head: list[tuple[str, int]] = []
        self._lists: list[tuple[str, str, struct.Struct]] = []
        self._rest = ""
        head = "<"
        for field in fields.split():
            name, _, kind = field.partition(":")
            listed, star, counted = name.partition("*")
            if name.endswith("~"):
                self._rest = name[:-1]
            elif star:
                self._lists.append((listed, counted or listed, struct.Struct(f"<{kind}")))
            else:
                head += kind
                if name:
                    self._head.append((name, _values(kind)))
        self._struct = struct.Struct(head)
        self.size = self._struct.size
        """Size of a message's part before its first list [bytes]."""

    def pack(self, record: object = None, **changed: Any) -> bytes:
        """Encode a record's fields, or values given by name; `TunnelError` if too large."""

        def value(name: str) -> Any:
            return changed[name] if name in changed else getattr(record, name)

        flat: list[Any] = []
        try:
            for name, count in self._head:
                if name in self._fixed:
                    flat.append(self._fixed[name])
                elif name[-1] == "#":
                    flat.append(len(value(name[:-1])))
                elif name[-1] == "?":
                    known = value(name[:-1])
                    flat.append(math.nan if known is None else known)
                elif "," in name:
                    flat.append(sum(value(b) << n for n, b in enumerate(name.split(","))))
                else:
                    flat.extend(value(name) if count > 1 else (value(name),))
            lists = (
                item.pack(*(one if isinstance(one, tuple) else (one,)))
                for name, _, item in self._lists
                for one in value(name)
            )
            rest = value(self._rest) if self._rest else b""
            return self._struct.pack(*flat) + b"".join(lists) + rest
        except (struct.error, ValueError, OverflowError) as error:
            raise TunnelError(
                f"{self._what} does not fit into its message: {error}", b""
            ) from error

    def unpack(self, payload: bytes) -> MutableMapping[str, Any]:
        """Decode a payload to fields by name; `TunnelError` for a value outside its limits."""
        if len(payload) < self.size:
            self._refuse(f"has {len(payload)} bytes, not {self.size} or more", payload)
        flat = iter(self._struct.unpack_from(payload))
        got: MutableMapping[str, Any] = {}
        for name, count in self._head:
            one = next(flat)
            if name in self._fixed:
                if one != self._fixed[name]:
                    self._refuse(f"has {name} {one}, not {self._fixed[name]}", payload)
            elif name[-1] == "?":
                got[name[:-1]] = one if math.isfinite(one) else None
            elif "," in name:
                got.update((b, bool(one >> n & 1)) for n, b in enumerate(name.split(",")))
            else:
                got[name] = (one, *(next(flat) for _ in range(count - 1))) if count > 1 else one
        for name, one in got.items():
            self._check(name, one, payload)
        at = self.size
        for name, counted, item in self._lists:
            end = at + item.size * got[f"{counted}#"]
            items = [*item.iter_unpack(payload[at:end])] if end <= len(payload) else []
            got[name] = tuple(one[0] if len(one) == 1 else one for one in items)
            at = end
        if at > len(payload) or (at < len(payload) and not self._rest):
            self._refuse(f"has {len(payload)} bytes, not {at}", payload)
        if self._rest:
            got[self._rest] = payload[at:]
        return {name: one for name, one in got.items() if name[-1] != "#"}

    def _check(self, name: str, value: Any, payload: bytes) -> None:
        low, high = self._limits.get(name.rstrip("#"), (-math.inf, math.inf))
        for one in value if isinstance(value, tuple) else (value,):
            finite = not isinstance(one, float) or math.isfinite(one)
            if isinstance(one, int | float) and not (finite and low <= one <= high):
                counts = name[-1] == "#"
                text = f"has {one} {name[:-1]}" if counts else f"has {name} {one:g}"
                self._refuse(text, payload)

    def _refuse(self, fault: str, payload: bytes) -> None:
        raise TunnelError(f"{self._what} {fault}", payload)


def _values(kind: str) -> int:
    """Number of values that a format of `struct` holds."""
    layout = struct.Struct(f"<{kind}")
    return len(layout.unpack(bytes(layout.size)))
