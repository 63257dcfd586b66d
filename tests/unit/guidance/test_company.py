"""One drone among others: what it refuses, and what it does without."""

from dataclasses import replace

import pytest
from flown import Flown
from some import some

from uavrt.core.errors import PlanError
from uavrt.core.messages import Course, FoundTag, Neighbour
from uavrt.guidance.operator_orders import VehicleNow
from uavrt.guidance.safety import SAFETY
from uavrt.guidance.search.search_run import Choice
from uavrt.guidance.search.shared_search import SharedSearch


@pytest.fixture
def now() -> VehicleNow:
    """At home, 40 m above it."""
    found = some(Flown("px4").now())
    return found


FLOWN = Flown("px4")


def other(north_m: float, east_m: float, above_m: float, to: tuple[float, float]) -> Neighbour:
    """Vehicle 2, so far from home, and its goal."""
    course = Course(
        sequence=1,
        place=FLOWN.place(north_m, east_m),
        altitude_amsl_m=430.0 + above_m,
        goal=FLOWN.place(*to),
        searching=True,
    )
    return Neighbour(vehicle=2, version=4, course=course)


@pytest.fixture
def heights(now: VehicleNow) -> VehicleNow:
    return replace(now, altitude_amsl_m=470.0, altitude_relative_m=40.0)


def choice(north_m: float, east_m: float, held: tuple[int, ...] = ()) -> Choice:
    found = (FoundTag(tag_id=9, place=FLOWN.place(0.0, 50.0), radius95_m=20.0),)
    leg = (FLOWN.place(0.0, 0.0), FLOWN.place(north_m, east_m))
    return Choice(steps=(), status_text="", notes=(), leg=leg, held=held, found=found)


@pytest.mark.parametrize(
    ("neighbour", "named"),
    [
        (other(60.0, 0.0, 52.0, (-60.0, 0.0)), "the path of vehicle 2 is 0 m from this drone"),
        (other(60.0, 0.0, 45.0, (90.0, 0.0)), "searches only 5 m higher or lower"),
    ],
)
def test_a_search_too_near_another_is_refused(
    heights: VehicleNow, neighbour: Neighbour, named: str
) -> None:
    shared = SharedSearch()
    shared.receive(neighbour, heights.time_s)
    with pytest.raises(PlanError, match=named):
        shared.check(heights, 40.0)
    hand_flown = replace(neighbour, course=replace(some(neighbour.course), searching=False))
    shared.receive(hand_flown, heights.time_s)
    shared.check(heights, 40.0)


def test_one_alone_asks_nobody_and_says_nothing(now: VehicleNow) -> None:
    shared = SharedSearch()
    assert shared.choose(choice(0.0, 100.0), now)
    assert not shared.waits
    assert not shared.informed(now.time_s)


def test_a_way_is_flown_once_it_is_given(now: VehicleNow) -> None:
    shared = SharedSearch(7)
    shared.receive(other(200.0, 0.0, 52.0, (250.0, 0.0)), now.time_s)
    assert [one.vehicle for one in shared.begin_decision(now.time_s)] == [2]
    assert not shared.choose(choice(0.0, 100.0, held=(4, 6)), now)
    course = shared.course(now, searching=True)
    assert (course.given, course.requested_leg) == (((2, 4),), choice(0.0, 100.0).leg)
    assert sorted(course.held) == [4, 6]
    assert course.goal == course.place
    assert shared.answer(now) is None
    shared.receive(Neighbour(vehicle=0, granted=course.asked), now.time_s)
    flown_choice, given = shared.answer(now) or (None, False)
    assert given
    assert flown_choice is not None
    after = shared.course(now, searching=True)
    assert (after.flown, after.asked, after.goal) == (course.asked, 0, FLOWN.place(0.0, 100.0))


@pytest.mark.parametrize("how", ["denied", "no answer", "old grant", "another came near"])
def test_without_a_way_it_goes_on_as_before(now: VehicleNow, how: str) -> None:
    shared = SharedSearch(7)
    shared.receive(other(200.0, 0.0, 52.0, (250.0, 0.0)), now.time_s)
    shared.begin_decision(now.time_s)
    shared.choose(choice(0.0, 100.0), now)
    number, later = shared.course(now).asked, now
    match how:
        case "denied":
            shared.receive(Neighbour(vehicle=0, denied=number), now.time_s)
        case "no answer":
            later = replace(now, time_s=now.time_s + SAFETY.answer_s)
        case "old grant":
            shared.receive(Neighbour(vehicle=0, granted=number - 1), now.time_s)
            assert shared.answer(now) is None
            later = replace(now, time_s=now.time_s + SAFETY.answer_s)
        case "another came near":
            near = other(40.0, 60.0, 52.0, (-40.0, 60.0))
            shared.receive(replace(near, granted=number), now.time_s)
    answer = some(shared.answer(later))
    assert not answer[1]
    assert not shared.waits
    course = shared.course(later)
    assert (course.flown, course.goal) == (0, course.place)
    # A grant that comes now is for nothing.
    shared.receive(Neighbour(vehicle=0, granted=number), later.time_s)
    assert shared.answer(later) is None


def test_it_stays_and_returns_unasked(now: VehicleNow) -> None:
    shared = SharedSearch()
    shared.receive(other(200.0, 0.0, 52.0, (250.0, 0.0)), now.time_s)
    assert shared.choose(choice(0.0, 0.0), now)
    assert shared.choose(replace(choice(0.0, 0.0), returning=True), now)
    course = shared.course(now)
    assert (course.goal, course.returning) == (now.home, True)


def test_others_stay_as_they_were_told_until_the_next_order(now: VehicleNow) -> None:
    shared = SharedSearch()
    shared.receive(other(200.0, 0.0, 52.0, (250.0, 0.0)), now.time_s)
    late_s = now.time_s + 5.0 * SAFETY.report_age_s
    (one,) = shared.others(late_s)
    assert one.age_s == 5.0 * SAFETY.report_age_s
    assert shared.has_others(late_s)
    assert not shared.informed(late_s)
    shared.begin(late_s)
    assert not shared.has_others(late_s)


def test_who_asks_is_heard_by_a_station_that_has_begun_anew(now: VehicleNow) -> None:
    """It does not tell of others until it has heard of some: one of them may be silent."""
    shared = SharedSearch(7)
    shared.receive(other(200.0, 0.0, 52.0, (250.0, 0.0)), now.time_s)
    later = replace(now, time_s=now.time_s + 2.0 * SAFETY.report_age_s)
    assert not shared.must_report(later.time_s)
    assert not shared.choose(choice(0.0, 100.0), later)
    assert shared.must_report(later.time_s)
