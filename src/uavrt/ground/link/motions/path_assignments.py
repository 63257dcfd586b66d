"""Assign paths to the drones of one ground station, so that they stay apart. No I/O.

A drone that requests a path names the other drones' paths that it has received. It gets the
path only if that list is complete. So no two drones choose paths without knowing each other's,
even if messages are late. A drone's old path stays reserved until the drone reports that it
flies the new one. A silent drone's paths stay reserved.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

from uavrt.core.earth.geodesy import distance_m
from uavrt.core.messages import Course, Neighbour

MOST_LAG = 100
"""Largest lag of a report's sequence number for which the report counts as late. A larger lag
means that the drone has restarted."""
MOVED_M = 5.0
"""Distance by which a drone's reported goal must move to count as a new path [m]."""
FIRST_REPORTS_S = 3.0
"""Time after the first report for which no paths are assigned, so that all drones can report
[s]."""
_ROUND = 0x10000


@dataclass(slots=True)
class _Member:
    course: Course
    heard_s: float
    version: int = 1
    granted: int = 0
    denied: int = 0
    path: tuple[tuple[float, float], ...] = ()
    """Points of the assigned path not yet flown, as (latitude, longitude) in degrees."""


class PathAssignments:
    """Present and assigned paths of all drones that have reported their position."""

    def __init__(self) -> None:
        self._members: dict[int, _Member] = {}
        self._begun_s: float | None = None

    def receive_course(self, vehicle: int, course: Course, now_s: float) -> bool:
        """Store a drone's report; return True if the other drones must be informed at once."""
        one = self._members.get(vehicle)
        if self._begun_s is None:
            self._begun_s = now_s
        early = now_s - self._begun_s < FIRST_REPORTS_S
        if one is None:
            self._members[vehicle] = _Member(course, now_s)
            return True
        if 0 <= (one.course.sequence - course.sequence) % _ROUND < MOST_LAG:
            return False
        before, one.course, one.heard_s = one.course, course, now_s
        changed = False
        if one.path and course.flown == one.granted:
            one.path = ()  # it flies it
        elif one.path and course.asked != one.granted:
            one.path = ()  # it does without
        elif _leaves_path(before, course):
            one.version = _next(one.version)
            changed = True
        return (not early and self._grant_or_refuse(vehicle, one)) or changed

    def _grant_or_refuse(self, vehicle: int, one: _Member) -> bool:
        """Grant or refuse a requested path; return True if other drones must be informed."""
        asked = one.course.asked
        if not asked or not one.course.requested_leg or asked in (one.granted, one.denied):
            return False
        given = dict(one.course.given)
        knew = all(
            given.get(other) == member.version
            for other, member in self._members.items()
            if other != vehicle
        )
        if one.course.searching and knew:
            one.granted, one.path = asked, one.course.requested_leg
            one.version = _next(one.version)
        else:
            one.denied = asked
        return True

    def recipients(self, flying: Collection[int]) -> set[int]:
        """Select the drones that get reports about other drones.

        With several drones: all that fly or ever sent a report; a single one while it requests
        a path. A drone that once got a report needs further ones, else it is never assigned a
        path again.
        """
        known = set(self._members)
        together = known | set(flying)
        if len(together) > 1:
            return together
        return {vehicle for vehicle, one in self._members.items() if one.course.asked}

    def reports_for(self, vehicle: int, now_s: float) -> list[Neighbour]:
        """Reports to a drone, one per other drone; a single drone gets one empty report."""
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
                course=replace(member.course, asked=0, requested_leg=member.path, given=()),
            )
            for other, member in self._members.items()
            if other != vehicle
        ]
        return others or [answer]


def _leaves_path(before: Course, course: Course) -> bool:
    """True if a drone changed its goal without requesting a path, as for a return."""
    if course.flown != before.flown or course.goal == course.place:
        return False
    return distance_m(*before.goal, *course.goal) > MOVED_M


def _next(version: int) -> int:
    return version % (_ROUND - 1) + 1
