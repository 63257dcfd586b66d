"""Seals: keyed hashes in tunnel payloads, which show that drone and ground share a key.

PX4 1.17 garbles the 13 signature bytes of frames that it forwards, so the proof is inside the
payload. Layouts of sealed message (60002), session (60004) and proven answer (60011): the
manual's tunnel reference.

The drone draws a session at random whenever its connection starts. A seal is valid for one
drone, one session and one use. So no message can be replayed after a restart or to another
drone. This needs no correct clock and no stored data. A sender's counter begins above the
newest counter that the drone announces and above the sender's clock in microseconds.

Anyone can replay an announcement of the session. So the ground station seals a nonce for each
announced session, and uses the session whose drone returns it.
"""

import hashlib
import hmac
import secrets
import struct
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from uavrt.config.key_files import read_key_file
from uavrt.core.errors import TunnelError
from uavrt.link.tunnel.generations.wire import Ids

SEALED_SIZE = 20
MAX_INSIDE = 108
PLAIN_INSIDE, RECEIPT_INSIDE, PARAMETER_INSIDE, MOTION_INSIDE = 0, 1, 2, 3
CODED_TAG_INSIDE, NEIGHBOUR_INSIDE, ALIVE_INSIDE = 4, 5, 6
LEAST_KEY = 16
MOST_KEY = 256
_HEAD = struct.Struct("<BBHQ")
_PARAMETER = struct.Struct("<16sf")
_SESSION = struct.Struct("<B3xQQ")
_NONCE, _ALIVE = struct.Struct("<Q"), struct.Struct("<QB")
_VERSION, _VERSION_ECHO = 2, 3
_PROOF_SIZE = 7
"""Size of the keyed hash of an answer [bytes]. An attacker with 2000 guesses a second succeeds
within a day with p = 2e-9."""


@dataclass(frozen=True, slots=True)
class Key:
    """The secret key that drone and ground station share; it is never shown."""

    secret: bytes

    def __repr__(self) -> str:
        return "Key(…)"


def read_key(path: str | Path) -> Key:
    """Read a key of at least 32 hexadecimal digits from a file that only its owner may read."""
    return Key(read_key_file(path, "key file", least=LEAST_KEY, most=MOST_KEY))


@dataclass(frozen=True, slots=True)
class Session:
    """One run of a drone's connection process; a seal (keyed hash) is valid within it."""

    number: int
    drone: Ids

    def mixed_in(self) -> bytes:
        """Bytes that identify the session; they are part of each message's keyed hash."""
        return struct.pack("<QBB", self.number, *self.drone)


def seal(
    inside: bytes, kind: int, key: Key, sender: Ids, counter: int, session: Session
) -> bytes:
    """Make a sealed (authenticated) payload; raises `TunnelError` if `inside` is too long."""
    if len(inside) > MAX_INSIDE:
        raise TunnelError(
            f"{len(inside)} bytes are too many to be sealed (authenticated); the limit is "
            f"{MAX_INSIDE}",
            inside,
        )
    head = _HEAD.pack(_VERSION, kind, 0, counter)
    return head + _mac(key, session.mixed_in() + bytes(sender) + head + inside) + inside


def session_of(payload: bytes, key: Key, drone: Ids) -> tuple[Session, int, int]:
    """Decode an announcement: session, newest counter, nonce or 0; raises `TunnelError`."""
    head, mac = payload[:-8], payload[-8:]
    sizes = {_VERSION: _SESSION.size, _VERSION_ECHO: _SESSION.size + _NONCE.size}
    if not payload or len(head) != sizes.get(payload[0]):
        raise TunnelError("the session has an unsupported version", payload)
    if not hmac.compare_digest(mac, _session_mac(key, drone, head)):
        raise TunnelError("the session was announced with another key, or is forged", payload)
    _, number, newest = _SESSION.unpack_from(head)
    return Session(number, drone), newest, int.from_bytes(head[_SESSION.size :], "little")


def _session_mac(key: Key, drone: Ids, head: bytes) -> bytes:
    return _mac(key, b"session" + bytes(drone) + head)


def prove_answer(state: bytes, key: Key, session: Session, station: Ids) -> bytes:
    """Add a proof to the answer to a sealed order: type 60006 becomes 60011."""
    return bytes((state[1] | state[2] << 4,)) + _proof(state, key, session, station) + state[8:]


