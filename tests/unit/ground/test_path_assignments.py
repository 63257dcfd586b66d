"""Who owns which way: no two drones choose without knowing of each other."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.messages import Course
from uavrt.ground.link.motions.path_assignments import PathAssignments

PLACE, GOAL = (47.0, 8.0), (47.001, 8.0)
STANDS = Course(sequence=1, place=PLACE, altitude_amsl_m=500.0, goal=PLACE, searching=True)
WAY = (PLACE, GOAL)


@pytest.fixture
def ways() -> PathAssignments:
    """Two drones that have spoken, long enough ago."""
    made = PathAssignments()
    for number in (1, 2):
        assert made.receive_course(number, STANDS, 0.0)
    return made


def asks(number: int, sequence: int, *given: tuple[int, int]) -> Course:
    return replace(STANDS, sequence=sequence, asked=number, requested_leg=WAY, given=given)


def verdict(ways: PathAssignments, vehicle: int) -> tuple[int, int]:
    told = ways.reports_for(vehicle, 10.0)[0]
    return told.granted, told.denied


def test_a_way_is_given_to_who_knew_all_others(ways: PathAssignments) -> None:
    assert ways.receive_course(1, asks(7, 2, (2, 1)), 10.0)
    assert verdict(ways, 1) == (7, 0)
    (told,) = ways.reports_for(2, 11.0)
    assert (told.vehicle, told.version, told.age_s) == (1, 2, 1.0)
    assert told.course is not None
    assert (told.course.goal, told.course.requested_leg) == (PLACE, WAY)
    # It flies it now: what it owned before is free.
    assert not ways.receive_course(1, replace(STANDS, sequence=3, flown=7, goal=GOAL), 11.0)
    (told,) = ways.reports_for(2, 11.0)
    assert told.course is not None
    assert (told.version, told.course.goal, told.course.requested_leg) == (2, GOAL, ())


@pytest.mark.parametrize(
    "asked",
    [
        asks(7, 2),  # was told of nobody
        asks(7, 2, (2, 9)),
        asks(7, 2, (3, 1)),
        replace(asks(7, 2, (2, 1)), searching=False),
    ],
)
def test_a_way_is_not_given_to_who_knew_less(ways: PathAssignments, asked: Course) -> None:
    assert ways.receive_course(1, asked, 10.0)
    assert verdict(ways, 1) == (0, 7)
    assert ways.reports_for(2, 10.0)[0].version == 1


def test_of_two_that_ask_at_once_one_gets_its_way(ways: PathAssignments) -> None:
    ways.receive_course(1, asks(7, 2, (2, 1)), 10.0)
    ways.receive_course(2, asks(4, 2, (1, 1)), 10.0)
    assert (verdict(ways, 1), verdict(ways, 2)) == ((7, 0), (0, 4))
    ways.receive_course(2, asks(5, 3, (1, 2)), 11.0)
    assert verdict(ways, 2) == (5, 4)


def test_who_gives_up_a_way_frees_it_and_late_words_change_nothing(
    ways: PathAssignments,
) -> None:
    asked = asks(7, 2, (2, 1))
    ways.receive_course(1, asked, 10.0)
    ways.receive_course(1, replace(STANDS, sequence=3), 11.0)
    for late in (asked, replace(STANDS, sequence=1, goal=GOAL)):
        assert not ways.receive_course(1, late, 12.0)
    (told,) = ways.reports_for(2, 12.0)
    assert told.course is not None
    assert (told.course.goal, told.course.requested_leg) == (PLACE, ())


def test_a_way_that_nobody_asked_for_is_news_to_the_others(ways: PathAssignments) -> None:
    home = replace(STANDS, sequence=2, goal=GOAL, returning=True)
    assert ways.receive_course(1, home, 10.0)
    ways.receive_course(2, asks(7, 2, (1, 1)), 10.0)
    assert verdict(ways, 2) == (0, 7)


def test_nothing_is_given_before_all_can_have_spoken() -> None:
    ways = PathAssignments()
    ways.receive_course(1, STANDS, 0.0)
    assert not ways.receive_course(1, asks(7, 2), 1.0)
    assert verdict(ways, 1) == (0, 0)
    ways.receive_course(2, STANDS, 2.0)
    ways.receive_course(1, asks(7, 3), 4.0)
    assert verdict(ways, 1) == (0, 7)


def test_a_drone_that_begins_to_count_anew_is_heard(ways: PathAssignments) -> None:
    ways.receive_course(1, replace(STANDS, sequence=40_000), 5.0)
    ways.receive_course(1, replace(STANDS, sequence=3), 6.0)
    assert ways.reports_for(2, 6.0)[0].age_s == 0.0


@given(st.lists(st.tuples(st.integers(1, 3), st.booleans(), st.booleans()), max_size=40))
def test_every_way_that_is_given_was_chosen_with_all_the_others(
    turns: list[tuple[int, bool, bool]],
) -> None:
    """Whoever asks, with new or old knowledge, and whether it flies then or not."""
    ways = PathAssignments()
    known: dict[int, dict[int, int]] = {number: {} for number in (1, 2, 3)}
    owned = dict.fromkeys(known, 0)
    for number in known:
        ways.receive_course(number, STANDS, 0.0)
    sequence, number_asked = 1, 0
    for vehicle, learns, flies in turns:
        if learns:
            told = ways.reports_for(vehicle, 10.0)
            known[vehicle] = {one.vehicle: one.version for one in told}
        sequence, number_asked = sequence + 1, number_asked + 1
        versions = {one.vehicle: one.version for one in ways.reports_for(vehicle, 10.0)}
        ways.receive_course(
            vehicle, asks(number_asked, sequence, *known[vehicle].items()), 10.0
        )
        given_way = verdict(ways, vehicle)[0] == number_asked
        assert given_way == (known[vehicle] == versions)
        sequence += 1
        owned[vehicle] = number_asked if given_way and flies else owned[vehicle]
        ways.receive_course(
            vehicle, replace(STANDS, sequence=sequence, flown=owned[vehicle]), 10.0
        )


def test_who_has_spoken_is_told_also_when_the_other_has_landed_or_is_silent() -> None:
    """Else it waits for each way for good: it knows of the other as long as it searches."""
    ways = PathAssignments()
    assert ways.recipients([1]) == set()
    assert ways.recipients([1, 2]) == {1, 2}
    ways.receive_course(1, STANDS, 0.0)
    assert ways.recipients([1]) == set()
    ways.receive_course(
        1, asks(3, 2, (2, 1)), 0.0
    )  # it knows of another: the station was restarted
    assert ways.recipients([]) == {1}
    ways.receive_course(2, STANDS, 0.0)
    assert ways.recipients([]) == {1, 2}
    # The second has landed and is off: the first still gets a way.
    ways.receive_course(1, asks(7, 3, (2, 1)), 10.0)
    assert 1 in ways.recipients([1])
    assert verdict(ways, 1) == (7, 0)
