"""Who is on the link: the autopilot and the ground stations. Pure."""

from dataclasses import dataclass, field

from uavrt.mavlink.dialect import Heartbeat, MavComponent, MavType
from uavrt.units import ns_from_s

AUTOPILOT_SILENCE_NS = ns_from_s(5.0)
"""Five missed heartbeats: the autopilot is lost, and another system id may take its place."""
STATION_SILENCE_NS = ns_from_s(10.0)
"""Ten missed heartbeats: at 40 % loss that happens by chance once in 10 000."""
MAX_STATIONS = 16


@dataclass(frozen=True, slots=True)
class Peer:
    """A component of a system."""

    system_id: int
    component_id: int
    link: int = field(default=0, compare=False)
    """By which of our links it was heard; the same peer may be on several."""

    def __str__(self) -> str:
        return f"{self.system_id}/{self.component_id}"


EVERYONE = Peer(0, 0)
"""Target of a message to every system and component."""


class Discovery:
    """Keeps the autopilot (first heartbeat of component 1) and every ground station.

    A ground station is whoever says so by its heartbeat's type, whatever its numbers:
    QGroundControl is 255/190, MAVSDK 245/190, MAVProxy 255/230 (reference/control.md §9).
    """

    def __init__(self) -> None:
        self.autopilot: Peer | None = None
        self.autopilot_kind = 0
        """MAV_AUTOPILOT of its heartbeat."""
        self._autopilot_heard_ns = 0
        self._stations: dict[Peer, int] = {}

    def heartbeat(self, peer: Peer, heartbeat: Heartbeat, now_ns: int) -> bool:
        """Take a heartbeat; True when it shows an autopilot that is new or was lost."""
        if heartbeat.type == MavType.GCS:
            self._add_station(peer, now_ns)
            return False
        if peer.component_id != MavComponent.COMP_ID_AUTOPILOT1:
            return False
        lost = not self.autopilot_present(now_ns)
        if self.autopilot != peer and not lost:
            return False  # another vehicle, heard through a shared radio
        self.autopilot = peer
        self.autopilot_kind = heartbeat.autopilot
        self._autopilot_heard_ns = now_ns
        return lost

    def autopilot_present(self, now_ns: int) -> bool:
        """True while the autopilot's heartbeats come."""
        if self.autopilot is None:
            return False
        return now_ns - self._autopilot_heard_ns < AUTOPILOT_SILENCE_NS

    def stations(self, now_ns: int) -> tuple[Peer, ...]:
        """Ground stations that are present; if none is, the last one heard, if any.

        Heartbeats are lost more easily than a ground station; sending costs nothing.
        """
        present = [
            peer
            for peer, heard_ns in self._stations.items()
            if now_ns - heard_ns < STATION_SILENCE_NS
        ]
        if not present and self._stations:
            present = [max(self._stations, key=self._stations.__getitem__)]
        return tuple(sorted(present, key=lambda peer: (peer.system_id, peer.component_id)))

    @property
    def known(self) -> bool:
        """True once any ground station was heard."""
        return bool(self._stations)

    def station_present(self, now_ns: int) -> bool:
        """True while any ground station's heartbeats come."""
        return any(now_ns - heard < STATION_SILENCE_NS for heard in self._stations.values())

    def target(self, now_ns: int) -> Peer | None:
        """Address for what all ground stations should get: the only one, or everyone."""
        stations = self.stations(now_ns)
        if not stations:
            return None
        return stations[0] if len(stations) == 1 else EVERYONE

    def _add_station(self, peer: Peer, now_ns: int) -> None:
        self._stations[peer] = now_ns
        if len(self._stations) > MAX_STATIONS:
            del self._stations[min(self._stations, key=self._stations.__getitem__)]