def proven_answer(
    payload: bytes, key: Key, session: Session, station: Ids, request_ids: Iterable[int]
) -> bytes:
    """Check an answer's proof and remove the proof; raises `TunnelError` if it is forged."""
    first = payload[0] if payload else 0
    for request_id in request_ids:
        number = request_id.to_bytes(4, "little")
        state = bytes((1, first & 15, first >> 4, 0)) + number + payload[8:]
        if hmac.compare_digest(payload[1:8], _proof(state, key, session, station)):
            return state
    raise TunnelError("the answer is forged, or belongs to another station's order", payload)


def _proof(state: bytes, key: Key, session: Session, station: Ids) -> bytes:
    return _mac(key, b"answer" + session.mixed_in() + bytes(station) + state)[:_PROOF_SIZE]


def keepalive_content(nonce: int, *, files: bool = False) -> bytes:
    """Make the content of a keepalive before sealing; the drone sends its nonce back.

    With `files`, the drone answers the station's file requests quickly even during detection.
    """
    return _ALIVE.pack(nonce, files)


def read_keepalive(inside: bytes) -> tuple[int, bool]:
    """Decode a keepalive: nonce, and whether files are requested; raises `TunnelError`."""
    if len(inside) != _ALIVE.size:
        raise TunnelError(f"a keepalive must have 9 bytes, not {len(inside)}", inside)
    nonce, flags = _ALIVE.unpack(inside)
    return nonce, bool(flags & 1)


def parameter_content(name: str, value: float) -> bytes:
    """Make the content of a parameter change before sealing."""
    return _PARAMETER.pack(name.encode("ascii"), value)


def read_parameter(inside: bytes) -> tuple[str, float]:
    """Decode a parameter change: name and requested value; raises `TunnelError`."""
    if len(inside) != _PARAMETER.size:
        raise TunnelError(f"a parameter change must have 20 bytes, not {len(inside)}", inside)
    name, value = _PARAMETER.unpack(inside)
    return name.split(b"\0", 1)[0].decode("ascii", "replace"), value


class SealKeeper:
    """Opens sealed payloads; refuses those that are forged, repeated or for another session."""

    def __init__(self, key: Key, session: int | None = None) -> None:
        self._key = key
        self._session = secrets.randbits(64) if session is None else session
        self._newest: dict[Ids, int] = {}

    def announcement(self, drone: Ids, nonce: int = 0) -> bytes:
        """Message that announces the session; a nonce in it proves that it is not a replay."""
        newest = max(self._newest.values(), default=0)
        version = _VERSION_ECHO if nonce else _VERSION
        head = _SESSION.pack(version, self._session, newest)
        head += _NONCE.pack(nonce) if nonce else b""
        return head + _session_mac(self._key, drone, head)

    def prove_answer(self, state: bytes, station: Ids, drone: Ids) -> bytes:
        """Add a keyed hash to the answer to a sealed order, as the function `prove_answer`."""
        return prove_answer(state, self._key, Session(self._session, drone), station)

    def open(self, payload: bytes, sender: Ids, drone: Ids) -> tuple[int, bytes]:
        """Open a sealed payload: its kind and content; raises `TunnelError` if refused."""
        if len(payload) < SEALED_SIZE:
            raise TunnelError("a sealed message must have 20 bytes or more", payload)
        head, mac, inside = payload[:12], payload[12:20], payload[20:]
        version, kind, _, counter = _HEAD.unpack(head)
        if version != _VERSION or kind > ALIVE_INSIDE:
            raise TunnelError("the sealed message has an unsupported version", payload)
        proven = Session(self._session, drone).mixed_in() + bytes(sender) + head + inside
        if not hmac.compare_digest(mac, _mac(self._key, proven)):
            raise TunnelError(
                "the seal (keyed hash) is wrong: other key, earlier session, other drone, "
                "or forged",
                payload,
            )
        if counter <= self._newest.get(sender, 0):
            raise TunnelError("the sealed message repeats an earlier one", payload)
        self._newest[sender] = counter
        return kind, inside


def _mac(key: Key, content: bytes) -> bytes:
    keyed = hashlib.blake2b(key=key.secret[:64], digest_size=8, person=b"uavrt seal")
    keyed.update(content)
    return keyed.digest()
