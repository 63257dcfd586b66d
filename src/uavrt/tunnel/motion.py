"""Orders of motion on the wire: our own payload types, sealed except to a simulator.

From the ground, payload type 60005, or inside a seal (`uavrt.tunnel.seal`)::

    offset  type   field
    0       u8     version, 1; 2: asks with places to keep out of
    1       u8     1: ask, 2: confirm, 3: stop
    2       u16    zero
    4       u32    request id of the asker
  ask:
    8       u8     action: 0 rotate, 1 goto, 2 survey, 3 hold, 4 return, 5 search,
                   6 takeoff
    9       u8     bit 0: clockwise, bit 1: the height is told
    10      u8     of a survey: 0 lines, 1 around, 2 points
    11      u8     number of places to keep out of; 0 in version 1
    12      f32    height above home [m]
    16      f32    duration [s]
    20      f32    spacing [m]; of a search the radius that is wished
   and of a search alone:
    24      u16    radius around the drone [m], 0: an outline follows
    26      u8     number of tags, 0: all; then a zero byte
    28      u16[]  their numbers
   then, at 24 or behind those, of each place to keep out of:
            u8     its corners
            u16    radius of the circle around its only one [m], else 0
   and behind those:
            i32    latitude of the first place [1e-7 deg], if there is one; then its longitude
            i16    further places: latitude, longitude less the first's [2e-6 deg]; the corners
                   of what is to be kept out of come last
  confirm:
    8       u32    order id, as offered
    12      u8     bit 0: the operator knows that the sticks are not seen
    13      u8[3]  zero
    16      u64    nonce, as offered

From the drone, payload type 60006::

    0       u8     version, 1
    1       u8     1: offer, 2: refused, 3: state
    2       u8     standing: 0 out, 1 confirmed, 2 in command
    3       u8     zero
    4       u32    request id that it answers, 0 for none
    8       u32    order id: of the offer, in a state of the order confirmed last; 0 for none
    12      u64    nonce of an offer, else 0
    20             text, UTF-8, at most 108 bytes
"""

import struct
from dataclasses import dataclass, replace
from math import ceil, isfinite
from typing import Literal

from uavrt.errors import TunnelError, UsageError
from uavrt.messages import KeepOut, MotionAction, MotionRequest, SurveyPattern
from uavrt.tunnel.seal import MAX_INSIDE

_VERSION, _VERSION_KEEP_OUT = 1, 2
"""A drone that knows nothing of places to keep out of must not take them for corners."""
_HEAD = struct.Struct("<BBHI")
_ASK = struct.Struct("<BBBBfff")
_KEPT = struct.Struct("<BH")
_FIRST = struct.Struct("<ii")
_FURTHER = struct.Struct("<hh")
_SEARCH = struct.Struct("<HBx")
_CONFIRM = struct.Struct("<IB3xQ")
_STATE = struct.Struct("<BBBxIIQ")
_ASKS, _CONFIRMS, _STOPS = 1, 2, 3
_FINE, _COARSE = 1e-7, 2e-6
_MOST = 1e6
MAX_PLACES = 20
"""What fits into a seal's 108 bytes."""
MAX_TEXT = 108
MOTION_ACTIONS: tuple[MotionAction, ...] = (
    "rotate",
    "goto",
    "survey",
    "hold",
    "return",
    "search",
    "takeoff",
)
PATTERNS: tuple[SurveyPattern, ...] = ("lines", "around", "points")
Standing = Literal["out", "confirmed", "in command"]
STANDINGS: tuple[Standing, ...] = ("out", "confirmed", "in command")
StateKind = Literal["offer", "refused", "state"]
_KINDS: dict[StateKind, int] = {"offer": 1, "refused": 2, "state": 3}


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionConfirmation:
    """The operator's confirmation of an offer."""

    request_id: int
    order_id: int
    nonce: int
    sticks_unseen: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionStop:
    """Take the drone out of our hands."""

    request_id: int


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionState:
    """What became of an order, or the current state."""

    kind: StateKind
    standing: Standing
    text: str
    request_id: int = 0
    order_id: int = 0
    nonce: int = 0


