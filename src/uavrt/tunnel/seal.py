"""Commands that nobody else can have sent, through an autopilot that breaks signatures.

PX4 1.17 garbles the 13 signature bytes of frames that it forwards (reference/mavlink.md §1), so
the proof is inside the payload, in our own payload type 60002::

    offset  type   field
    0       u8     version, 1
    1       u8     0: what is inside has payload type 0; 1: it is a receipt; 2: a parameter's
                   name, char[16], and wanted value, f32
    2       u16    zero
    4       u64    time of the sender [µs since 1970], strictly rising
    12      u8[8]  keyed BLAKE2b of the sender's system and component id, bytes 0 to 12, inside
    20             inside, at most 108 bytes

As in MAVLink's signing a message that is not newer than the one before is refused, and the
first of a sender may be at most a minute behind our own clock.
"""

import hashlib
import hmac
import struct
from dataclasses import dataclass
from pathlib import Path

from uavrt.errors import ConfigError, TunnelError

SEALED_SIZE = 20
MAX_INSIDE = 108
PLAIN_INSIDE, RECEIPT_INSIDE, PARAMETER_INSIDE = 0, 1, 2
LEAST_KEY = 16
BEHIND_US = 60_000_000
_HEAD = struct.Struct("<BBHQ")
_PARAMETER = struct.Struct("<16sf")
_VERSION = 1

Place = tuple[int, int]
"""System and component id of a sender."""


@dataclass(frozen=True, slots=True)
class Key:
    """The secret that drone and ground share; never shown."""

    secret: bytes

    def __repr__(self) -> str:
        return "Key(…)"


def read_key(path: str | Path) -> Key:
    """Read a key: at least 32 hexadecimal digits in a file.

    Raises
    ------
    ConfigError
        There is none.
    """
    try:
        secret = bytes.fromhex(Path(path).read_text("ascii").strip())
    except OSError as error:
        raise ConfigError(
            f"cannot read the key file {path}: {error.strerror}",
            remedy="`openssl rand -hex 32 > FILE` makes one",
        ) from error
    except ValueError as error:
        raise ConfigError(
            f"{path} is no key file", remedy="`openssl rand -hex 32 > FILE` makes one"
        ) from error
    if len(secret) < LEAST_KEY:
        raise ConfigError(
            f"the key in {path} is too short", remedy="`openssl rand -hex 32 > FILE` makes one"
        )
    return Key(secret)


def seal(inside: bytes, kind: int, key: Key, sender: Place, time_us: int) -> bytes:
    """Write a sealed payload; raises `TunnelError` when `inside` is too long."""
    if len(inside) > MAX_INSIDE:
        raise TunnelError(f"{len(inside)} bytes cannot be sealed, only {MAX_INSIDE}", inside)
    head = _HEAD.pack(_VERSION, kind, 0, time_us)
    return head + _mac(key, sender, head, inside) + inside


def parameter_inside(name: str, value: float) -> bytes:
    """Write what is inside for a parameter."""
    return _PARAMETER.pack(name.encode("ascii"), value)


def parameter_of(inside: bytes) -> tuple[str, float]:
    """Read a parameter's name and wanted value; raises `TunnelError`."""
    if len(inside) != _PARAMETER.size:
        raise TunnelError(f"a parameter has 20 bytes, not {len(inside)}", inside)
    name, value = _PARAMETER.unpack(inside)
    return name.split(b"\0", 1)[0].decode("ascii", "replace"), value


class SealKeeper:
    """Opens sealed payloads: right, new, and from whom they say.

    Parameters
    ----------
    key : Key
        The shared secret.
    """

    def __init__(self, key: Key) -> None:
        self._key = key
        self._newest_us: dict[Place, int] = {}

    def open(self, payload: bytes, sender: Place, now_us: int) -> tuple[int, bytes]:
        """Get what is inside, and its kind.

        Raises
        ------
        TunnelError
            Forged, repeated, or damaged; the text says which.
        """
        if len(payload) < SEALED_SIZE:
            raise TunnelError("a sealed message has at least 20 bytes", payload)
        head, mac, inside = payload[:12], payload[12:20], payload[20:]
        version, kind, _, time_us = _HEAD.unpack(head)
        if version != _VERSION or kind > PARAMETER_INSIDE:
            raise TunnelError("a sealed message of another version", payload)
        if not hmac.compare_digest(mac, _mac(self._key, sender, head, inside)):
            raise TunnelError("the seal is wrong: another key, or forged", payload)
        newest_us = self._newest_us.get(sender, now_us - BEHIND_US)
        if time_us <= newest_us:
            raise TunnelError("the sealed message is old: repeated by somebody", payload)
        self._newest_us[sender] = time_us
        return kind, inside


def _mac(key: Key, sender: Place, head: bytes, inside: bytes) -> bytes:
    keyed = hashlib.blake2b(key=key.secret[:64], digest_size=8, person=b"uavrt seal")
    keyed.update(bytes(sender) + head + inside)
    return keyed.digest()
