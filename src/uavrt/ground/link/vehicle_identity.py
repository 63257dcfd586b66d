"""Which vehicle a ground station serves. Pure.

On one radio several vehicles may be heard. The first one with our software is taken, by its
system number and its autopilot's unique number, and kept through any silence until the
operator chooses another: a station that went over to whoever is heard would stop, place and
record the wrong one.
"""

from uavrt.geodesy import distance_m
from uavrt.mavlink import dialect
from uavrt.units import ns_from_s

DRONE_COMPONENT = 191
"""MAVLink component of the drone side."""
FOREIGN_NS = ns_from_s(60.0)
"""An answer with another unique number counts so long: three questions."""
MAX_OTHERS = 16
APART_M, SAME_M, TIMES = 40.0, 15.0, 4
"""Places that jump by the first distance and return within the second, this many times in a
row, come from two stations under one number."""


class VehicleIdentity:
    """The vehicle that we serve, and the others heard.

    `system_id`: its number; None takes the first that is heard.
    `uid`: its autopilot's unique number, hexadecimal; None takes the first that is reported.
    """

    def __init__(self, system_id: int | None = None, uid: str | None = None) -> None:
        self.system_id = system_id
        self.uid = uid
        self.others: dict[int, int] = {}
        """Systems heard besides, and when last."""
        self.excluded: set[int] = set()
        """Vehicles that are never taken for ours: another session serves them."""
        self._foreign_ns: int | None = None
        self._places = _Places()

    def choose(self, system_id: int) -> None:
        """Serve this vehicle from now on, whatever autopilot it has."""
        self.system_id, self.uid, self._foreign_ns = system_id, None, None
        self.others.pop(system_id, None)
        self._places = _Places()

    def heard(self, system_id: int, now_ns: int) -> bool:
        """Handle a vehicle's heartbeat: the first is ours. Returns whether it is ours."""
        if self.system_id is None and system_id not in self.excluded:
            self.system_id = system_id
        if system_id == self.system_id:
            return True
        if system_id in self.others or len(self.others) < MAX_OTHERS:
            self.others[system_id] = now_ns
        return False

    def take_version(self, message: dialect.AutopilotVersion, now_ns: int) -> None:
        """Take the unique number of our vehicle's autopilot."""
        uid = unique_number(message)
        if uid is None:
            return
        if self.uid is None:
            self.uid = uid
        if uid != self.uid:
            self._foreign_ns = now_ns

    def take_place(self, place: tuple[float, float], now_ns: int) -> None:
        """Take where a station without an autopilot is: of two the places come in turn."""
        if self._places.take(place):
            self._foreign_ns = now_ns

    def foreign(self, now_ns: int) -> bool:
        """True while another autopilot or station answers under our vehicle's number."""
        return self._foreign_ns is not None and now_ns - self._foreign_ns < FOREIGN_NS


class _Places:
    """Distinguishes one station that moves from two that stand: places of two alternate."""

    def __init__(self) -> None:
        self._last: tuple[float, float] | None = None
        self._before: tuple[float, float] | None = None
        """Where it was before it last moved as no one moves."""
        self._back = 0

    def take(self, place: tuple[float, float]) -> bool:
        """Whether these are two."""
        last, self._last = self._last, place
        if last is None or distance_m(*last, *place) < APART_M:
            return False
        before, self._before = self._before, last
        returned = before is not None and distance_m(*before, *place) < SAME_M
        self._back = self._back + 1 if returned else 0
        return self._back >= TIMES


def unique_number(message: dialect.AutopilotVersion) -> str | None:
    """The autopilot's unique number, hexadecimal; None if it sends none."""
    if any(message.uid2):
        return bytes(message.uid2).rstrip(b"\0").hex()
    return f"{message.uid:016x}" if message.uid else None
