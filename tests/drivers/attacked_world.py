"""The world of one `Authority` whose operator sends sealed frames over an attacked link.

The attacker has no key. It reads everything, keeps it, and has the announcement of an earlier
session, which it sends again each second. It replays and forges frames, and drops, delays or
duplicates the next frame of one direction. Of frames without any further effect it replays only
the last of each kind.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import lru_cache
from math import inf
from typing import Literal

import pytest
from authority_world import BEAT_S, EVENTS, KEYS, ORDERS, World, nonce
from explored import copied

from uavrt.core.errors import CommandRefused, LinkError, TunnelError
from uavrt.core.messages import MotionRequest
from uavrt.guidance.control.authority import ControlStage
from uavrt.link.tunnel import gate
from uavrt.link.tunnel.gate import ECHO_S, Gate, Sealer
from uavrt.link.tunnel.own_messages import seal
from uavrt.link.tunnel.own_messages.motion_messages import (
    MotionConfirmation,
    MotionState,
    MotionStop,
    decode_motion,
    decode_state,
    encode_confirmation,
    encode_request,
    encode_state,
    encode_stop,
    number_of,
)
from uavrt.link.tunnel.own_messages.private import MOTION_TYPE, PROVEN_STATE_TYPE, SESSION_TYPE
from uavrt.link.tunnel.own_messages.seal import (
    ALIVE_INSIDE,
    Key,
    SealKeeper,
    Session,
    read_keepalive,
    session_of,
)

KEY = Key(bytes(range(32)))
GROUND, DRONE = (254, 190), (1, 191)
YESTERDAY = 99
LINK_LOST_S = 5.0
TRIES = {"request": 2, "confirmation": 1, "stop": 4}
"""Number of times that the station sends an unanswered order, one second apart."""
Action = Literal["", "drop", "delay", "duplicate"]
ARRIVE: dict[Action, int] = {"": 1, "drop": 0, "delay": 0, "duplicate": 2}
"""Number of copies of a frame that arrive at once, by the attacker's action."""


class WorldClock:
    """Time of the world that is being changed [s]."""

    now_s = 0.0


class _Numbers:
    """Replacement of `secrets`: one nonce for each time, the same in all worlds."""

    def randbits(self, _: int) -> int:
        return round(WorldClock.now_s * 1e3) << 1


class _Quiet:
    """Replacement of the log."""

    def seldom(self, *_: object, **__: object) -> None:
        pass


@contextmanager
def in_its_time() -> Iterator[None]:
    """Use the explored world's time in seals, and begin a new exploration."""
    _checked.clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gate, "monotonic_s", lambda: WorldClock.now_s)
        patch.setattr(gate, "wall_ns", lambda: round(WorldClock.now_s * 1e9))
        patch.setattr(gate, "secrets", _Numbers())
        patch.setattr(gate, "log", _Quiet())
        patch.setattr(seal, "_mac", lru_cache(100_000)(seal._mac))
        yield


def gate_of(session: int) -> Gate:
    made = Gate()
    made._keeper = SealKeeper(KEY, session)
    return made


@dataclass(frozen=True, slots=True)
class Up:
    """A frame that the station has sealed."""

    what: str
    payload: bytes

    @property
    def counter(self) -> int:
        return int.from_bytes(self.payload[4:12], "little")

    @property
    def number(self) -> int:
        """Request id of the order in the frame."""
        return number_of(self.payload[20:])


@dataclass(slots=True)
class Pending:
    """An order that the station repeats until it is answered."""

    what: str
    number: int
    payload: bytes
    tries: int


