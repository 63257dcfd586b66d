"""Ground stations of a drone: which one may command, and the link for each answer.

The commanding station has its own share of the link, and is answered before pulses.
"""

from collections.abc import Callable

from uavrt.mavlink.connection import Connection
from uavrt.mavlink.dialect import ParamValue
from uavrt.mavlink.discovery import Peer
from uavrt.mavlink.pacing import Priority
from uavrt.processes.crowd import Crowd, Place
from uavrt.tunnel.exchange import Answer
from uavrt.tunnel.gate import Gate
from uavrt.tunnel.private import MOTION_STATE_TYPE, SESSION_TYPE
from uavrt.units import NANOSECONDS_PER_SECOND

SESSION_NS = NANOSECONDS_PER_SECOND
MAVLINK_SOURCE = "mavlink "


class GroundStations:
    """Admits messages of ground stations over a link, and answers them."""

    def __init__(self, link: Connection, gate: Gate, now_ns: Callable[[], int]) -> None:
        self._link, self.gate, self._now_ns = link, gate, now_ns
        self._crowd = Crowd()
        self._asked_on: dict[Place, int] = {}
        self._next_session_ns = 0

    def asked(self, peer: Peer) -> None:
        """Set the link of a station's last message as the link for its answers."""
        self._asked_on[peer.place] = peer.link

    def commander(self, source: str | None) -> None:
        """Set the commanding station, by the source of its commands."""
        if source is None or not source.startswith(MAVLINK_SOURCE):
            return
        system_id, _, component_id = source.removeprefix(MAVLINK_SOURCE).partition("/")
        place = (int(system_id), int(component_id))
        self._link.keep_station(place)
        self._crowd.commander(place)

    def accepted(self, asker: Place) -> None:
        """Treat a station as the commanding one, until the supervisor reports it."""
        if not self._crowd.has_commander:
            self._crowd.commander(asker)

    @property
    def passed_over(self) -> int:
        """Messages dropped as too many."""
        return self._crowd.passed_over

    def admits(self, peer: Peer, answers: int = 0) -> bool:
        """Whether to handle an unsealed message; on a locked link these share one allowance."""
        place = (0, 0) if self.gate.locked else peer.place
        return self._crowd.admits(place, self._now_ns(), answers=answers)

    def admits_file_request(self, peer: Peer, *, detecting: bool) -> bool:
        """Whether to handle a request for a file."""
        proof = not (self.gate.locked and detecting) or self.gate.asks_for_files(peer.place)
        return self._crowd.admits_file_request(peer.place, self._now_ns(), proof=proof)

    def file_received(self, peer: Peer, trip_s: float) -> None:
        """Adapt a link's rate to a file's round trip; not where the commander's pulses go."""
        others = self._crowd.has_commander and not self._crowd.commands(peer.place)
        if not (others and peer.link == self._link.tunnel.link):
            self._link.tunnel.rate_of(peer.link).acknowledged(trip_s, self._now_ns())

    def silent_s(self) -> dict[Place, float]:
        """Silence of each ground station; after a first seal, only seals count."""
        return self._link.stations_silent_s() | self.gate.silent_s()

    def answer(self, answer: Answer | None, *, urgent: bool = True) -> None:
        """Send an answer: before pulses to the station that commands, after them to others."""
        if answer is not None:
            first = urgent and self._crowd.commands(answer.asker)
            priority = Priority.ACK if first else Priority.OTHER
            self._link.tunnel.send_tunnel(answer.payload, priority, self._peer(answer.asker))

    def answer_motion(self, payload: bytes, asker: Place | None) -> None:
        """Report the progress of an order: to its station, or to all."""
        if asker is None:
            self._link.tunnel.send_tunnel(payload, Priority.STATUS, None, MOTION_STATE_TYPE)
            return
        payload, kind, first = self.gate.answer(payload, asker, self._link.place)
        priority = Priority.ACK if first else Priority.OTHER
        self._link.tunnel.send_tunnel(payload, priority, self._peer(asker), kind)

    def answer_parameter(self, value: ParamValue, asker: Peer | None) -> None:
        """Report a value: to all, or after the pulses to one station without a proof."""
        tunnel = self._link.tunnel
        if asker is None or (self._crowd.commands(asker.place) and not self.gate.locked):
            tunnel.send_message(value)
        else:
            tunnel.send_message(value, Priority.OTHER, asker.link)

    def answer_keepalive(self, payload: bytes, peer: Peer) -> None:
        """Record a station that checks proofs, and return its nonce."""
        self.asked(peer)
        session = self.gate.keepalive(payload, peer.place, self._link.place)
        if session is not None:
            self._link.tunnel.send_tunnel(session, Priority.ACK, peer, SESSION_TYPE)

    def announce_session(self, now_ns: int) -> None:
        """Announce once a second the session that commands must be sealed for."""
        if now_ns < self._next_session_ns:
            return
        self._next_session_ns = now_ns + SESSION_NS
        session = self.gate.announcement(self._link.place)
        if session is not None:
            self._link.tunnel.send_tunnel(session, Priority.STATUS, payload_type=SESSION_TYPE)

    def _peer(self, asker: Place) -> Peer:
        """The station and the link of its last message."""
        return Peer(*asker, self._asked_on.get(asker, 0))