def encode_request(request: MotionRequest) -> bytes:
    """Write what is asked for.

    Raises
    ------
    UsageError
        It has too many places, or they are too far apart.
    """
    kept = request.keep_out
    places = (*request.places, *(place for one in kept for place in one.places))
    if len(places) > MAX_PLACES:
        others = " with its places to keep out of" if kept else ""
        raise UsageError(
            f"an area of {len(places)} corners{others}",
            remedy=f"Draw one of {MAX_PLACES} or fewer",
        )
    flags = int(request.clockwise) | int(request.height_m is not None) << 1
    width = request.wish_m if request.action == "search" else request.spacing_m
    numbers = (request.height_m or 0.0, request.duration_s, width)
    if not all(abs(number) < _MOST for number in numbers):  # also NaN
        raise UsageError(
            "a height, duration or distance is no number, or too large",
            remedy="Give metres and seconds",
        )
    version = _VERSION_KEEP_OUT if kept else _VERSION
    payload = _HEAD.pack(version, _ASKS, 0, request.request_id) + _ASK.pack(
        MOTION_ACTIONS.index(request.action),
        flags,
        PATTERNS.index(request.pattern),
        len(kept),
        *numbers,
    )
    if request.action == "search":
        payload += _sought(request)
    payload += b"".join(map(_kept, kept))
    if len(payload) + _size(len(places)) > MAX_INSIDE:
        raise UsageError(
            f"{len(places)} corners, {len(kept)} places to keep out of and "
            f"{len(request.tags)} tags do not fit",
            remedy="Draw a simpler area, leave the tags out to search for all, or set "
            "guidance.keep_out_file on the drone",
        )
    if not places:
        return payload
    (latitude, longitude), *further = places
    try:
        payload += _FIRST.pack(round(latitude / _FINE), round(longitude / _FINE))
        for north, east in further:
            payload += _FURTHER.pack(
                round((north - latitude) / _COARSE), round((east - longitude) / _COARSE)
            )
    except (struct.error, ValueError, OverflowError) as error:  # also what is no number
        raise UsageError(
            "the corners are too far apart, or no places",
            remedy="Draw an area of less than 4 km, in degrees: latitude, longitude",
        ) from error
    return payload


def _sought(request: MotionRequest) -> bytes:
    """Write what only a search has."""
    try:
        return _SEARCH.pack(round(request.radius_m or 0.0), len(request.tags)) + struct.pack(
            f"<{len(request.tags)}H", *request.tags
        )
    except (struct.error, ValueError, OverflowError) as error:
        raise UsageError(
            "a radius or a tag's number is too large for an order of motion",
            remedy="Give a radius and numbers below 65536, or leave the tags out",
        ) from error


def _kept(one: KeepOut) -> bytes:
    """Write what a place to keep out of is, without its corners."""
    try:
        radius = 0 if one.radius_m is None else max(1, ceil(one.radius_m))
        return _KEPT.pack(len(one.places), radius)
    except (struct.error, ValueError, OverflowError) as error:
        raise UsageError(
            f"a circle of {one.radius_m:g} m to keep out of",
            remedy="Give a radius below 65536 m",
        ) from error


def _size(places: int) -> int:
    return _FIRST.size + (places - 1) * _FURTHER.size if places else 0


def encode_confirmation(confirmation: MotionConfirmation) -> bytes:
    """Write a confirmation."""
    return _HEAD.pack(_VERSION, _CONFIRMS, 0, confirmation.request_id) + _CONFIRM.pack(
        confirmation.order_id, int(confirmation.sticks_unseen), confirmation.nonce
    )


def is_stop(payload: bytes) -> bool:
    """Whether a payload takes the drone out of our hands."""
    return payload[1] == _STOPS


def is_confirmation(payload: bytes) -> bool:
    """Whether a payload confirms."""
    return payload[1] == _CONFIRMS


def encode_stop(stop: MotionStop) -> bytes:
    """Write a stop."""
    return _HEAD.pack(_VERSION, _STOPS, 0, stop.request_id)


def decode_motion(
    payload: bytes, asker: tuple[int, int]
) -> MotionRequest | MotionConfirmation | MotionStop:
    """Read what a ground station says of motion.

    Raises
    ------
    TunnelError
        It is none.
    """
    known = _VERSION, _VERSION_KEEP_OUT
    if len(payload) < _HEAD.size or payload[0] not in known:
        raise TunnelError("an order of motion of another version", payload)
    version, kind, _, request_id = _HEAD.unpack_from(payload)
    body = payload[_HEAD.size :]
    try:
        if kind == _ASKS and (version == _VERSION_KEEP_OUT) == (body[3] > 0):
            return _request(body, request_id, asker)
        if kind == _CONFIRMS:
            order_id, flags, nonce = _CONFIRM.unpack(body)
            return MotionConfirmation(
                request_id=request_id,
                order_id=order_id,
                nonce=nonce,
                sticks_unseen=bool(flags & 1),
            )
        if kind == _STOPS and not body:
            return MotionStop(request_id=request_id)
    except (struct.error, IndexError) as error:
        raise TunnelError("an order of motion of a wrong length", payload) from error
    raise TunnelError("an order of motion of an unknown kind", payload)