@dataclass(slots=True)
class Link:
    """Both ends of the link, and the attacker between them."""

    station: Sealer = field(default_factory=lambda: Sealer(KEY, GROUND))
    drone: Gate = field(default_factory=lambda: gate_of(1))
    session: int = 1
    """Number of the drone's session."""
    next_frame: tuple[bool, Action] = (False, "")
    """Direction (True: to the drone) and action of the attacker's next intervention."""
    held_up: list[Up] = field(default_factory=list)
    held_down: list[tuple[int, bytes]] = field(default_factory=list)
    live: list[Up] = field(default_factory=list)
    """Recorded frames that the drone would still accept."""
    dead: dict[str, Up] = field(default_factory=dict)
    """Last recorded frame of each kind that the drone no longer accepts."""
    announced: dict[int, bytes] = field(default_factory=dict)
    """Announcement of each session."""
    echoes: dict[int, bytes] = field(default_factory=dict)
    """Announcements that return a nonce, by nonce."""
    answers: list[bytes] = field(default_factory=list)
    """Recorded answers to the pending order."""
    old_answers: dict[int, bytes] = field(default_factory=dict)
    """Last recorded answer of each kind to other orders."""
    number: int = 0
    """Request id of the last order."""
    pending: Pending | None = None
    offered: int | None = None
    """Order that the station may confirm."""
    asked: int = 0
    """Number of the last request at the drone."""
    answered: bytes = b""
    """Answer to the last request at the drone."""

    def state_key(self, now_s: float) -> object:
        """Everything that determines the further behaviour."""
        station, current, pending = self.station, Session(self.session, DRONE), self.pending
        announced = [
            (one == current, now_s - it.heard_s < ECHO_S, min(it.asked, 2))
            for one, it in station._announced.items()
        ]
        echoed = [round(now_s - s, 2) for n, s in self._fresh(now_s) if n in self.echoes]
        return (
            station._session == current,
            tuple(sorted(announced)),
            tuple(echoed),
            self.next_frame,
            tuple([self._key_up(one) for one in self.held_up]),
            tuple([self._key_down(*one) for one in self.held_down]),
            tuple([self._key_up(one) for one in self.live]),
            len(self.announced),
            tuple([one[0] & 15 for one in self.answers]),
            None if pending is None else (pending.what, pending.tries),
            self.offered,
            pending is not None and pending.number == self.asked,
            self.answered[1:2],
            round(min(now_s - self.drone._sealed_s.get(GROUND, -inf), LINK_LOST_S + 1.0), 2),
        )

    def _fresh(self, now_s: float) -> list[tuple[int, float]]:
        """Nonces that may still be returned."""
        nonces = self.station._nonces.items()
        return [(one, sent_s) for one, sent_s in nonces if now_s - sent_s <= ECHO_S]

    def _key_up(self, up: Up) -> object:
        pending = self.pending is not None and up.number == self.pending.number
        return up.what, up in self.live, pending, up.number == self.asked

    def _key_down(self, kind: int, payload: bytes) -> object:
        if kind == PROVEN_STATE_TYPE:
            return payload in self.answers, payload[0] & 15
        session, _, nonce = session_of(payload, KEY, DRONE)
        return session.number == self.session, bool(nonce), nonce in self.station._nonces

    def sent(self, payload: bytes, what: str) -> Up:
        """Record a frame of the station for the attacker."""
        if what == "alive" and any(payload[20:28]):
            what = "nonce"
        up, session = Up(what, payload), self.station._session
        current = session is not None and session.number == self.session
        if what == "nonce":  # for one of the sessions announced
            current = False
            with suppress(TunnelError):
                current = bool(SealKeeper(KEY, self.session).open(payload, GROUND, DRONE))
        if current:
            self.live.append(up)
        else:
            self.dead[what] = up
        return up

    def taken(self, *, to_drone: bool) -> Action:
        """Get the attacker's action on the present frame."""
        waits_to_drone, action = self.next_frame
        if action and waits_to_drone is to_drone:
            self.next_frame = (False, "")
            return action
        return ""

    def waits_no_more(self) -> None:
        """End the pending order: the station has its answer, or has given up."""
        self.pending = None
        for one in self.answers:
            self.old_answers[one[0] & 15] = one
        self.answers = []

    def accepted(self, payload: bytes) -> None:
        """Check a frame that the drone has accepted."""
        used = [one for one in self.live if one.payload == payload]
        assert used, "the drone accepted a frame that was forged, repeated or overtaken"
        self._bury(lambda one: one.counter <= used[0].counter)

    def restarted(self) -> None:
        """The drone's connection starts again."""
        self.session += 1
        self.drone = gate_of(self.session)
        self.asked, self.answered = 0, b""
        self._bury(lambda _: True)
        while len(self.announced) > 2:
            del self.announced[next(iter(self.announced))]

    def _bury(self, is_dead: Callable[[Up], bool]) -> None:
        for one in self.live:
            if is_dead(one):
                self.dead[one.what] = one
        self.live = [one for one in self.live if not is_dead(one)]


