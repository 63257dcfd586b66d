"""What drones that search together say and are told, on the wire."""

import struct
from contextlib import suppress
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.errors import TunnelError
from uavrt.core.messages import Course, FoundTag, Neighbour
from uavrt.link.tunnel.generations.wire import MAX_PAYLOAD
from uavrt.link.tunnel.own_messages.neighbour_messages import decode_course, decode_neighbour
from uavrt.link.tunnel.own_messages.neighbour_messages import encode_course as course_bytes
from uavrt.link.tunnel.own_messages.neighbour_messages import (
    encode_neighbour as neighbour_bytes,
)
from uavrt.link.tunnel.own_messages.seal import MAX_INSIDE

numbers = st.integers(0, 65_535)
near = st.tuples(st.floats(46.95, 47.05), st.floats(7.95, 8.05))
courses = st.builds(
    Course,
    sequence=numbers,
    place=st.just((47.0, 8.0)),
    altitude_amsl_m=st.floats(-400.0, 9000.0, width=32),
    goal=near,
    searching=st.booleans(),
    returning=st.booleans(),
    flown=numbers,
    asked=numbers,
    requested_leg=st.just(()) | st.tuples(near, near),
    given=st.lists(st.tuples(st.integers(1, 255), numbers), max_size=15).map(tuple),
    held=st.lists(numbers, max_size=30).map(tuple),
    found=st.lists(
        st.builds(FoundTag, tag_id=numbers, place=near, radius95_m=st.integers(0, 999)),
        max_size=20,
    ).map(tuple),
)


def same(place: tuple[float, float], other: tuple[float, float]) -> bool:
    return place == pytest.approx(other, abs=1.1e-6)


@given(courses)
def test_a_course_comes_back_to_a_decimetre(course: Course) -> None:
    payload = course_bytes(course)
    assert len(payload) <= MAX_PAYLOAD
    got = decode_course(payload)
    assert same(got.goal, course.goal)
    assert len(got.requested_leg) == len(course.requested_leg)
    assert all(map(same, got.requested_leg, course.requested_leg))
    # Tags as many as fit, those found first; ways in any case.
    assert got.held == course.held[: len(got.held)]
    assert [one.tag_id for one in got.found] == [
        one.tag_id for one in course.found[: len(got.found)]
    ]
    cut = len(got.found) < len(course.found) or len(got.held) < len(course.held)
    assert not cut or len(payload) > MAX_PAYLOAD - 8
    plain: dict[str, Any] = {
        "goal": (),
        "requested_leg": (),
        "held": (),
        "found": (),
        "place": (),
    }
    assert replace(got, **plain) == replace(course, **plain)


@given(courses, st.integers(1, 255), numbers, st.integers(0, 254))
def test_a_neighbour_fits_into_a_seal(
    course: Course, vehicle: int, version: int, age: int
) -> None:
    told = Neighbour(
        vehicle=vehicle, version=version, granted=7, denied=6, age_s=age, course=course
    )
    payload = neighbour_bytes(told)
    assert len(payload) <= MAX_INSIDE
    got = decode_neighbour(payload)
    assert got.course is not None
    assert got.course.given == ()
    assert same(got.course.goal, course.goal)
    assert replace(got, course=None) == replace(told, course=None)


@given(st.binary(max_size=MAX_PAYLOAD))
def test_bytes_are_a_course_and_a_neighbour_or_refused(payload: bytes) -> None:
    for body in (payload, b"\x01" + payload):
        with suppress(TunnelError):
            assert abs(decode_course(body).place[0]) <= 90.0
        with suppress(TunnelError):
            assert bool(decode_neighbour(body).vehicle) == (len(body) > 12)


COURSE = Course(sequence=5, place=(47.0, 8.0), altitude_amsl_m=500.0, goal=(47.001, 8.0))


@pytest.mark.parametrize(
    ("offset", "layout", "value"),
    [
        (0, "B", 2),
        (8, "i", 910_000_000),
        (12, "i", -1_900_000_000),
        (16, "f", float("nan")),
        (32, "B", 1),
        (33, "B", 200),
        (34, "B", 1),
    ],
)
def test_a_damaged_course_is_refused(offset: int, layout: str, value: float) -> None:
    payload = bytearray(course_bytes(COURSE))
    struct.pack_into("<" + layout, payload, offset, value)
    with pytest.raises(TunnelError):
        decode_course(bytes(payload))
    told = neighbour_bytes(Neighbour(vehicle=2, course=COURSE))[:12] + bytes(payload)
    with pytest.raises(TunnelError):
        decode_neighbour(told)


def test_a_way_that_cannot_be_told_is_not_told_shorter() -> None:
    far = replace(COURSE, goal=(47.1, 8.0))
    with pytest.raises(TunnelError, match="does not fit"):
        course_bytes(far)
    # A tag found far away is left out alone.
    found = FoundTag(tag_id=4, place=(47.2, 8.0), radius95_m=20.0)
    assert decode_course(course_bytes(replace(COURSE, found=(found,)))).found == ()
