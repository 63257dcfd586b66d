"""Drones that search together: what each says of itself, and is told of the others.

From the drone, payload type 60009, once a second while a ground station tells of others::

    offset  type   field
    0       u8     version, 1
    1       u8     bit 0: searches, bit 1: returns, bit 2: the way at 24 is one
    2       u16    sequence
    4       u16    number of the way that it flies, 0: none that it asked for
    6       u16    number of the way that it asks for, 0: none
    8       i32    latitude [1e-7 deg], then longitude
    16      f32    altitude above mean sea level [m]
    20      i16    end of its way: latitude, longitude less its own [2e-6 deg]
    24      i16    begin and end of the way that it asks for, likewise
    32      u8     number of vehicles whose ways it took as given, of tags that it is after, of
                   tags that it has found; then a zero byte
    36             of each vehicle: u8 system number, zero, u16 version of its ways
           u16[]   tags that it is after
                   of each tag found: u16 number, i16 latitude, longitude as above, u16 radius
                   that holds it with 95 % [m]

From the ground, payload type 60010, or inside a seal (`uavrt.tunnel.seal`)::

    0       u8     version, 1
    1       u8     system number of the vehicle that it is about, 0: none is known
    2       u16    version of its ways
    4       u16    number of the way that the drone asked for and now owns, 0: none
    6       u16    number of the way that it does not get, 0: none
    8       u8     since that vehicle was heard [s], 255: or longer
    9       u8[3]  zero
    12             what that vehicle said, as above; the way at 24 is owned, too

Neither asks for a motion: the second can withhold a way, never give one that was not asked for.
Tags that do not fit are left out; the sender puts others first each time.
"""

import struct
from dataclasses import replace

from uavrt.errors import TunnelError
from uavrt.messages import Course, FoundTag, Neighbour
from uavrt.tunnel.seal import MAX_INSIDE

MAX_COURSE = 128
_VERSION = 1
_COURSE = struct.Struct("<BBHHHiifhhhhhhBBBx")
_GIVEN = struct.Struct("<BxH")
_FOUND = struct.Struct("<HhhH")
_NEIGHBOUR = struct.Struct("<BBHHHB3x")
_FINE, _COARSE = 1e-7, 2e-6
_SEARCHES, _RETURNS, _ASKS = 1, 2, 4
_MOST = 32_767

Place = tuple[float, float]


def encode_course(course: Course, most: int = MAX_COURSE) -> bytes:
    """Write what a drone says of itself, with as many tags as fit.

    Raises
    ------
    TunnelError
        A place is none, or a way leads farther than 7 km.
    """
    here = course.place
    asked = course.asked_way or (here, here)
    room = most - _COURSE.size - _GIVEN.size * len(course.given)
    near = [one for one in course.found if _is_near(here, one)]
    found = near[: max(0, min(255, room // _FOUND.size))]
    held = course.held[: max(0, min(255, (room - _FOUND.size * len(found)) // 2))]
    bits = _SEARCHES * course.searching | _RETURNS * course.returning
    try:
        return b"".join(
            (
                _COURSE.pack(
                    _VERSION,
                    bits | _ASKS * bool(course.asked_way),
                    course.sequence,
                    course.flown,
                    course.asked,
                    *(round(degrees / _FINE) for degrees in here),
                    course.altitude_amsl_m,
                    *(step for place in (course.goal, *asked) for step in _off(here, place)),
                    *(len(course.given), len(held), len(found)),
                ),
                *(_GIVEN.pack(vehicle, version) for vehicle, version in course.given),
                struct.pack(f"<{len(held)}H", *held),
                *(_found(here, one) for one in found),
            )
        )
    except (struct.error, ValueError, OverflowError) as error:
        raise TunnelError(f"a course that does not fit: {error}", b"") from error


def _off(here: Place, place: Place) -> tuple[int, int]:
    """A place by how far north and east of another it is."""
    north, east = (
        round((there - own) / _COARSE) for own, there in zip(here, place, strict=True)
    )
    return north, east


def _found(here: Place, one: FoundTag) -> bytes:
    return _FOUND.pack(one.tag_id, *_off(here, one.place), min(65_535, round(one.radius95_m)))


def _is_near(here: Place, one: FoundTag) -> bool:
    return max(map(abs, _off(here, one.place))) <= _MOST


def decode_course(payload: bytes) -> Course:
    """Read what a drone says of itself.

    Raises
    ------
    TunnelError
        It is none.
    """
    if len(payload) < _COURSE.size or payload[0] != _VERSION:
        raise TunnelError("a course of another version", payload)
    _, bits, sequence, flown, asked, north, east, altitude, *rest = _COURSE.unpack_from(payload)
    *offsets, given, held, found = rest
    here = (north * _FINE, east * _FINE)
    if abs(here[0]) > 90.0 or abs(here[1]) > 180.0 or not abs(altitude) < 1e5:  # also NaN
        raise TunnelError("a course from no place", payload)
    at = _COURSE.size
    ends = (at + _GIVEN.size * given, 2 * held, _FOUND.size * found)
    if len(payload) != sum(ends):
        raise TunnelError("a course of a wrong length", payload)
    tags = ends[0] + ends[1]
    pairs = zip(offsets[::2], offsets[1::2], strict=True)
    goal, *asked_way = (_at(here, *pair) for pair in pairs)
    return Course(
        sequence=sequence,
        place=here,
        altitude_amsl_m=altitude,
        goal=goal,
        searching=bool(bits & _SEARCHES),
        returning=bool(bits & _RETURNS),
        flown=flown,
        asked=asked,
        asked_way=tuple(asked_way) if bits & _ASKS else (),
        given=tuple(_GIVEN.iter_unpack(payload[at : ends[0]])),
        held=struct.unpack_from(f"<{held}H", payload, ends[0]),
        found=tuple(
            FoundTag(tag_id=tag_id, place=_at(here, dn, de), radius95_m=float(radius))
            for tag_id, dn, de, radius in _FOUND.iter_unpack(payload[tags:])
        ),
    )


def _at(here: Place, north: int, east: int) -> Place:
    return (here[0] + north * _COARSE, here[1] + east * _COARSE)


def encode_neighbour(told: Neighbour) -> bytes:
    """Write what a drone is told of another; raises as `encode_course`."""
    course = b""
    if told.course is not None:
        room = MAX_INSIDE - _NEIGHBOUR.size
        course = encode_course(replace(told.course, given=()), room)
    head = _NEIGHBOUR.pack(
        *(_VERSION, told.vehicle, told.version, told.granted, told.denied),
        min(255, int(told.age_s)),
    )
    return head + course


def decode_neighbour(payload: bytes) -> Neighbour:
    """Read what a ground station tells of another drone.

    Raises
    ------
    TunnelError
        It is none.
    """
    if len(payload) < _NEIGHBOUR.size or payload[0] != _VERSION:
        raise TunnelError("a neighbour of another version", payload)
    _, vehicle, version, granted, denied, age = _NEIGHBOUR.unpack_from(payload)
    body = payload[_NEIGHBOUR.size :]
    if bool(vehicle) != bool(body):
        raise TunnelError("a neighbour without its course, or a course of nobody", payload)
    return Neighbour(
        vehicle=vehicle,
        version=version,
        granted=granted,
        denied=denied,
        age_s=float(age),
        course=decode_course(body) if body else None,
    )
