"""Bytes between a ground station and drones that search together: both may be of other days."""

from uavrt.core.messages import Course, FoundTag, Neighbour
from uavrt.link.tunnel.own_messages.neighbour_messages import (
    decode_course,
    decode_neighbour,
    encode_course,
    encode_neighbour,
)
from uavrt.link.tunnel.own_messages.private import COURSE_TYPE, NEIGHBOUR_TYPE
from uavrt.link.tunnel.own_messages.seal import NEIGHBOUR_INSIDE

COURSE = (
    "01053412060007004b52401c42f4170500200444f4010000c8000000c800e8030202010002000300"
    "050002010200040006000cfe0cfe1800"
)
NEIGHBOUR = (
    "01010900070005000200000001053412060007004b52401c42f4170500200444f4010000c8000000"
    "c800e803000201000200040006000cfe0cfe1800"
)
GIVEN_BY_USER = Course(
    sequence=0x1234,
    place=(47.3977419, 8.5455938),
    altitude_amsl_m=528.5,
    goal=(47.3987419, 8.5455938),
    searching=True,
    flown=6,
    asked=7,
    requested_leg=((47.3981419, 8.5455938), (47.3981419, 8.5475938)),
    given=((2, 3), (5, 258)),
    held=(2, 4),
    found=(FoundTag(tag_id=6, place=(47.3967419, 8.5445938), radius95_m=24.0),),
)


def test_a_course_has_its_bytes() -> None:
    assert encode_course(GIVEN_BY_USER).hex() == COURSE
    got = decode_course(bytes.fromhex(COURSE))
    assert (got.sequence, got.flown, got.asked, got.given) == (
        0x1234,
        6,
        7,
        GIVEN_BY_USER.given,
    )
    assert (got.held, got.found[0].tag_id, got.found[0].radius95_m) == ((2, 4), 6, 24.0)
    assert (got.searching, got.returning) == (True, False)


def test_a_neighbour_has_its_bytes() -> None:
    told = Neighbour(vehicle=1, version=9, granted=7, denied=5, age_s=2.0, course=GIVEN_BY_USER)
    assert encode_neighbour(told).hex() == NEIGHBOUR
    got = decode_neighbour(bytes.fromhex(NEIGHBOUR))
    assert (got.vehicle, got.version, got.granted, got.denied, got.age_s) == (1, 9, 7, 5, 2.0)
    assert got.course is not None
    assert got.course.given == ()  # of no use to others


def test_the_word_that_there_are_others_has_its_bytes() -> None:
    alone = Neighbour(vehicle=0, granted=3)
    assert encode_neighbour(alone).hex() == "010000000300000000000000"
    assert decode_neighbour(bytes.fromhex("010000000300000000000000")) == alone


def test_their_payload_types_and_kind_of_seal() -> None:
    assert (COURSE_TYPE, NEIGHBOUR_TYPE) == (60_009, 60_010)
    assert NEIGHBOUR_INSIDE == 5