@dataclass(slots=True)
class AttackedWorld(World):
    """An `Authority`, its operator's station and the attacked link between them."""

    link: Link = field(default_factory=Link)

    def __post_init__(self) -> None:
        super(AttackedWorld, self).__post_init__()
        recorded = SealKeeper(KEY, YESTERDAY).announcement(DRONE)
        self.link.announced[YESTERDAY] = recorded
        for _ in range(5):
            self.beat()
        assert self.link.station.ready

    @property
    def events(self) -> tuple[str, ...]:
        """Choose the action on the next frame; it replaces an earlier choice."""
        return _WAITING if self.link.next_frame[1] else _ALL

    def after(self, event: str) -> None:
        """Let an event happen; a second passes unless it is the attacker's."""
        WorldClock.now_s = self.now_s
        if event in ATTACKS:
            ATTACKS[event](self)
        else:
            ATTACKED_EVENTS[event](self)
            self.beat()

    def beat(self) -> None:
        held = self.link.held_up, self.link.held_down
        self.link.held_up, self.link.held_down = [], []
        super(AttackedWorld, self).beat()
        WorldClock.now_s = self.now_s
        self._announce()
        for sealed in self.link.station.keepalives():
            self._send_up(sealed, "alive")
        self._try()
        for session, payload in self.link.announced.items():
            if session != self.link.session:
                self._arrive_down(SESSION_TYPE, payload)
        for up in held[0]:
            self._arrive_up(up.payload)
        for kind, payload in held[1]:
            self._arrive_down(kind, payload)

    def check(self) -> None:
        """Check as without a link; replays must not affect *Take back* or link loss."""
        link, *world = KEYS.of(self)
        if _is_new(tuple(world)):
            super(AttackedWorld, self).check()
        if not _is_new((link, self.authority.standing.value, self.linked)):
            return
        taken = copied(self)
        taken.forge()
        assert KEYS.of(taken)[0] == link, "a forgery changed something"
        taken.replay()
        taken.take_back()
        for _ in range(TRIES["stop"]):
            taken.replay()
            taken.beat()
        assert taken.authority.standing is ControlStage.OUT, "not out after take back"
        assert taken.link.pending is None, "no answer to take back"
        lost = copied(self)
        WorldClock.now_s = lost.now_s
        for _ in range(7):
            lost.replay()
            lost.now_s = WorldClock.now_s = lost.now_s + BEAT_S
            lost._announce()
        assert lost.link.drone.silent_s().get(GROUND, inf) >= LINK_LOST_S, "loss not noticed"

    # --------------------------------------------------------------- the station

    def offer(self) -> None:
        self._order("request", lambda number: encode_request(_request(number)))

    def confirm(self) -> None:
        """Confirm what the drone offered last."""
        order_id, self.link.offered = self.link.offered, None
        if order_id is not None:
            self._order(
                f"confirmation {order_id}",
                lambda number: encode_confirmation(
                    MotionConfirmation(
                        request_id=number,
                        order_id=order_id,
                        nonce=nonce(order_id),
                        sticks_unseen=True,
                    )
                ),
            )

    def guide_restarts(self) -> None:
        World.take_back(self)

    def take_back(self) -> None:
        self._order("stop", lambda number: encode_stop(MotionStop(request_id=number)))

    def _order(self, what: str, encode: Callable[[int], bytes]) -> None:
        link = self.link
        link.waits_no_more()
        link.number += 1
        link.pending = Pending(what, link.number, encode(link.number), TRIES[what.split()[0]])
        self._try()

    def _try(self) -> None:
        """Send the pending order again."""
        pending = self.link.pending
        if pending is None:
            return
        if not pending.tries:
            self.link.waits_no_more()
            return
        pending.tries -= 1
        # Without the drone's session a try is lost; the session comes within a second.
        with suppress(LinkError):
            self._send_up(self.link.station(pending.payload, MOTION_TYPE), pending.what)

    def _arrive_down(self, kind: int, payload: bytes) -> None:
        link = self.link
        try:
            if kind == SESSION_TYPE:
                link.station.accept_session(payload, DRONE)
                session = link.station._session
                used = None if session is None else session.number
                assert used != YESTERDAY, "the station uses a session of yesterday"
                return
            numbers = () if link.pending is None else (link.pending.number,)
            state = decode_state(link.station.answer(payload, numbers))
        except TunnelError:
            return
        assert payload in link.answers, "the station believed a forged answer"
        link.waits_no_more()
        if state.kind == "offer":
            link.offered = state.order_id

    # ----------------------------------------------------------------- the drone

    def _announce(self) -> None:
        link = self.link
        announcement = link.drone.announcement(DRONE)
        assert announcement is not None
        link.announced[link.session] = announcement
        self._send_down(SESSION_TYPE, announcement)

    def restart(self) -> None:
        World.restart(self)
        self.link.restarted()

    def _arrive_up(self, payload: bytes) -> None:
        link = self.link
        opened = link.drone.open(payload, GROUND, DRONE)
        if opened is None:
            return
        link.accepted(payload)
        kind, inside = opened
        if kind == ALIVE_INSIDE:
            echo = link.drone.keepalive(inside, GROUND, DRONE)
            if echo is not None:
                fresh = {one for one, _ in link._fresh(self.now_s)}
                link.echoes = {n: one for n, one in link.echoes.items() if n in fresh}
                link.echoes[read_keepalive(inside)[0]] = echo
                self._send_down(SESSION_TYPE, echo)
            return
        with link.drone.order(inside, GROUND, sealed=True) as refusal:
            self._take_order(inside, refusal)

    def _take_order(self, order: bytes, refusal: str | None) -> None:
        """Act as `MotionHandler` does, with the consent of supervisor and guide."""
        link, message = self.link, decode_motion(order, GROUND)
        number = message.request_id
        if refusal is not None:
            self._answer("refused", number)
        elif isinstance(message, MotionStop):
            self.authority.stop(self.now_s)
            self.confirmed = self.offered = None
            self._answer("state", number)
        elif isinstance(message, MotionConfirmation):
            assert message.nonce == nonce(message.order_id)
            self._confirm(message.order_id)
            taken = self.confirmed == message.order_id
            self._answer("state" if taken else "refused", number)
        elif number == link.asked:
            self._send_answer(link.answered, number)
        else:
            link.asked, before = number, self.offers
            try:
                self._offer(ORDERS[self.offers])
            except (CommandRefused, IndexError):
                link.answered = self._answer("refused", number)
            else:
                link.answered = self._answer("offer", number, ORDERS[before])

    def _answer(
        self, kind: Literal["offer", "refused", "state"], number: int, order_id: int = 0
    ) -> bytes:
        state = encode_state(
            MotionState(
                kind=kind,
                standing=self.authority.standing.value,
                text="",
                request_id=number,
                order_id=order_id,
                nonce=nonce(order_id),
            )
        )
        self._send_answer(state, number)
        return state

    def _send_answer(self, state: bytes, number: int) -> None:
        payload, kind, _ = self.link.drone.answer(state, GROUND, DRONE)
        assert kind == PROVEN_STATE_TYPE
        if self.link.pending is not None and number == self.link.pending.number:
            self.link.answers = [payload]
        self._send_down(kind, payload)

    # -------------------------------------------------------------- the attacker

    def _send_up(self, payload: bytes, what: str) -> None:
        link = self.link
        up = link.sent(payload, what)
        action = link.taken(to_drone=True)
        if action == "delay":
            link.held_up.append(up)
        for _ in range(ARRIVE[action]):
            self._arrive_up(payload)

    def _send_down(self, kind: int, payload: bytes) -> None:
        link = self.link
        action = link.taken(to_drone=False)
        if action == "delay":
            link.held_down.append((kind, payload))
        for _ in range(ARRIVE[action]):
            self._arrive_down(kind, payload)

    def replay(self) -> None:
        """Replay all frames that can have an effect, and the last of each kind that cannot."""
        link = self.link
        for up in (*link.dead.values(), *link.live):
            self._arrive_up(up.payload)
        for payload in (*link.announced.values(), *link.echoes.values()):
            self._arrive_down(SESSION_TYPE, payload)
        for payload in (*link.old_answers.values(), *link.answers):
            self._arrive_down(PROVEN_STATE_TYPE, payload)

    def forge(self) -> None:
        """Send each frame with a changed bit, and orders without a seal."""
        link = self.link
        for up in (*link.dead.values(), *link.live):
            self._arrive_up(_changed(up.payload))
        for payload in (*link.announced.values(), *link.echoes.values()):
            self._arrive_down(SESSION_TYPE, _changed(payload))
        for payload in (*link.old_answers.values(), *link.answers):
            self._arrive_down(PROVEN_STATE_TYPE, _changed(payload))
        number = 0 if link.pending is None else link.pending.number
        stop = encode_stop(MotionStop(request_id=number))
        with link.drone.order(stop, GROUND, sealed=False) as refusal:
            assert refusal is not None, "an order without a seal"
            state = MotionState(kind="refused", standing="out", text="", request_id=number)
            _, kind, _ = link.drone.answer(encode_state(state), GROUND, DRONE)
            assert kind != PROVEN_STATE_TYPE, "a proof for who did not seal"


