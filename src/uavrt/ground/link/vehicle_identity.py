"""Select the vehicle that a ground station serves. Pure.

One radio may carry several vehicles. The first one with our software is chosen, by its system
number and its autopilot's unique number, and kept through any silence until the operator
chooses another: a station that switched by itself would stop, locate and record the wrong one.
"""

from uavrt.geodesy import distance_m
from uavrt.mavlink import dialect
from uavrt.units import ns_from_s

DRONE_COMPONENT = 191
"""MAVLink component of the drone side."""
FOREIGN_NS = ns_from_s(60.0)
"""Time for which a reply with a foreign unique number counts [ns]: three queries."""
MAX_OTHERS = 16
APART_M, SAME_M, TIMES = 40.0, 15.0, 4
"""Positions that jump by the first distance [m] and return within the second [m], this many
times in a row, come from two stations under one number."""


class VehicleIdentity:
    """The served vehicle, and the others received.

    `system_id`: its number; None takes the first one received.
    `uid`: its autopilot's unique number, hexadecimal; None takes the first one reported.
    """

    def __init__(self, system_id: int | None = None, uid: str | None = None) -> None:
        self.system_id = system_id
        self.uid = uid
        self.others: dict[int, int] = {}
        """Other systems received, with the time of their last heartbeat [ns]."""
        self.excluded: set[int] = set()
        """Vehicles that another session serves and this one never selects."""
        self._foreign_ns: int | None = None
        self._places = _Places()

    def choose(self, system_id: int) -> None:
        """Serve this vehicle from now on, with any autopilot."""
        self.system_id, self.uid, self._foreign_ns = system_id, None, None
        self.others.pop(system_id, None)
        self._places = _Places()

    def heard(self, system_id: int, now_ns: int) -> bool:
        """Handle a vehicle's heartbeat, the first becomes ours; return whether it is ours."""
        if self.system_id is None and system_id not in self.excluded:
            self.system_id = system_id
        if system_id == self.system_id:
            return True
        if system_id in self.others or len(self.others) < MAX_OTHERS:
            self.others[system_id] = now_ns
        return False

    def take_version(self, message: dialect.AutopilotVersion, now_ns: int) -> None:
        """Store the unique number of our vehicle's autopilot."""
        uid = unique_number(message)
        if uid is None:
            return
        if self.uid is None:
            self.uid = uid
        if uid != self.uid:
            self._foreign_ns = now_ns

    def take_place(self, place: tuple[float, float], now_ns: int) -> None:
        """Add the position of a station without an autopilot, to detect two of them."""
        if self._places.take(place):
            self._foreign_ns = now_ns

    def foreign(self, now_ns: int) -> bool:
        """True while another autopilot or station answers under our vehicle's number."""
        return self._foreign_ns is not None and now_ns - self._foreign_ns < FOREIGN_NS


class _Places:
    """Distinguishes one moving station from two standing ones, whose positions alternate."""

    def __init__(self) -> None:
        self._last: tuple[float, float] | None = None
        self._before: tuple[float, float] | None = None
        """Position before the last impossibly fast move."""
        self._back = 0

    def take(self, place: tuple[float, float]) -> bool:
        """Add a position; return whether two stations send under this number."""
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