def _request(body: bytes, request_id: int, asker: tuple[int, int]) -> MotionRequest:
    action, flags, pattern, kept, height, duration, spacing = _ASK.unpack_from(body)
    if not all(map(isfinite, (height, duration, spacing))):
        raise TunnelError("an order of motion with what is no number", body)
    request = MotionRequest(
        request_id=request_id,
        asker=asker,
        action=MOTION_ACTIONS[action],
        height_m=height if flags & 2 else None,
        duration_s=duration,
        clockwise=bool(flags & 1),
        pattern=PATTERNS[pattern],
    )
    rest = body[_ASK.size :]
    if request.action != "search":
        return _with_places(replace(request, spacing_m=spacing), rest, kept)
    radius, count = _SEARCH.unpack_from(rest)
    request = replace(
        request,
        wish_m=spacing,
        radius_m=float(radius) if radius else None,
        tags=struct.unpack_from(f"<{count}H", rest, _SEARCH.size),
    )
    return _with_places(request, rest[_SEARCH.size + 2 * count :], kept)


def _with_places(request: MotionRequest, body: bytes, kept: int) -> MotionRequest:
    """Read the corners of what is asked for, and of what is to be kept out of."""
    shapes = [_KEPT.unpack_from(body, _KEPT.size * number) for number in range(kept)]
    places = _places(body[_KEPT.size * kept :])
    first = len(places) - sum(count for count, _ in shapes)
    if first < 0:
        raise TunnelError("an order of motion without the corners that it tells of", body)
    keep_out, at = [], first
    for count, radius in shapes:
        corners, at = places[at : at + count], at + count
        if len(corners) < 3 and not (radius and count == 1):
            raise TunnelError("a place to keep out of that is none", body)
        keep_out.append(KeepOut(places=corners, radius_m=float(radius) if count == 1 else None))
    return replace(request, places=places[:first], keep_out=tuple(keep_out))


def _places(body: bytes) -> tuple[tuple[float, float], ...]:
    if not body:
        return ()
    north, east = (number * _FINE for number in _FIRST.unpack_from(body))
    further = _FURTHER.iter_unpack(body[_FIRST.size :])
    return (
        (north, east),
        *((north + a * _COARSE, east + b * _COARSE) for a, b in further),
    )


def cut_text(text: str, tail: str = "") -> str:
    """A text that fits with its tail; what is cut ends with a whole word and an ellipsis.

    Parameters
    ----------
    text, tail : str
        The tail is what must be read: it is left out of no text.
    """
    most = MAX_TEXT - len(tail.encode())
    if len(text.encode()) <= most:
        return text + tail
    room = most - len("…".encode())
    fits = text.encode()[:room].decode("utf-8", "ignore")
    whole, space, _ = fits.rpartition(" ")
    return f"{whole.rstrip(' ,;:') if space else fits}…{tail}"


def _printable(text: str) -> str:
    """A text without control characters: it is written to terminals, and is not sealed."""
    return "".join(one if one.isprintable() else "\ufffd" for one in text)


def encode_state(state: MotionState) -> bytes:
    """Write what became of an order; a text that is too long is cut."""
    text = cut_text(state.text).encode()
    return (
        _STATE.pack(
            _VERSION,
            _KINDS[state.kind],
            STANDINGS.index(state.standing),
            state.request_id,
            state.order_id,
            state.nonce,
        )
        + text
    )


def decode_state(payload: bytes) -> MotionState:
    """Read what a drone says of motion.

    Raises
    ------
    TunnelError
        It is none.
    """
    if len(payload) < _STATE.size or payload[0] != _VERSION:
        raise TunnelError("a state of motion of another version", payload)
    _, kind, standing, request_id, order_id, nonce = _STATE.unpack_from(payload)
    kinds = {number: name for name, number in _KINDS.items()}
    if kind not in kinds or standing >= len(STANDINGS):
        raise TunnelError("a state of motion of an unknown kind", payload)
    return MotionState(
        kind=kinds[kind],
        standing=STANDINGS[standing],
        text=_printable(payload[_STATE.size :].decode("utf-8", "replace")),
        request_id=request_id,
        order_id=order_id,
        nonce=nonce,
    )
