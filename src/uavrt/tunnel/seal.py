"""Seals: proofs that drone and ground station share a key, inside tunnel payloads.

PX4 1.17 garbles the 13 signature bytes of frames that it forwards, so the proof is inside the
payload. Layouts of sealed message (60002), session (60004) and proven answer (60011): the
manual's tunnel reference.

The drone draws a session at random whenever its connection starts. A seal holds for one drone,
one session and one use: no message can be replayed, after a restart or to another drone,
whatever the clocks show, and nothing is stored. A sender's counter begins above the newest that
the drone announces and above its own clock's microseconds.

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
from uavrt.errors import TunnelError

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
"""56 bits: 2000 guesses a second for a day hit with a probability of 2e-9."""

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

    Raises `ConfigError` without one, or if others may read it.
    """
    return Key(read_key_file(path, "key file", least=LEAST_KEY, most=MOST_KEY))


@dataclass(frozen=True, slots=True)
class Session:
    """Validity of a seal: one run of one drone's connection."""

    number: int
    drone: Place

    def mixed_in(self) -> bytes:
        """Bytes that the seal proves in addition to the message."""
        return struct.pack("<QBB", self.number, *self.drone)


def seal(
    inside: bytes, kind: int, key: Key, sender: Place, counter: int, session: Session
) -> bytes:
    """Write a sealed payload; raises `TunnelError` when `inside` is too long."""
    if len(inside) > MAX_INSIDE:
        raise TunnelError(f"{len(inside)} bytes cannot be sealed, only {MAX_INSIDE}", inside)
    head = _HEAD.pack(_VERSION, kind, 0, counter)
    return head + _mac(key, session.mixed_in() + bytes(sender) + head + inside) + inside


def session_of(payload: bytes, key: Key, drone: Place) -> tuple[Session, int, int]:
    """Read an announcement: session, newest counter accepted in it, nonce returned (0: none).

    Raises `TunnelError` for anything else, or another key.
    """
    head, mac = payload[:-8], payload[-8:]
    sizes = {_VERSION: _SESSION.size, _VERSION_ECHO: _SESSION.size + _NONCE.size}
    if not payload or len(head) != sizes.get(payload[0]):
        raise TunnelError("a session has another version", payload)
    if not hmac.compare_digest(mac, _session_mac(key, drone, head)):
        raise TunnelError("a session was made with another key, or forged", payload)
    _, number, newest = _SESSION.unpack_from(head)
    return Session(number, drone), newest, int.from_bytes(head[_SESSION.size :], "little")


def _session_mac(key: Key, drone: Place, head: bytes) -> bytes:
    return _mac(key, b"session" + bytes(drone) + head)


def prove_answer(state: bytes, key: Key, session: Session, station: Place) -> bytes:
    """Turn an answer of type 60006 to a sealed order into one of type 60011 with a proof."""
    return bytes((state[1] | state[2] << 4,)) + _proof(state, key, session, station) + state[8:]


def proven_answer(
    payload: bytes, key: Key, session: Session, station: Place, request_ids: Iterable[int]
) -> bytes:
    """Turn an answer of type 60011 into one of 60006; raises `TunnelError` if forged."""
    first = payload[0] if payload else 0
    for request_id in request_ids:
        number = request_id.to_bytes(4, "little")
        state = bytes((1, first & 15, first >> 4, 0)) + number + payload[8:]
        if hmac.compare_digest(payload[1:8], _proof(state, key, session, station)):
            return state
    raise TunnelError("an answer is forged, or to an order of another station", payload)


def _proof(state: bytes, key: Key, session: Session, station: Place) -> bytes:
    return _mac(key, b"answer" + session.mixed_in() + bytes(station) + state)[:_PROOF_SIZE]


def alive_inside(nonce: int, *, files: bool = False) -> bytes:
    """Write the content of a sign of life.

    The drone returns a nonce other than 0. With `files` it answers the station's requests for
    files quickly, also while it detects.
    """
    return _ALIVE.pack(nonce, files)


def alive_of(inside: bytes) -> tuple[int, bool]:
    """Read a sign of life: nonce, and whether files are requested; raises `TunnelError`."""
    if len(inside) != _ALIVE.size:
        raise TunnelError(f"a sign of life has 9 bytes, not {len(inside)}", inside)
    nonce, flags = _ALIVE.unpack(inside)
    return nonce, bool(flags & 1)


def parameter_inside(name: str, value: float) -> bytes:
    """Write the content for a parameter."""
    return _PARAMETER.pack(name.encode("ascii"), value)


def parameter_of(inside: bytes) -> tuple[str, float]:
    """Read a parameter's name and wanted value; raises `TunnelError`."""
    if len(inside) != _PARAMETER.size:
        raise TunnelError(f"a parameter has 20 bytes, not {len(inside)}", inside)
    name, value = _PARAMETER.unpack(inside)
    return name.split(b"\0", 1)[0].decode("ascii", "replace"), value


class SealKeeper:
    """Opens sealed payloads that are authentic, new, and meant for us and this session."""

    def __init__(self, key: Key, session: int | None = None) -> None:
        self._key = key
        self._session = secrets.randbits(64) if session is None else session
        self._newest: dict[Place, int] = {}

    def announcement(self, drone: Place, nonce: int = 0) -> bytes:
        """Write the session for authorised senders; a nonce proves that it is current."""
        newest = max(self._newest.values(), default=0)
        version = _VERSION_ECHO if nonce else _VERSION
        head = _SESSION.pack(version, self._session, newest)
        head += _NONCE.pack(nonce) if nonce else b""
        return head + _session_mac(self._key, drone, head)

    def prove_answer(self, state: bytes, station: Place, drone: Place) -> bytes:
        """Turn an answer into one with a proof, see `prove_answer`."""
        return prove_answer(state, self._key, Session(self._session, drone), station)

    def open(self, payload: bytes, sender: Place, drone: Place) -> tuple[int, bytes]:
        """Get the content and its kind; raises `TunnelError` with the reason it is refused."""
        if len(payload) < SEALED_SIZE:
            raise TunnelError("a sealed message has at least 20 bytes", payload)
        head, mac, inside = payload[:12], payload[12:20], payload[20:]
        version, kind, _, counter = _HEAD.unpack(head)
        if version != _VERSION or kind > ALIVE_INSIDE:
            raise TunnelError("a sealed message of another version", payload)
        proven = Session(self._session, drone).mixed_in() + bytes(sender) + head + inside
        if not hmac.compare_digest(mac, _mac(self._key, proven)):
            raise TunnelError(
                "the seal is wrong: another key, an earlier session, another drone, or forged",
                payload,
            )
        if counter <= self._newest.get(sender, 0):
            raise TunnelError("the sealed message is old: repeated", payload)
        self._newest[sender] = counter
        return kind, inside


def _mac(key: Key, content: bytes) -> bytes:
    keyed = hashlib.blake2b(key=key.secret[:64], digest_size=8, person=b"uavrt seal")
    keyed.update(content)
    return keyed.digest()
