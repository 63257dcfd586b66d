"""Ground stations of a drone: which one commands, and on which link each is answered.

The station in command has its own share of the link; its answers are sent before pulses.
"""

from collections.abc import Callable

from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.drone.processes.connection_parts.station_limits import Place, StationLimits
from uavrt.link.mavlink.dialect import ParamValue
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.mavlink_connection import Connection
from uavrt.link.mavlink.sending.pacing import Priority
from uavrt.link.tunnel.drone_exchange import Answer
from uavrt.link.tunnel.gate import Gate
from uavrt.link.tunnel.own_messages.private import MOTION_STATE_TYPE, SESSION_TYPE

SESSION_NS = NANOSECONDS_PER_SECOND
MAVLINK_SOURCE = "mavlink "


class GroundStations:
    """Accepts or drops messages of ground stations, and sends the answers."""

    def __init__(self, link: Connection, gate: Gate, now_ns: Callable[[], int]) -> None:
        self._link, self.gate, self._now_ns = link, gate, now_ns
        self._limits = StationLimits()
        self._asked_on: dict[Place, int] = {}
        self._next_session_ns = 0

    def asked(self, peer: Peer) -> None:
        """Store the link on which a station's message arrived, for the answer."""
        self._asked_on[peer.place] = peer.link

    def commander(self, source: str | None) -> None:
        """Set the station in command, from the source name of its commands."""
        if source is None or not source.startswith(MAVLINK_SOURCE):
            return
        system_id, _, component_id = source.removeprefix(MAVLINK_SOURCE).partition("/")
        place = (int(system_id), int(component_id))
        self._link.component.discovery.keep(Peer(*place))
        self._limits.commander(place)

    def accepted(self, requester: Place) -> None:
        """If no station is in command, assume this one is, until the supervisor decides."""
        if not self._limits.has_commander:
            self._limits.commander(requester)

    @property
    def dropped(self) -> int:
        """Number of messages dropped because an allowance was used up."""
        return self._limits.dropped

    def admits(self, peer: Peer, answers: int = 0) -> bool:
        """True if an unauthenticated message may be handled; `answers`: number of replies.

        All senders share one limit if the drone has a key.
        """
        place = (0, 0) if self.gate.locked else peer.place
        return self._limits.admits(place, self._now_ns(), answers=answers)

    def admits_file_request(self, peer: Peer, *, detecting: bool) -> bool:
        """True if the rate limits allow a file request.

        With a key, stations without proof of it have a lower limit while `detecting`.
        """
        proof = not (self.gate.locked and detecting) or self.gate.asks_for_files(peer.place)
        return self._limits.admits_file_request(peer.place, self._now_ns(), proof=proof)

    def file_received(self, peer: Peer, trip_s: float) -> None:
        """Adapt a link's rate to a file transfer's round trip [s], if it carries no pulses."""
        others = self._limits.has_commander and not self._limits.commands(peer.place)
        if not (others and peer.link == self._link.tunnel.link):
            self._link.tunnel.rate_of(peer.link).acknowledged(trip_s, self._now_ns())

    def silent_s(self) -> dict[Place, float]:
        """Silence of each station [s]; if it has sent sealed messages, only these count."""
        return self._link.stations_silent_s() | self.gate.silent_s()

    def answer(self, answer: Answer | None, *, urgent: bool = True) -> None:
        """Send an answer: before pulses to the station in command, after pulses to others."""
        if answer is not None:
            first = urgent and self._limits.commands(answer.requester)
            priority = Priority.ACK if first else Priority.OTHER
            self._link.tunnel.send_tunnel(
                answer.payload, priority, self._peer(answer.requester)
            )

    def answer_motion(self, payload: bytes, requester: Place | None) -> None:
        """Report the progress of a motion order to the given station, or to all if None."""
        if requester is None:
            self._link.tunnel.send_tunnel(payload, Priority.STATUS, None, MOTION_STATE_TYPE)
            return
        payload, kind, first = self.gate.answer(payload, requester, self._link.place)
        priority = Priority.ACK if first else Priority.OTHER
        self._link.tunnel.send_tunnel(payload, priority, self._peer(requester), kind)

    def answer_parameter(self, value: ParamValue, requester: Peer | None) -> None:
        """Report a parameter's value to all stations or, with low priority, to `requester`."""
        tunnel = self._link.tunnel
        if requester is None or (
            self._limits.commands(requester.place) and not self.gate.locked
        ):
            tunnel.send_message(value)
        else:
            tunnel.send_message(value, Priority.OTHER, requester.link)

    def answer_keepalive(self, payload: bytes, peer: Peer) -> None:
        """Answer a station's keepalive with its nonce, and the session for sealed commands."""
        self.asked(peer)
        session = self.gate.keepalive(payload, peer.place, self._link.place)
        if session is not None:
            self._link.tunnel.send_tunnel(session, Priority.ACK, peer, SESSION_TYPE)

    def announce_session(self, now_ns: int) -> None:
        """Announce, once a second, the session in which sealed commands are valid.

        An announcement is valid only for the drone's present number, so that number must be
        known. A ground station must have been received, too: before that, messages wait in a
        queue.
        """
        component = self._link.component
        ready = component.discovery.known and component.has_number(now_ns)
        if not ready or now_ns < self._next_session_ns:
            return
        self._next_session_ns = now_ns + SESSION_NS
        session = self.gate.announcement(self._link.place)
        if session is not None:
            self._link.tunnel.send_tunnel(session, Priority.STATUS, payload_type=SESSION_TYPE)

    def _peer(self, requester: Place) -> Peer:
        return Peer(*requester, self._asked_on.get(requester, 0))
