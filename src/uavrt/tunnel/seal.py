"""Commands that nobody else can have sent, through an autopilot that breaks signatures.

PX4 1.17 garbles the 13 signature bytes of frames that it forwards, so
the proof is inside the payload, in our own payload type 60002::

    offset  type   field
    0       u8     version, 2
    1       u8     0: what is inside has payload type 0; 1: it is a receipt; 2: a parameter's
                   name, char[16], and wanted value, f32; 3: an order of motion
                   (`uavrt.tunnel.motion`); 4: a coded tag (`uavrt.tunnel.coded_tag`); 5:
                   what is told of another drone (`uavrt.tunnel.neighbours`)
    2       u16    zero
    4       u64    counter of the sender, strictly rising
    12      u8[8]  keyed BLAKE2b of the session (u64), the drone's system and component id, the
                   sender's, bytes 0 to 11, inside
    20             inside, at most 108 bytes

The drone draws a session at random whenever its connection starts, and tells it once a second
in payload type 60004::

    0       u8     version, 2
    1       u8[3]  zero
    4       u64    session
    12      u64    newest counter that it has taken
    20      u8[8]  keyed BLAKE2b of "session", the drone's system and component id,
                   bytes 0 to 19

So a message holds for one drone and one session alone, and within it once: none can be
repeated after a restart or to another drone, whatever any clock says, and nothing needs to be
remembered on a disk. A sender begins above the newest counter and above its own clock's
microseconds.
"""

import hashlib
import hmac
import secrets
import struct
from dataclasses import dataclass
from pathlib import Path

from uavrt.config import read_key_file
from uavrt.errors import TunnelError

SEALED_SIZE = 20
MAX_INSIDE = 108
PLAIN_INSIDE, RECEIPT_INSIDE, PARAMETER_INSIDE, MOTION_INSIDE = 0, 1, 2, 3
CODED_TAG_INSIDE, NEIGHBOUR_INSIDE = 4, 5
LEAST_KEY = 16
MOST_KEY = 256
_HEAD = struct.Struct("<BBHQ")
_PARAMETER = struct.Struct("<16sf")
_SESSION = struct.Struct("<B3xQQ")
_VERSION = 2

Place = tuple[int, int]
"""System and component id of a sender."""


@dataclass(frozen=True, slots=True)
class Key:
    """The secret that drone and ground share; never shown."""

    secret: bytes

    def __repr__(self) -> str:
        return "Key(…)"


def read_key(path: str | Path) -> Key:
    """Read a key: at least 32 hexadecimal digits in a file that only its owner may read.

    Raises
    ------
    ConfigError
        There is none, or others may read it.
    """
    return Key(read_key_file(path, "key file", least=LEAST_KEY, most=MOST_KEY))


@dataclass(frozen=True, slots=True)
class Session:
    """What a seal is for: one run of one drone's connection."""

    number: int
    drone: Place

    def mixed_in(self) -> bytes:
        """Get the bytes that the seal proves besides the message."""
        return struct.pack("<QBB", self.number, *self.drone)


def seal(
    inside: bytes, kind: int, key: Key, sender: Place, counter: int, session: Session
) -> bytes:
    """Write a sealed payload; raises `TunnelError` when `inside` is too long."""
    if len(inside) > MAX_INSIDE:
        raise TunnelError(f"{len(inside)} bytes cannot be sealed, only {MAX_INSIDE}", inside)
    head = _HEAD.pack(_VERSION, kind, 0, counter)
    return head + _mac(key, session.mixed_in() + bytes(sender) + head + inside) + inside


def session_of(payload: bytes, key: Key, drone: Place) -> tuple[Session, int]:
    """Read what a drone reports its session, and the newest counter it has taken.

    Raises
    ------
    TunnelError
        It is none, or made with another key.
    """
    size = _SESSION.size
    if len(payload) != size + 8 or payload[0] != _VERSION:
        raise TunnelError("no session of version 2", payload)
    if not hmac.compare_digest(payload[size:], _session_mac(key, drone, payload[:size])):
        raise TunnelError("a session made with another key, or forged", payload)
    _, number, newest = _SESSION.unpack(payload[:size])
    return Session(number, drone), newest


def _session_mac(key: Key, drone: Place, head: bytes) -> bytes:
    return _mac(key, b"session" + bytes(drone) + head)


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
    """Opens sealed payloads that are authentic, new, and meant for this drone and session.

    Parameters
    ----------
    key : Key
        The shared secret.
    session : int, optional
        Number of the session; drawn at random unless given.
    """

    def __init__(self, key: Key, session: int | None = None) -> None:
        self._key = key
        self._session = secrets.randbits(64) if session is None else session
        self._newest: dict[Place, int] = {}

    def announcement(self, drone: Place) -> bytes:
        """Write the session for who may command."""
        newest = max(self._newest.values(), default=0)
        head = _SESSION.pack(_VERSION, self._session, newest)
        return head + _session_mac(self._key, drone, head)

    def open(self, payload: bytes, sender: Place, drone: Place) -> tuple[int, bytes]:
        """Get what is inside, and its kind.

        Raises
        ------
        TunnelError
            Forged, repeated, damaged, or for another drone or session; the text says which.
        """
        if len(payload) < SEALED_SIZE:
            raise TunnelError("a sealed message has at least 20 bytes", payload)
        head, mac, inside = payload[:12], payload[12:20], payload[20:]
        version, kind, _, counter = _HEAD.unpack(head)
        if version != _VERSION or kind > NEIGHBOUR_INSIDE:
            raise TunnelError("a sealed message of another version", payload)
        proven = Session(self._session, drone).mixed_in() + bytes(sender) + head + inside
        if not hmac.compare_digest(mac, _mac(self._key, proven)):
            raise TunnelError(
                "the seal is wrong: another key, an earlier session, another drone, or forged",
                payload,
            )
        if counter <= self._newest.get(sender, 0):
            raise TunnelError("the sealed message is old: repeated by somebody", payload)
        self._newest[sender] = counter
        return kind, inside


def _mac(key: Key, content: bytes) -> bytes:
    keyed = hashlib.blake2b(key=key.secret[:64], digest_size=8, person=b"uavrt seal")
    keyed.update(content)
    return keyed.digest()
