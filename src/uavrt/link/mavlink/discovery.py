"""Find the autopilot and the ground stations on a link; no I/O."""

from dataclasses import dataclass, field

from uavrt.core.units import ns_from_s
from uavrt.link.mavlink.dialect import (
    CommandLong,
    Heartbeat,
    MavAutopilot,
    MavCmd,
    MavComponent,
    MavModeFlag,
    MavState,
    MavType,
)

AUTOPILOT_SILENCE_NS = ns_from_s(5.0)
"""Time without heartbeats after which the autopilot counts as lost and another one may replace
it [ns]; 5 heartbeats."""
STATION_SILENCE_NS = ns_from_s(10.0)
"""Time without heartbeats after which a ground station counts as lost [ns]; at 40 % loss, a
present station counts as lost with p = 1e-4."""
MAX_STATIONS = 16
STATION_SYSTEM_ID = 254
"""MAVLink system id of uavrt's ground stations. It is not 255, because ArduPilot takes 255
(MAV_GCS_SYSID) for the operator's station. Its failsafe for a lost operator's station would
then not act while uavrt's station is present. PX4 treats every heartbeat of type GCS this way.
"""
GCS_SYSTEM_ID = 255
_STATION_MARK = 0x75767274
"""Custom mode ``uvrt``, which marks the heartbeats of uavrt ground stations."""


@dataclass(frozen=True, slots=True)
class Peer:
    """A MAVLink component from which frames have arrived, with its system and component id."""

    system_id: int
    component_id: int
    link: int = field(default=0, compare=False)
    """Number of the link on which the peer's frame arrived; a peer may use several links."""

    @property
    def place(self) -> tuple[int, int]:
        """System and component id of the peer."""
        return self.system_id, self.component_id

    @property
    def address(self) -> dict[str, int]:
        """Target fields of a message that is sent to the peer."""
        return {"target_system": self.system_id, "target_component": self.component_id}

    def __str__(self) -> str:
        return f"{self.system_id}/{self.component_id}"


EVERYONE = Peer(0, 0)
"""Target of a message to every system and component."""


def station_heartbeat(*, as_gcs: bool = False) -> Heartbeat:
    """Make the heartbeat of a uavrt ground station, of type GCS if requested."""
    if as_gcs:
        return own_heartbeat(MavType.GCS)
    return own_heartbeat(MavType.GENERIC, custom_mode=_STATION_MARK)


def own_heartbeat(kind: int, *, custom_mode: int = 0) -> Heartbeat:
    """Make the heartbeat of a component other than an autopilot."""
    return Heartbeat(
        type=kind,
        autopilot=MavAutopilot.INVALID,
        custom_mode=custom_mode,
        system_status=MavState.ACTIVE,
        mavlink_version=3,
    )


def request_message(peer: Peer, message_id: int) -> CommandLong:
    """Make a request for a single message."""
    return CommandLong(**peer.address, command=MavCmd.REQUEST_MESSAGE, param1=float(message_id))


def is_station(heartbeat: Heartbeat) -> bool:
    """True if a heartbeat is from a ground station, by its type or by the mark of uavrt
    stations.
    """
    marked = heartbeat.type == MavType.GENERIC and heartbeat.custom_mode == _STATION_MARK
    return heartbeat.type == MavType.GCS or marked


class Discovery:
    """Keeps track of the autopilot (first heartbeat of component 1) and of every ground
    station.

    Ground stations are recognised by their heartbeat, not by their numbers: QGroundControl uses
    255/190, MAVSDK 245/190, MAVProxy 255/230 and uavrt 254/190.
    """

    def __init__(self) -> None:
        self.autopilot: Peer | None = None
        self.autopilot_kind = 0
        """MAV_AUTOPILOT number in the autopilot's heartbeat."""
        self.autopilot_armed = False
        """True if the motors may turn, by the autopilot's last heartbeat."""
        self.autopilot_landed: bool | None = None
        """True if the vehicle is on the ground; None if not reported."""
        self._autopilot_heard_ns = 0
        self._stations: dict[Peer, int] = {}
        self._others: set[Peer] = set()
        self._kept: Peer | None = None

    def heartbeat(self, peer: Peer, heartbeat: Heartbeat, now_ns: int) -> bool:
        """Record a heartbeat; True if the autopilot is new or has returned after being lost."""
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
        """True while the autopilot's heartbeats arrive."""
        if self.autopilot is None:
            return False
        return now_ns - self._autopilot_heard_ns < AUTOPILOT_SILENCE_NS

    def stations(self, now_ns: int) -> tuple[Peer, ...]:
        """Return the ground stations whose heartbeats arrive, or else the last one received.

        A station without heartbeats is often still present, and sending to it costs nothing.
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
        """Keep the commanding station's entry even when the table is full."""
        self._kept = peer

    def silent_ns(self, now_ns: int) -> dict[Peer, int]:
        """Time since the last heartbeat of each known ground station [ns]."""
        return {peer: now_ns - heard_ns for peer, heard_ns in self._stations.items()}

    @property
    def known(self) -> bool:
        """True once a heartbeat of any ground station has arrived."""
        return bool(self._stations)

    def station_present(self, now_ns: int) -> bool:
        """True while any ground station's heartbeats arrive."""
        return any(now_ns - heard < STATION_SILENCE_NS for heard in self._stations.values())

    def other_station_present(self, now_ns: int) -> bool:
        """True if a ground station other than uavrt's is present, such as QGroundControl."""
        return any(now_ns - self._stations[peer] < STATION_SILENCE_NS for peer in self._others)

    def target(self, now_ns: int) -> Peer | None:
        """Address of messages for all ground stations: that of the only station, or broadcast
        if there are several.
        """
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
