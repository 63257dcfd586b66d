"""Who is on the link: the autopilot and the ground stations. Pure."""

from dataclasses import dataclass, field

from uavrt.mavlink.dialect import (
    Heartbeat,
    MavAutopilot,
    MavComponent,
    MavModeFlag,
    MavState,
    MavType,
)
from uavrt.units import ns_from_s

AUTOPILOT_SILENCE_NS = ns_from_s(5.0)
"""Five missed heartbeats: the autopilot is lost, and another system id may take its place."""
STATION_SILENCE_NS = ns_from_s(10.0)
"""Ten missed heartbeats: at 40 % loss that happens by chance once in 10 000."""
MAX_STATIONS = 16
STATION_SYSTEM_ID = 254
"""Ours on the ground. Not 255: ArduPilot counts every heartbeat of that number (MAV_GCS_SYSID)
as the operator's ground station, PX4 every one of type GCS. The failsafe for a lost ground
station would not notice that the operator's own is gone while ours lives."""
GCS_SYSTEM_ID = 255
_STATION_MARK = 0x75767274
"""``uvrt`` in the mode of a heartbeat of no particular type: one of our ground stations."""


@dataclass(frozen=True, slots=True)
class Peer:
    """A component of a system."""

    system_id: int
    component_id: int
    link: int = field(default=0, compare=False)
    """By which of our links it was heard; the same peer may be on several."""

    @property
    def place(self) -> tuple[int, int]:
        """System and component id."""
        return self.system_id, self.component_id

    def __str__(self) -> str:
        return f"{self.system_id}/{self.component_id}"


EVERYONE = Peer(0, 0)
"""Target of a message to every system and component."""


def station_heartbeat(*, as_gcs: bool = False) -> Heartbeat:
    """Make the heartbeat of a ground station of ours.

    `as_gcs`: of type GCS, as the original's drone side insists on.
    """
    if as_gcs:
        return own_heartbeat(MavType.GCS)
    return own_heartbeat(MavType.GENERIC, custom_mode=_STATION_MARK)


def own_heartbeat(kind: int, *, custom_mode: int = 0) -> Heartbeat:
    """Make the heartbeat of a component that is no autopilot."""
    return Heartbeat(
        type=kind,
        autopilot=MavAutopilot.INVALID,
        custom_mode=custom_mode,
        system_status=MavState.ACTIVE,
        mavlink_version=3,
    )


def is_station(heartbeat: Heartbeat) -> bool:
    """Whether a ground station sent a heartbeat: anybody's by its type, ours by its mark."""
    marked = heartbeat.type == MavType.GENERIC and heartbeat.custom_mode == _STATION_MARK
    return heartbeat.type == MavType.GCS or marked


class Discovery:
    """Keeps the autopilot (first heartbeat of component 1) and every ground station.

    A ground station is whoever says so by its heartbeat, whatever its numbers: QGroundControl
    is 255/190, MAVSDK 245/190, MAVProxy 255/230, ours 254/190.
    """

    def __init__(self) -> None:
        self.autopilot: Peer | None = None
        self.autopilot_kind = 0
        """MAV_AUTOPILOT of its heartbeat."""
        self.autopilot_armed = False
        """Whether its motors may turn, by its last heartbeat."""
        self.autopilot_landed: bool | None = None
        """Whether it stands on the ground; None while it does not say."""
        self._autopilot_heard_ns = 0
        self._stations: dict[Peer, int] = {}
        self._others: set[Peer] = set()
        self._kept: Peer | None = None

    def heartbeat(self, peer: Peer, heartbeat: Heartbeat, now_ns: int) -> bool:
        """Handle a heartbeat; True when it shows an autopilot that is new or was lost."""
        if is_station(heartbeat):
            self._add_station(peer, now_ns)
            if heartbeat.type == MavType.GCS:
                self._others.add(peer)
            else:
                self._others.discard(peer)
            return False
        if peer.component_id != MavComponent.COMP_ID_AUTOPILOT1:
            return False
        lost = not self.autopilot_present(now_ns)
        if self.autopilot != peer and not lost:
            return False  # another vehicle, heard through a shared radio
        self.autopilot = peer
        self.autopilot_kind = heartbeat.autopilot
        self.autopilot_armed = bool(heartbeat.base_mode & MavModeFlag.SAFETY_ARMED)
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
        return tuple(sorted(present, key=lambda peer: peer.place))

    def keep(self, peer: Peer) -> None:
        """Never forget a station for others, were it a flood of them: it commands."""
        self._kept = peer

    def silent_ns(self, now_ns: int) -> dict[Peer, int]:
        """Get for how long each station that is known was not heard."""
        return {peer: now_ns - heard_ns for peer, heard_ns in self._stations.items()}

    @property
    def known(self) -> bool:
        """True once any ground station was heard."""
        return bool(self._stations)

    def station_present(self, now_ns: int) -> bool:
        """True while any ground station's heartbeats come."""
        return any(now_ns - heard < STATION_SILENCE_NS for heard in self._stations.values())

    def other_station_present(self, now_ns: int) -> bool:
        """True while a ground station is there that is not ours, such as QGroundControl."""
        return any(now_ns - self._stations[peer] < STATION_SILENCE_NS for peer in self._others)

    def target(self, now_ns: int) -> Peer | None:
        """Address for what all ground stations should get: the only one, or everyone."""
        stations = self.stations(now_ns)
        if not stations:
            return None
        return stations[0] if len(stations) == 1 else EVERYONE

    def _add_station(self, peer_now: Peer, now_ns: int) -> None:
        self._stations[peer_now] = now_ns
        if len(self._stations) > MAX_STATIONS:
            others = [peer for peer in self._stations if peer not in (peer_now, self._kept)]
            forgotten = min(others, key=self._stations.__getitem__)
            del self._stations[forgotten]
            self._others.discard(forgotten)
