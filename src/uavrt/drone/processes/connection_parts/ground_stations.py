"""Ground stations of a drone: which one is in command, and which link reaches each.

The station in command has its own rate limit; its answers are sent before pulses.
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
    """Applies rate limits to ground stations' messages, and sends answers to them."""

    def __init__(self, link: Connection, gate: Gate, now_ns: Callable[[], int]) -> None:
        self._link, self.gate, self._now_ns = link, gate, now_ns
        self._limits = StationLimits()
        self._asked_on: dict[Place, int] = {}
        self._next_session_ns = 0

    def asked(self, peer: Peer) -> None:
        """Remember the link on which a station's message arrived; the answer uses this link."""
        self._asked_on[peer.place] = peer.link

    def commander(self, source: str | None) -> None:
        """Set the station in command from a command's source, ``mavlink SYSTEM/COMPONENT``.

        Other sources are ignored.
        """
        if source is None or not source.startswith(MAVLINK_SOURCE):
            return
        system_id, _, component_id = source.removeprefix(MAVLINK_SOURCE).partition("/")
        place = (int(system_id), int(component_id))
        self._link.component.discovery.keep(Peer(*place))
        self._limits.commander(place)

    def accepted(self, requester: Place) -> None:
        """Treat a station as in command until the supervisor decides, if no other one is."""
        if not self._limits.has_commander:
            self._limits.commander(requester)

    @property
    def dropped(self) -> int:
        """Number of ground stations' messages dropped by rate limits."""
        return self._limits.dropped

    def admits(self, peer: Peer, answers: int = 0) -> bool:
        """True if the rate limits allow an unauthenticated message.

        `answers` is the number of replies that it causes. If the drone has a key, all senders
        share one limit.
        """
        place = (0, 0) if self.gate.locked else peer.place
        return self._limits.admits(place, self._now_ns(), answers=answers)

    def admits_file_request(self, peer: Peer, *, detecting: bool) -> bool:
        """True if the rate limits allow a file request.

        If the drone has a key, unauthenticated stations have a lower limit while `detecting`.
        """
        proof = not (self.gate.locked and detecting) or self.gate.asks_for_files(peer.place)
        return self._limits.admits_file_request(peer.place, self._now_ns(), proof=proof)

    def file_received(self, peer: Peer, trip_s: float) -> None:
        """Adapt a link's send rate to the round-trip time of a file transfer [s].

        Transfers to stations not in command do not change the link that carries pulses.
        """
        others = self._limits.has_commander and not self._limits.commands(peer.place)
        if not (others and peer.link == self._link.tunnel.link):
            self._link.tunnel.rate_of(peer.link).acknowledged(trip_s, self._now_ns())

    def silent_s(self) -> dict[Place, float]:
        """Time since each station's last message [s].

        For a station that sends sealed (authenticated) messages, only these count.
        """
        return self._link.stations_silent_s() | self.gate.silent_s()

    def answer(self, answer: Answer | None, *, urgent: bool = True) -> None:
        """Send an answer to a station: before pulses if it is in command, else after them."""
        if answer is not None:
            first = urgent and self._limits.commands(answer.requester)
            priority = Priority.ACK if first else Priority.OTHER
            self._link.tunnel.send_tunnel(
                answer.payload, priority, self._peer(answer.requester)
            )

    def answer_motion(self, payload: bytes, requester: Place | None) -> None:
        """Report a motion order's progress to `requester`, or to all stations if None."""
        if requester is None:
            self._link.tunnel.send_tunnel(payload, Priority.STATUS, None, MOTION_STATE_TYPE)
            return
        payload, kind, first = self.gate.answer(payload, requester, self._link.place)
        priority = Priority.ACK if first else Priority.OTHER
        self._link.tunnel.send_tunnel(payload, priority, self._peer(requester), kind)

    def answer_parameter(self, value: ParamValue, requester: Peer | None) -> None:
        """Report a parameter's value to all stations, or only on the link of `requester`.

        Only that link is used, at low priority, if the station is not in command or if the
        drone has a key.
        """
        tunnel = self._link.tunnel
        if requester is None or (
            self._limits.commands(requester.place) and not self.gate.locked
        ):
            tunnel.send_message(value)
        else:
            tunnel.send_message(value, Priority.OTHER, requester.link)

    def answer_keepalive(self, payload: bytes, peer: Peer) -> None:
        """Return a keepalive's nonce to its station, with the session for sealed commands."""
        self.asked(peer)
        session = self.gate.keepalive(payload, peer.place, self._link.place)
        if session is not None:
            self._link.tunnel.send_tunnel(session, Priority.ACK, peer, SESSION_TYPE)

    def announce_session(self, now_ns: int) -> None:
        """Send, once a second, the session in which sealed (authenticated) commands are valid.

        The announcement is valid only for the drone's present system id, so this must be known.
        A ground station must have been received too, because messages wait in a queue until
        then.
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
