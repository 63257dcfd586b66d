"""Which drone owns which way, of those that one ground station serves. Pure.

A drone asks for a way and says which ways of the others it knew. It gets it only if those are
all that there are: so no two choose at once without knowing of each other, however late any
word is. Until it says that it flies the new way it owns both; a drone that falls silent keeps
what it owns.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

from uavrt.geodesy import distance_m
from uavrt.messages import Course, Neighbour

OLD = 100
"""A sequence number so little behind the last is of a word that came late."""
MOVED_M = 5.0
"""A goal that moved so far without being asked for is another way."""
FIRST_S = 3.0
"""After the first word nothing is given: by then all have spoken, that can be heard."""
_ROUND = 0x10000


@dataclass(slots=True)
class _Member:
    course: Course
    heard_s: float
    version: int = 1
    granted: int = 0
    denied: int = 0
    way: tuple[tuple[float, float], ...] = ()
    """Given and not flown yet."""


class GivenWays:
    """All drones that have said where they go."""

    def __init__(self) -> None:
        self._members: dict[int, _Member] = {}
        self._begun_s: float | None = None

    def take(self, vehicle: int, course: Course, now_s: float) -> bool:
        """Take a drone's course; return whether it and the others must know at once."""
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
        """Give a way that is asked for, or not; whether that is news."""
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
        """Which drones get reports: of several all that fly or ever sent one, of one that asks.

        A drone that ever got a report asks for each way: without further reports, also when
        the other has landed or the station has restarted, it would get no way any more.

        `flying`: vehicles that fly by commands, as far as is heard.
        """
        known = set(self._members)
        together = known | set(flying)
        if len(together) > 1:
            return together
        return {vehicle for vehicle, one in self._members.items() if one.course.asked}

    def reports_for(self, vehicle: int, now_s: float) -> list[Neighbour]:
        """Reports for a drone, one of each other; without others one without a course."""
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
    """Whether it flies another way than it did, unasked: home, or by an order of its own.

    A way that it was given has another number; one that it stands on is shorter.
    """
    if course.flown != before.flown or course.goal == course.place:
        return False
    return distance_m(*before.goal, *course.goal) > MOVED_M


def _next(version: int) -> int:
    return version % (_ROUND - 1) + 1
