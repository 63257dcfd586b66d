"""Exchange positions and courses of drones that search together.

A drone sends its course once a second while a ground station reports other drones; the station
reports each of them as a neighbour. Neither message requests a motion: a neighbour can block a
path, never assign one. Tags that do not fit are left out; the sender changes the order of tags
each time. Layouts: payload types 60009 and 60010 of the manual's tunnel reference.
"""

from dataclasses import replace

from uavrt.core.errors import TunnelError
from uavrt.core.messages import Course, FoundTag, Neighbour
from uavrt.link.tunnel.own_messages.field_layout import Layout
from uavrt.link.tunnel.own_messages.seal import MAX_INSIDE

MAX_COURSE = 128
_FINE, _COARSE = 1e-7, 2e-6
_GIVEN_SIZE, _FOUND_SIZE, _HELD_SIZE = 4, 8, 2
_MOST = 32_767
_COURSE = Layout(
    "a course",
    "format:B searching,returning,asks:B sequence:H flown:H asked:H latitude:i longitude:i "
    "altitude_amsl_m:f offsets:6h given#:B held#:B found#:B :x given*:BxH held*:H found*:HhhH",
    {
        "latitude": (-900_000_000, 900_000_000),
        "longitude": (-1_800_000_000, 1_800_000_000),
        "altitude_amsl_m": (-1e5, 1e5),
    },
    format=1,
)
_NEIGHBOUR = Layout(
    "a neighbour",
    "format:B vehicle:B version:H granted:H denied:H age_s:B :3x course~",
    format=1,
)

Place = tuple[float, float]


def encode_course(course: Course, most: int = MAX_COURSE) -> bytes:
    """Encode a drone's position, path and as many of its tags as fit into `most` bytes; raises
    `TunnelError`.
    """
    here = course.place
    latitude, longitude = here
    asked = course.requested_leg or (here, here)
    room = most - _COURSE.size - _GIVEN_SIZE * len(course.given)
    try:
        near = [one for one in course.found if max(map(abs, _offset(here, one.place))) <= _MOST]
        found = near[: max(0, min(255, room // _FOUND_SIZE))]
        room -= _FOUND_SIZE * len(found)
        return _COURSE.pack(
            course,
            asks=bool(course.requested_leg),
            latitude=round(latitude / _FINE),
            longitude=round(longitude / _FINE),
            offsets=[step for place in (course.goal, *asked) for step in _offset(here, place)],
            held=course.held[: max(0, min(255, room // _HELD_SIZE))],
            found=[
                (one.tag_id, *_offset(here, one.place), min(65_535, round(one.radius95_m)))
                for one in found
            ],
        )
    except (ValueError, OverflowError) as error:  # a place that is not finite
        raise TunnelError(f"a course does not fit in its message: {error}", b"") from error


def _offset(here: Place, place: Place) -> tuple[int, int]:
    """Return the offset of a position north and east of `here` in the units of the message."""
    north, east = (
        round((there - own) / _COARSE) for own, there in zip(here, place, strict=True)
    )
    return north, east


def decode_course(payload: bytes) -> Course:
    """Decode a drone's course; raises `TunnelError` for anything else."""
    got = _COURSE.unpack(payload)
    here = (got.pop("latitude") * _FINE, got.pop("longitude") * _FINE)
    offsets, asks, found = got.pop("offsets"), got.pop("asks"), got.pop("found")
    goal, *requested_leg = (_at(here, *offsets[n : n + 2]) for n in (0, 2, 4))
    return Course(
        **got,
        place=here,
        goal=goal,
        requested_leg=tuple(requested_leg) if asks else (),
        found=tuple(
            FoundTag(tag_id=tag_id, place=_at(here, dn, de), radius95_m=float(radius))
            for tag_id, dn, de, radius in found
        ),
    )


def _at(here: Place, north: int, east: int) -> Place:
    return (here[0] + north * _COARSE, here[1] + east * _COARSE)


def encode_neighbour(report: Neighbour) -> bytes:
    """Encode a ground station's report of another drone; raises `TunnelError`."""
    course = b""
    if report.course is not None:
        room = MAX_INSIDE - _NEIGHBOUR.size
        course = encode_course(replace(report.course, given=()), room)
    return _NEIGHBOUR.pack(report, age_s=min(255, int(report.age_s)), course=course)


def decode_neighbour(payload: bytes) -> Neighbour:
    """Decode a ground station's report of another drone; raises `TunnelError`."""
    got = _NEIGHBOUR.unpack(payload)
    body = got.pop("course")
    if bool(got["vehicle"]) != bool(body):
        raise TunnelError(
            "a neighbour report must contain both vehicle and course, or neither", payload
        )
    age_s = float(got.pop("age_s"))
    return Neighbour(**got, age_s=age_s, course=decode_course(body) if body else None)
