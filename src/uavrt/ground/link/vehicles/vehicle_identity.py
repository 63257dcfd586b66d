"""Select the vehicle that a ground station serves. No I/O.

The first one with uavrt's drone side is selected, by system id and its autopilot's number,
through any silence until the operator selects another; otherwise the station could command the
wrong vehicle.
"""

from uavrt.core.earth.geodesy import distance_m
from uavrt.core.units import ns_from_s
from uavrt.link.mavlink import dialect

DRONE_COMPONENT = 191
"""MAVLink component id of uavrt's drone side."""
FOREIGN_NS = ns_from_s(60.0)
"""Time to remember another autopilot's number [ns]; it is queried three times within it."""
MAX_OTHERS = 16
JUMP_M, RETURN_M, JUMPS = 40.0, 15.0, 4
"""Two stations share one number if the position jumps by `JUMP_M` [m] and returns within
`RETURN_M` [m], `JUMPS` times in a row."""


class VehicleIdentity:
    """Identifies the served vehicle by number or autopilot, and lists others on the link."""

    def __init__(self, system_id: int | None = None, uid: str | None = None) -> None:
        self.system_id = system_id
        self.uid = uid
        self.others: dict[int, int] = {}
        """Other systems received, by system id, with the time of their last heartbeat [ns]."""
        self.excluded: set[int] = set()
        """System ids of vehicles that other sessions serve; they are never selected here."""
        self._foreign_ns: int | None = None
        self._places = _Places()

    def choose(self, system_id: int) -> None:
        """Serve the vehicle with this system id from now on, whatever its autopilot."""
        self.system_id, self.uid, self._foreign_ns = system_id, None, None
        self.others.pop(system_id, None)
        self._places = _Places()

    def heard(self, system_id: int, now_ns: int) -> bool:
        """Handle a heartbeat; True if it is from the served vehicle, by default the first
        found.
        """
        if self.system_id is None and system_id not in self.excluded:
            self.system_id = system_id
        if system_id == self.system_id:
            return True
        if system_id in self.others or len(self.others) < MAX_OTHERS:
            self.others[system_id] = now_ns
        return False

    def receive_version(self, message: dialect.AutopilotVersion, now_ns: int) -> None:
        """Store the unique number of the served vehicle's autopilot."""
        uid = unique_number(message)
        if uid is None:
            return
        if self.uid is None:
            self.uid = uid
        if uid != self.uid:
            self._foreign_ns = now_ns

    def receive_position(self, place: tuple[float, float], now_ns: int) -> None:
        """Add a position of a station without an autopilot, to detect two stations with one
        number.
        """
        if self._places.add(place):
            self._foreign_ns = now_ns

    def foreign(self, now_ns: int) -> bool:
        """True while another autopilot or station uses the served vehicle's number."""
        return self._foreign_ns is not None and now_ns - self._foreign_ns < FOREIGN_NS


class _Places:
    """Distinguishes one moving station from two fixed stations, whose positions alternate."""

    def __init__(self) -> None:
        self._last: tuple[float, float] | None = None
        self._before: tuple[float, float] | None = None
        """The vehicle's position before its last impossibly fast move; None without one."""
        self._back = 0

    def add(self, place: tuple[float, float]) -> bool:
        """Add a position; True if two stations send under this number."""
        last, self._last = self._last, place
        if last is None or distance_m(*last, *place) < JUMP_M:
            return False
        before, self._before = self._before, last
        returned = before is not None and distance_m(*before, *place) < RETURN_M
        self._back = self._back + 1 if returned else 0
        return self._back >= JUMPS


def unique_number(message: dialect.AutopilotVersion) -> str | None:
    """Return the unique number of an autopilot in hexadecimal; None if the message has none."""
    if any(message.uid2):
        return bytes(message.uid2).rstrip(b"\0").hex()
    return f"{message.uid:016x}" if message.uid else None
