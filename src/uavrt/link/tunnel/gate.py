"""Decide on the drone which ground stations may command it; seal (authenticate) commands on the
ground.
"""

import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import inf
from typing import NoReturn

from uavrt.core.clock import monotonic_s, wall_ns
from uavrt.core.errors import LinkError, TunnelError
from uavrt.core.log import get_logger
from uavrt.core.newest import Newest
from uavrt.link.tunnel.generations.wire import Ids
from uavrt.link.tunnel.own_messages.link_messages import UNSEALED
from uavrt.link.tunnel.own_messages.motion_messages import is_stop, number_of
from uavrt.link.tunnel.own_messages.private import MOTION_STATE_TYPE, PROVEN_STATE_TYPE
from uavrt.link.tunnel.own_messages.seal import (
    ALIVE_INSIDE,
    PARAMETER_INSIDE,
    Key,
    SealKeeper,
    Session,
    keepalive_content,
    parameter_content,
    proven_answer,
    read_keepalive,
    read_key,
    seal,
    session_of,
)

ALIVE_S = 0.45
"""Time between two keepalives [s], plus up to 0.05 s. The drone waits 5 s, or nine keepalives,
before the link counts as lost. At 20 % loss, all nine are lost once in 600 flights of half an
hour."""
ECHO_S = 5.0
"""Largest accepted age of a nonce or of an announced session [s]."""
UNRETURNED_NONCES = 6
"""Number of nonces without an answer from the drone after which its software counts as too old
for sealed (authenticated) sessions. At 20 % loss in each direction this happens by chance once
in 500 starts, and only causes another request."""
MAX_ANNOUNCED = 4096
"""Largest number of remembered session announcements; a drone makes fewer in a year."""
FILES_S = 3.0
"""Time for which a sealed (authenticated) keepalive marks its station as requesting files [s].
"""
SEALED_ORDERS = 64
"""Largest number of remembered sealed motion orders, whose answers must carry a keyed hash."""
OLD_STATION = "this ground station's uavrt is older than the drone's. Update it; stop works"

log = get_logger()


class Gate:
    """Decides on the drone which ground stations may command it, by their number and key."""

    def __init__(
        self,
        commanders: tuple[int, ...] = (),
        key_file: str | None = None,
        *,
        key_required: bool = True,
    ) -> None:
        self._commanders = frozenset(commanders)
        self._key_required = key_required
        self._keeper = None if key_file is None else SealKeeper(read_key(key_file))
        self.refused = 0
        """Number of sealed messages that were forged, repeated or damaged."""
        self._sealed_s: dict[Ids, float] = {}
        """Time of each station's last message with a valid seal (keyed hash) [s]."""
        self._files_s: dict[Ids, float] = {}
        """Time of each station's last sealed keepalive that announces file requests [s]."""
        self._proving: set[Ids] = set()
        """Stations that check the keyed hash of answers: they have sent a sealed keepalive."""
        self._orders: Newest[tuple[Ids, int], None] = Newest(SEALED_ORDERS)
        """Station and request id of recent sealed motion orders."""
        self._proves = True

    @property
    def locked(self) -> bool:
        """True if only sealed commands are accepted."""
        return self._keeper is not None and self._key_required

    def refusal(self, sender: Ids, *, sealed: bool) -> str | None:
        """Reason why a sender may not command, by a sealed or open message; None if it may."""
        if self._commanders and sender[0] not in self._commanders:
            return f"system {sender[0]} may not command: see mavlink.commanders"
        if self.locked and not sealed:
            return "this drone has a key and only accepts sealed (authenticated) commands"
        return None

    def announcement(self, drone: Ids, nonce: int = 0) -> bytes | None:
        """Message that announces the drone's current session to ground stations; None without a
        key. Sealed messages are valid in this session only.
        """
        return None if self._keeper is None else self._keeper.announcement(drone, nonce)

    def open(self, payload: bytes, sender: Ids, drone: Ids) -> tuple[int, bytes] | None:
        """Open a sealed payload: kind and content; None, and counted, if its seal is bad."""
        try:
            if self._keeper is None:
                raise TunnelError("this drone has no key: set mavlink.key_file", payload)
            opened = self._keeper.open(payload, sender, drone)
        except TunnelError as error:
            self.refused += 1
            log.seldom(
                self.refused, "sealed (authenticated) message refused", reason=error.message
            )
            return None
        self._sealed_s[sender] = monotonic_s()
        return opened

    def silent_s(self) -> dict[Ids, float]:
        """Time since the last valid sealed message of each station [s]; stations without one
        are left out.
        """
        return {station: monotonic_s() - last_s for station, last_s in self._sealed_s.items()}

    def keepalive(self, inside: bytes, station: Ids, drone: Ids) -> bytes | None:
        """Handle a sealed keepalive; return the session with its nonce, None if it has none."""
        self._proving.add(station)
        nonce, files = read_keepalive(inside)
        if files:
            self._files_s[station] = monotonic_s()
        return self.announcement(drone, nonce) if nonce else None

    def asks_for_files(self, station: Ids) -> bool:
        """True if the latest sealed keepalives of a station announce file requests."""
        return monotonic_s() - self._files_s.get(station, -inf) < FILES_S

    @contextmanager
    def order(self, order: bytes, station: Ids, *, sealed: bool) -> Iterator[str | None]:
        """Context in which a motion order is handled; yields the reason of a refusal, or None.

        Answers that are sent within the block belong to this order.
        """
        refusal = self.refusal(station, sealed=sealed)
        if sealed:
            if station not in self._proving and not is_stop(order):
                refusal = OLD_STATION
            self._orders[station, number_of(order)] = None
        self._proves = sealed
        try:
            yield refusal
        finally:
            self._proves = True

    def answer(self, state: bytes, station: Ids, drone: Ids) -> tuple[bytes, int, bool]:
        """Encode an order's answer; return payload, payload type, and True if it is urgent.

        The answer to a sealed order gets a keyed hash (proof), unless an unsealed order with
        the same ids and number is being answered.
        """
        sealed = self._proves and (station, number_of(state)) in self._orders
        if sealed and station in self._proving and self._keeper is not None:
            proven = self._keeper.prove_answer(state, station, drone)
            return proven, PROVEN_STATE_TYPE, True
        return state, MOTION_STATE_TYPE, sealed or not self.locked


