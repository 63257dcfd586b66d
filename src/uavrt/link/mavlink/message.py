"""Base of the generated messages of `uavrt.link.mavlink.dialect`."""

from struct import Struct
from typing import Any, ClassVar, Self


class Message:
    """Base of all MAVLink messages; fields have the names and units of the MAVLink standard."""

    __slots__: tuple[str, ...] = ()
    ID: ClassVar[int]
    NAME: ClassVar[str]
    CRC_EXTRA: ClassVar[int]
    LAYOUT: ClassVar[Struct]

    def pack(self) -> bytes:
        """Encode the whole payload, including trailing zeros."""
        raise NotImplementedError

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read a whole payload of ``LAYOUT.size`` bytes."""
        raise NotImplementedError

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Decode a received payload. Missing trailing zeros are restored, extra fields of a
        newer sender ignored.
        """
        size = cls.LAYOUT.size
        return cls.unpack(payload[:size].ljust(size, b"\0"))

    def _values(self) -> tuple[Any, ...]:
        return tuple(getattr(self, name) for name in self.__slots__)

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        assert isinstance(other, Message)
        return self._values() == other._values()

    def __hash__(self) -> int:
        return hash((self.ID, self._values()))

    def __repr__(self) -> str:
        pairs = zip(self.__slots__, self._values(), strict=True)
        return (
            f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in pairs)})"
        )


def text_of(field: bytes) -> str:
    """Return the text in a char array up to the first NUL; invalid UTF-8 becomes U+FFFD."""
    return field.split(b"\0", 1)[0].decode("utf-8", errors="replace")


def bytes_of(text: str) -> bytes:
    """Encode a text for a char array; `struct` cuts or pads it to the size of the field."""
    return text.encode("utf-8", errors="replace")
