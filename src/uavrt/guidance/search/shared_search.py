"""One drone's part in a search with several drones; no I/O.

While a ground station serves several drones, a path is flown only after the ground has assigned
it to the drone. The ground assigns no path that was chosen without the latest paths of all
others. A drone that gets no answer completes its assigned path and hovers there.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import PlanError
from uavrt.core.messages import Course, Neighbour
from uavrt.guidance.height_frames import target_amsl_m
from uavrt.guidance.operator_orders import Place, VehicleNow
from uavrt.guidance.order_execution import stopping_place
from uavrt.guidance.safety import SAFETY
from uavrt.guidance.search.neighbour_drones import SEPARATION, nearest_m, paths_of
from uavrt.planning.drone_model.other_drones import OtherDrones

if TYPE_CHECKING:
    from uavrt.guidance.search.search_run import Choice

_ROUND = 0x10000
_Tag = TypeVar("_Tag")


@dataclass(frozen=True, slots=True)
class _RequestedLeg:
    number: int
    leg: tuple[Place, Place]
    given: tuple[tuple[int, int], ...]
    asked_s: float


class SharedSearch:
    """The other drones in a search, and the paths requested by or assigned to this drone."""

    def __init__(self, sequence: int = 0) -> None:
        self._sequence = self._number = sequence % _ROUND
        self._reported_s: float | None = None
        self._others: dict[int, tuple[Neighbour, float]] = {}
        self._asked: _RequestedLeg | None = None
        self._granted: bool | None = None
        self._given: dict[int, int] = {}
        """Versions of the other drones' paths that the decision in progress uses."""
        self._choice: Choice | None = None
        """Last search decision of this drone; None before the first."""
        self._flown = 0
        self._goal: Place | None = None
        """Position to which the drone flies at present; None: it stays."""
        self._returning = False

    def receive(self, report: Neighbour, now_s: float) -> None:
        """Store a report on another drone, and the answer to a request if it has one."""
        self._reported_s = now_s
        asked = self._asked
        if asked is not None and asked.number in (report.granted, report.denied):
            self._granted = report.granted == asked.number
        if report.course is not None:
            self._others[report.vehicle] = (report, now_s)

    def informed(self, now_s: float) -> bool:
        """True if a ground station has recently reported on other drones."""
        return self._reported_s is not None and now_s - self._reported_s < SAFETY.report_age_s

    def must_report(self, now_s: float) -> bool:
        """True if the ground needs this drone's course, for a request or for other drones."""
        return self.informed(now_s) or self.waits

    def has_others(self, now_s: float) -> bool:
        """True if there may be other drones, so that each path must be requested."""
        return bool(self._others) or self.informed(now_s)

    def others(self, now_s: float) -> tuple[Neighbour, ...]:
        """Return the reports on all other drones, each with its present age."""
        return tuple(
            replace(one, age_s=one.age_s + now_s - reported_s)
            for one, reported_s in self._others.values()
        )

    def check(self, now: VehicleNow, height_m: float) -> None:
        """Raise `PlanError` if another drone searches too close, or at a similar height."""
        plane = TangentPlane(latitude_deg=now.home[0], longitude_deg=now.home[1])
        here = plane.to_local(now.latitude_deg, now.longitude_deg)
        amsl = target_amsl_m(now.altitude_amsl_m, now.altitude_relative_m, height_m)
        for one in self.others(now.time_s):
            course = one.course
            if course is None or not course.searching:
                continue
            drones = OtherDrones(separation=SEPARATION, strips=paths_of((one,), plane))
            place = (float(here[0]), float(here[1]))
            off = nearest_m(drones, [place, place])
            if off < SEPARATION.distance_m:
                raise PlanError(
                    f"the path of vehicle {one.vehicle} is {off:.0f} m from this drone",
                    remedy=f"Start at least {SEPARATION.distance_m:.0f} m from it",
                )
            apart = abs(course.altitude_amsl_m - amsl)
            if apart < SEPARATION.height_m - 0.5:
                raise PlanError(
                    f"vehicle {one.vehicle} searches only {apart:.0f} m higher or lower",
                    remedy=f"Choose heights at least {SEPARATION.height_m:.0f} m apart",
                )

    def begin(self, now_s: float) -> None:
        """Reset for a new order; remove drones with outdated reports."""
        self._others = {
            vehicle: (one, reported_s)
            for vehicle, (one, reported_s) in self._others.items()
            if now_s - reported_s < SAFETY.report_age_s
        }
        self._choice = None
        self.end()

    def end(self) -> None:
        """Release all requested and assigned paths, because the order has ended."""
        self._asked = self._granted = self._goal = None
        self._returning = False

    def begin_decision(self, now_s: float) -> tuple[Neighbour, ...]:
        """Return the reports for the next decision; remember their versions for the request."""
        self._given = {vehicle: one.version for vehicle, (one, _) in self._others.items()}
        return self.others(now_s)

    @property
    def waits(self) -> bool:
        """True while a requested path has no answer."""
        return self._asked is not None

    def choose(self, choice: "Choice", now: VehicleNow) -> bool:
        """Handle a decision.

        True if it may be flown at once, False if its path is first requested.

        A hover needs no request. Nor does a return, because each drone has its own height.
        """
        assert choice.leg is not None
        begin, end = choice.leg
        self._choice = choice
        if begin == end or choice.returning or not self.has_others(now.time_s):
            self.go(now.home if choice.returning else end, returning=choice.returning)
            return True
        self._number = self._number % (_ROUND - 1) + 1
        given = tuple(self._given.items())
        self._asked = _RequestedLeg(self._number, (begin, end), given, now.time_s)
        self._granted = None
        return False

    def answer(self, now: VehicleNow) -> "tuple[Choice, bool] | None":
        """Return the requested decision, and whether its path is assigned.

        None while there is no answer.
        """
        asked, choice = self._asked, self._choice
        if asked is None or choice is None:
            return None
        if self._granted is None and now.time_s - asked.asked_s < SAFETY.answer_s:
            return None
        self._asked = None
        if not (self._granted and self._clear(now, asked.leg[1])):
            return choice, False
        self._flown, self._goal, self._returning = asked.number, asked.leg[1], False
        return choice, True

    def _clear(self, now: VehicleNow, end: Place) -> bool:
        """True if a flight to `end` keeps the required distance from other drones' paths."""
        plane = TangentPlane(latitude_deg=now.home[0], longitude_deg=now.home[1])
        here = (now.latitude_deg, now.longitude_deg)
        stand = here if self._goal is None else stopping_place(now, self._goal)
        places = [plane.to_local(*place) for place in (here, stand, end)]
        strips = paths_of(self.others(now.time_s), plane)
        drones = OtherDrones(separation=SEPARATION, strips=strips)
        off = nearest_m(drones, [(float(x), float(y)) for x, y in places])
        return off >= SEPARATION.distance_m

    def go(self, goal: Place | None, *, returning: bool = False) -> None:
        """Set the goal of a flight that needs no assigned path; None if the drone hovers."""
        self._asked, self._goal, self._returning = None, goal, returning

    def course(
        self, now: VehicleNow, *, searching: bool = False, height_m: float | None = None
    ) -> Course:
        """Return the report on this drone's position, path and tags.

        Each report begins with a different tag, because the link cuts long lists.
        """
        self._sequence = (self._sequence + 1) % _ROUND
        here = (now.latitude_deg, now.longitude_deg)
        height = now.altitude_relative_m if height_m is None else height_m
        asked, choice = self._asked, self._choice
        return Course(
            sequence=self._sequence,
            place=here,
            altitude_amsl_m=target_amsl_m(now.altitude_amsl_m, now.altitude_relative_m, height),
            goal=here if self._goal is None else self._goal,
            searching=searching,
            returning=self._returning,
            flown=self._flown,
            asked=0 if asked is None else asked.number,
            requested_leg=() if asked is None else asked.leg,
            given=() if asked is None else asked.given,
            held=() if choice is None else _turned(choice.held, self._sequence),
            found=() if choice is None else _turned(choice.found, self._sequence),
        )


def _turned(items: tuple[_Tag, ...], by: int) -> tuple[_Tag, ...]:
    at = by % len(items) if items else 0
    return items[at:] + items[:at]
