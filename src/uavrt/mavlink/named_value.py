"""A number with a name, which stock ground stations show and plot: NAMED_VALUE_FLOAT (251).

It is only ever sent, so it stands here and not in the dialect of what is read as well.
Layout and checksum seed: the message in MAVLink's common.xml.
"""

import string
from struct import Struct
from typing import Self

from uavrt.mavlink.message import Message, bytes_of, text_of

NAME_BYTES = 10
DECIMAL_BELOW = 10 ** (NAME_BYTES - len("SNR_"))
_DIGITS = string.digits + string.ascii_uppercase


class NamedValueFloat(Message):
    """NAMED_VALUE_FLOAT: fields and units are MAVLink's own."""

    __slots__ = ("name", "time_boot_ms", "value")
    ID = 251
    NAME = "NAMED_VALUE_FLOAT"
    CRC_EXTRA = 170
    LAYOUT = Struct(f"<If{NAME_BYTES}s")

    def __init__(self, *, time_boot_ms: int, value: float, name: str) -> None:
        self.time_boot_ms, self.value, self.name = time_boot_ms, value, name

    def pack(self) -> bytes:
        """Whole payload, trailing zeros included."""
        return self.LAYOUT.pack(self.time_boot_ms, self.value, bytes_of(self.name))

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read a whole payload."""
        time_boot_ms, value, name = cls.LAYOUT.unpack(payload)
        return cls(time_boot_ms=time_boot_ms, value=value, name=text_of(name))


def value_name(kind: str, tag_id: int) -> str:
    """Make the name of a tag's value: ``SNR_2``; unique for every tag of 32 bits.

    Ten bytes hold an id of six digits; a longer one stands without the underscore, to the base
    of 36 (``SNRLFLS`` is tag 1 000 000).

    Parameters
    ----------
    kind : str
        Three letters.
    tag_id : int
        0 to 2**32 - 1.
    """
    if tag_id < DECIMAL_BELOW:
        return f"{kind}_{tag_id}"
    digits = ""
    while tag_id:
        tag_id, digit = divmod(tag_id, len(_DIGITS))
        digits = _DIGITS[digit] + digits
    return kind + digits