def _act(action: Action, *, to_drone: bool) -> Callable[[AttackedWorld], None]:
    def act(world: AttackedWorld) -> None:
        world.link.next_frame = (to_drone, action)

    return act


def _changed(payload: bytes) -> bytes:
    return payload[:-1] + bytes((payload[-1] ^ 1,))


def _request(number: int) -> MotionRequest:
    return MotionRequest(request_id=number, requester=GROUND, action="hold")


_checked: set[int] = set()
"""Keys of states of the authority alone, and of the link with its standing."""


def _is_new(key: object) -> bool:
    known = hash(key) in _checked
    _checked.add(hash(key))
    return not known


ATTACKS: dict[str, Callable[[AttackedWorld], None]] = {
    "replay": AttackedWorld.replay,
    **{
        f"{action} to the {'drone' if to_drone else 'station'}": _act(action, to_drone=to_drone)
        for action in ("drop", "delay", "duplicate")
        for to_drone in (True, False)
    },
}
ATTACKED_EVENTS: dict[str, Callable[[AttackedWorld], None]] = {
    **{
        name: event
        for name, event in EVENTS.items()
        if name not in ("offer repeated", "late confirmation")
    },
    "offer": AttackedWorld.offer,
    "confirmation": AttackedWorld.confirm,
    "take back": AttackedWorld.take_back,
    "guide restarted": AttackedWorld.guide_restarts,
    "connection restarted": AttackedWorld.restart,
    **ATTACKS,
}
_ALL = tuple(ATTACKED_EVENTS)
_WAITING = tuple(name for name in _ALL if name not in ATTACKS or " " not in name)
