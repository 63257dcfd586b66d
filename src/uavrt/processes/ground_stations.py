"""Ground stations of a drone: who may command, and by which link each is answered.

The station that commands has a share of the link of its own, and is answered before pulses.
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
        """Answer this station by the link of its last message."""
        self._asked_on[peer.place] = peer.link

    def commander(self, source: str | None) -> None:
        """Note the station that commands, by the source of its commands."""
        if source is None or not source.startswith(MAVLINK_SOURCE):
            return
        system_id, _, component_id = source.removeprefix(MAVLINK_SOURCE).partition("/")
        place = (int(system_id), int(component_id))
        self._link.keep_station(place)
        self._crowd.commander(place)

    def accepted(self, asker: Place) -> None:
        """Take a station for the one that commands, until the supervisor reports that."""
        if not self._crowd.has_commander:
            self._crowd.commander(asker)

    @property
    def passed_over(self) -> int:
        """Messages that were too many."""
        return self._crowd.passed_over

    def admits(self, peer: Peer, answers: int = 0) -> bool:
        """Whether to handle a message without a seal; who needs one has no share of its own."""
        place = (0, 0) if self.gate.locked else peer.place
        return self._crowd.admits(place, self._now_ns(), answers=answers)

    def admits_file_request(self, peer: Peer, *, detecting: bool) -> bool:
        """Whether to handle a request for a file."""
        proof = not (self.gate.locked and detecting) or self.gate.asks_for_files(peer.place)
        return self._crowd.admits_file_request(peer.place, self._now_ns(), proof=proof)

    def file_received(self, peer: Peer, trip_s: float) -> None:
        """Pace a link by a file's round trip; of others not where the commander's pulses go."""
        others = self._crowd.has_commander and not self._crowd.commands(peer.place)
        if not (others and peer.link == self._link.tunnel.link):
            self._link.tunnel.rate_of(peer.link).acknowledged(trip_s, self._now_ns())

    def silent_s(self) -> dict[Place, float]:
        """How long each ground station was silent; one that has sealed counts only by seals."""
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
        """Report a value: to all, or after the pulses to one who asks without a proof."""
        tunnel = self._link.tunnel
        if asker is None or (self._crowd.commands(asker.place) and not self.gate.locked):
            tunnel.send_message(value)
        else:
            tunnel.send_message(value, Priority.OTHER, asker.link)

    def answer_sign_of_life(self, payload: bytes, peer: Peer) -> None:
        """Note a station that knows proofs, and return its nonce."""
        self.asked(peer)
        session = self.gate.sign_of_life(payload, peer.place, self._link.place)
        if session is not None:
            self._link.tunnel.send_tunnel(session, Priority.ACK, peer, SESSION_TYPE)

    def announce_session(self, now_ns: int) -> None:
        """Report once a second what commands must be sealed for."""
        if now_ns < self._next_session_ns:
            return
        self._next_session_ns = now_ns + SESSION_NS
        session = self.gate.announcement(self._link.place)
        if session is not None:
            self._link.tunnel.send_tunnel(session, Priority.STATUS, payload_type=SESSION_TYPE)

    def _peer(self, asker: Place) -> Peer:
        """Who asked, and by which link."""
        return Peer(*asker, self._asked_on.get(asker, 0))