class Sealer:
    """Adds a keyed hash, made with the shared key, to messages of the ground station."""

    def __init__(self, key: Key, own: Ids) -> None:
        self._key = key
        self._own = own
        self._session: Session | None = None
        self._announced: dict[Session, _Announced] = {}
        self._nonces: dict[int, float] = {}
        self._last = 0
        self._alive_s = self._asked_s = -inf

    @property
    def ready(self) -> bool:
        """True once the session of the drone is confirmed."""
        return self._session is not None

    def accept_session(self, payload: bytes, drone: Ids) -> None:
        """Handle the drone's announcement of its session; raises `TunnelError` if invalid.

        Only a session that returns a recently sent nonce is used: any other announcement may be
        a recording.
        """
        session, newest, nonce = session_of(payload, self._key, drone)
        now_s = monotonic_s()
        self._last = max(self._last, newest)
        if nonce:
            if now_s - self._nonces.pop(nonce, -inf) > ECHO_S:
                raise TunnelError(
                    "a session announcement contains an unknown or old nonce", payload
                )
            self._session = session
            self._announced.pop(session, None)
        elif session != self._session:
            known = self._announced.setdefault(session, _Announced())
            known.heard_s = now_s
            if len(self._announced) > MAX_ANNOUNCED:
                del self._announced[next(iter(self._announced))]

    def keepalives(self, links: int = 1, *, files: bool = False) -> list[bytes]:
        """Sealed messages due now: a keepalive, and a nonce for an unconfirmed session.

        Of several announced sessions the one tried least often comes first, so that replayed
        announcements do not delay the drone's session.
        """
        now_s, due = monotonic_s(), []
        if self._session is not None and now_s - self._alive_s >= ALIVE_S / links:
            self._alive_s = now_s
            due.append(self._seal(keepalive_content(0, files=files), ALIVE_INSIDE))
        fresh = [s for s, one in self._announced.items() if now_s - one.heard_s < ECHO_S]
        if fresh and now_s - self._asked_s >= ALIVE_S:
            self._asked_s = now_s
            session = min(fresh, key=lambda one: self._announced[one].asked)
            self._announced[session].asked += 1
            nonce = secrets.randbits(63) | 1
            self._nonces = {n: s for n, s in self._nonces.items() if now_s - s <= ECHO_S}
            self._nonces[nonce] = now_s
            counter = self._next_counter()
            inside = keepalive_content(nonce)
            due.append(seal(inside, ALIVE_INSIDE, self._key, self._own, counter, session))
        return due

    def __call__(self, payload: bytes, payload_type: int) -> bytes:
        """Seal a payload of the given type to the drone."""
        return self._seal(payload, UNSEALED[payload_type].inside)

    def parameter(self, name: str, value: float) -> bytes:
        """Seal a request to change a parameter."""
        return self._seal(parameter_content(name, value), PARAMETER_INSIDE)

    def answer(self, payload: bytes, request_ids: Iterable[int]) -> bytes:
        """Check and remove the keyed hash of an order's answer; `TunnelError` if forged."""
        if self._session is None:
            raise TunnelError(
                "a reply was ignored, because the drone has not announced its session", payload
            )
        return proven_answer(payload, self._key, self._session, self._own, request_ids)

    @staticmethod
    def refuse_unproven(payload: bytes) -> NoReturn:
        """Raise `TunnelError` for an answer without proof to a sealed order."""
        raise TunnelError(
            "the answer to a sealed (authenticated) command is not authenticated", payload
        )

    def _next_counter(self) -> int:
        self._last = max(self._last + 1, wall_ns() // 1000)
        return self._last

    def _seal(self, inside: bytes, kind: int) -> bytes:
        if self._session is None and any(
            one.asked >= UNRETURNED_NONCES for one in self._announced.values()
        ):
            raise LinkError(
                "the drone does not confirm its session; its uavrt may be older than this one",
                remedy="Update the drone, or wait for a better radio link",
            )
        if self._session is None:
            raise LinkError(
                "the drone has announced no session for sealed (authenticated) commands",
                remedy="Check that it has mavlink.key_file with the same key",
            )
        return seal(inside, kind, self._key, self._own, self._next_counter(), self._session)


@dataclass(slots=True)
class _Announced:
    """A session announced as the drone's; it may come from a replayed recording."""

    heard_s: float = -inf
    asked: int = 0
    """Number of nonces sent so far to confirm this session."""
