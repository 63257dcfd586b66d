"""Assign paths to the drones that one ground station serves, so that they stay apart. Pure.

A drone that requests a path names the other drones' paths that it has received. It gets the
path only if that list is complete, so no two choose at once without each other's plans, however
late a message is. Until it reports that it flies the new path it owns the old one, too; a
silent drone keeps what it owns.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

from uavrt.geodesy import distance_m
from uavrt.messages import Course, Neighbour

OLD = 100
"""Largest lag of a sequence number that marks a message as delayed, not restarted."""
MOVED_M = 5.0
"""Distance by which a goal that moved without a request counts as another path [m]."""
FIRST_S = 3.0
"""Time after the first report before paths are assigned [s]: by then all drones have
reported."""
_ROUND = 0x10000


@dataclass(slots=True)
class _Member:
    course: Course
    heard_s: float
    version: int = 1
    granted: int = 0
    denied: int = 0
    way: tuple[tuple[float, float], ...] = ()
    """Path that is assigned but not flown yet."""


class GivenWays:
    """All drones that have reported their course."""

    def __init__(self) -> None:
        self._members: dict[int, _Member] = {}
        self._begun_s: float | None = None

    def take(self, vehicle: int, course: Course, now_s: float) -> bool:
        """Store a drone's course; return whether all drones must be informed at once."""
        one = self._members.get(vehicle)
        if self._begun_s is None:
            self._begun_s = now_s
        early = now_s - self._begun_s < FIRST_S
        if one is None:
            self._members[vehicle] = _Member(course, now_s)
            return True
        if 0 <= (one.course.sequence - course.sequence) % _ROUND < OLD:
            return False
        before, one.course, one.heard_s = one.course, course, now_s
        changed = False
        if one.way and course.flown == one.granted:
            one.way = ()  # it flies it
        elif one.way and course.asked != one.granted:
            one.way = ()  # it does without
        elif _elsewhere(before, course):
            one.version = _next(one.version)
            changed = True
        return (not early and self._judge(vehicle, one)) or changed

    def _judge(self, vehicle: int, one: _Member) -> bool:
        """Grant or refuse a requested path; return whether the others must be informed."""
        asked = one.course.asked
        if not asked or not one.course.asked_way or asked in (one.granted, one.denied):
            return False
        given = dict(one.course.given)
        knew = all(
            given.get(other) == member.version
            for other, member in self._members.items()
            if other != vehicle
        )
        if one.course.searching and knew:
            one.granted, one.way = asked, one.course.asked_way
            one.version = _next(one.version)
        else:
            one.denied = asked
        return True

    def recipients(self, flying: Collection[int]) -> set[int]:
        """Select the drones that get reports about the others.

        Of several, all that fly or ever sent a course; a single drone only while it requests a
        path. A drone that once got a report needs further ones even when the other has landed
        or the station has restarted: without them it would never be assigned a path again.

        `flying`: vehicles that fly by commands, as far as known.
        """
        known = set(self._members)
        together = known | set(flying)
        if len(together) > 1:
            return together
        return {vehicle for vehicle, one in self._members.items() if one.course.asked}

    def reports_for(self, vehicle: int, now_s: float) -> list[Neighbour]:
        """Reports for a drone, one about each other drone; a single drone gets an empty one."""
        own = self._members.get(vehicle)
        answer = Neighbour(
            vehicle=0,
            granted=0 if own is None else own.granted,
            denied=0 if own is None else own.denied,
        )
        others = [
            replace(
                answer,
                vehicle=other,
                version=member.version,
                age_s=now_s - member.heard_s,
                course=replace(member.course, asked=0, asked_way=member.way, given=()),
            )
            for other, member in self._members.items()
            if other != vehicle
        ]
        return others or [answer]


def _elsewhere(before: Course, course: Course) -> bool:
    """True if it flies another path than before without a request: home, or its own order.

    An assigned path has another number; a path that is being completed is shorter.
    """
    if course.flown != before.flown or course.goal == course.place:
        return False
    return distance_m(*before.goal, *course.goal) > MOVED_M


def _next(version: int) -> int:
    return version % (_ROUND - 1) + 1
