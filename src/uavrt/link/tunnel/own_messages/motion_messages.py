"""Encode motion orders from the ground station and the drone's answers.

An order requests a motion, confirms a proposed motion or stops the drone. It is sealed
(authenticated) except when sent to a simulator. The answer is a proposal, a refusal or a state.
Layouts: payload types 60005 and 60006 of the manual's tunnel reference.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import ceil
from typing import Any, Literal

from uavrt.core.errors import TunnelError, UsageError
from uavrt.core.messages import KeepOut, MotionAction, MotionRequest, SurveyPattern
from uavrt.link.tunnel.own_messages.field_layout import Layout
from uavrt.link.tunnel.own_messages.seal import MAX_INSIDE

_VERSION, _VERSION_KEEP_OUT = 1, 2
"""Versions of motion orders without and with keep-out areas; older drones refuse the latter."""
_ASKS, _CONFIRMS, _STOPS = 1, 2, 3
_HEAD = "version:B kind:B :2x request_id:I"
_ASK = Layout(
    "a motion order",
    f"{_HEAD} action:B clockwise,has_height:B pattern:B kept:B height_m:f duration_s:f "
    "width_m:f body~",
    kind=_ASKS,
)
_SEARCH = Layout("an order to search", "radius_m:H tags#:B :x tags*:H body~")
_CONFIRM = Layout(
    "a confirmation",
    f"{_HEAD} order_id:I sticks_unseen:B :3x nonce:Q",
    version=_VERSION,
    kind=_CONFIRMS,
)
_STOP = Layout("a stop", _HEAD, version=_VERSION, kind=_STOPS)
_STATE = Layout(
    "a motion state",
    "version:B kind:B standing:B :x request_id:I order_id:I nonce:Q text~",
    {"kind": (1, 3), "standing": (0, 2)},
    version=_VERSION,
)
_KEPT = struct.Struct("<BH")
_FIRST = struct.Struct("<ii")
_FURTHER = struct.Struct("<hh")
_FINE, _COARSE = 1e-7, 2e-6
_MOST = 1e6
MAX_PLACES = 20
"""Largest number of positions in a motion order, limited by the 108 bytes of a sealed message.
"""
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
ControlStage = Literal["out", "confirmed", "in command"]
CONTROL_STAGES: tuple[ControlStage, ...] = ("out", "confirmed", "in command")
StateKind = Literal["offer", "refused", "state"]
_KINDS: tuple[StateKind, ...] = ("offer", "refused", "state")


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionConfirmation:
    """The operator's confirmation of a proposed order."""

    request_id: int
    order_id: int
    nonce: int
    sticks_unseen: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionStop:
    """Request to end the drone's automatic flight."""

    request_id: int


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionState:
    """State of one motion order, or of the drone's present motion."""

    kind: StateKind
    standing: ControlStage
    text: str
    request_id: int = 0
    order_id: int = 0
    nonce: int = 0


def encode_request(request: MotionRequest) -> bytes:
    """Encode a motion order; raises `UsageError` for too many or too distant positions."""
    kept = request.keep_out
    places = (*request.places, *(place for one in kept for place in one.places))
    if len(places) > MAX_PLACES:
        others = " with its keep-out areas" if kept else ""
        raise UsageError(
            f"the area has {len(places)} corners{others}; at most {MAX_PLACES} are allowed",
            remedy=f"Draw an area with {MAX_PLACES} corners or fewer",
        )
    width_m = request.accuracy_m if request.action == "search" else request.spacing_m
    height_m = request.height_m or 0.0
    if not all(abs(one) < _MOST for one in (height_m, request.duration_s, width_m)):  # also NaN
        raise UsageError(
            "a height, duration or distance is too large or not a number",
            remedy="Give smaller numbers, in metres and seconds",
        )
    payload = _ASK.pack(
        request,
        version=_VERSION_KEEP_OUT if kept else _VERSION,
        action=MOTION_ACTIONS.index(request.action),
        has_height=request.height_m is not None,
        pattern=PATTERNS.index(request.pattern),
        kept=len(kept),
        height_m=height_m,
        width_m=width_m,
        body=(_sought(request) if request.action == "search" else b"")
        + b"".join(map(_kept, kept)),
    )
    if len(payload) + _size(len(places)) > MAX_INSIDE:
        raise UsageError(
            f"{len(places)} corners, {len(kept)} keep-out areas and "
            f"{len(request.tags)} tags do not fit in one order",
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
            "the corners are too far apart, or are not valid positions",
            remedy="Draw an area of less than 4 km, in degrees: latitude, longitude",
        ) from error
    return payload


def _sought(request: MotionRequest) -> bytes:
    """Encode the search settings in a search order."""
    try:
        return _SEARCH.pack(request, radius_m=round(request.radius_m or 0.0), body=b"")
    except (TunnelError, ValueError, OverflowError) as error:
        raise UsageError(
            "a radius or a tag's number is too large for a motion order",
            remedy="Give a radius and numbers below 65536, or leave the tags out",
        ) from error


def _kept(one: KeepOut) -> bytes:
    """Encode the number of corners and the radius of a keep-out area, without its corners."""
    try:
        radius = 0 if one.radius_m is None else max(1, ceil(one.radius_m))
        return _KEPT.pack(len(one.places), radius)
    except (struct.error, ValueError, OverflowError) as error:
        raise UsageError(
            f"the keep-out circle of {one.radius_m:g} m is too large",
            remedy="Give a radius below 65536 m",
        ) from error


def _size(places: int) -> int:
    return _FIRST.size + (places - 1) * _FURTHER.size if places else 0


def encode_confirmation(confirmation: MotionConfirmation) -> bytes:
    """Encode the operator's confirmation of a proposed order."""
    return _CONFIRM.pack(confirmation)


def number_of(payload: bytes) -> int:
    """Return the request id in a motion order or in an answer to one."""
    return int.from_bytes(payload[4:8], "little")


def is_stop(payload: bytes) -> bool:
    """True if a motion payload is a stop."""
    return payload[1:2] == bytes((_STOPS,))


def is_confirmation(payload: bytes) -> bool:
    """True if a motion payload is a confirmation."""
    return payload[1:2] == bytes((_CONFIRMS,))


def encode_stop(stop: MotionStop) -> bytes:
    """Encode a request to end the drone's automatic flight."""
    return _STOP.pack(stop)


def decode_motion(
    payload: bytes, requester: tuple[int, int]
) -> MotionRequest | MotionConfirmation | MotionStop:
    """Decode a motion order, a confirmation or a stop; raises `TunnelError`."""
    if is_confirmation(payload):
        got = _CONFIRM.unpack(payload)
        return MotionConfirmation(**{**got, "sticks_unseen": bool(got["sticks_unseen"] & 1)})
    if is_stop(payload):
        return MotionStop(**_STOP.unpack(payload))
    got = _ASK.unpack(payload)
    try:
        return _request(got, requester)
    except (struct.error, IndexError) as error:
        raise TunnelError("a motion order message has the wrong length", payload) from error


def _request(got: Mapping[str, Any], requester: tuple[int, int]) -> MotionRequest:
    kept, width_m, body = got["kept"], got["width_m"], got["body"]
    if got["version"] != (_VERSION_KEEP_OUT if kept else _VERSION):
        raise TunnelError("a motion order has an unsupported version", body)
    request = MotionRequest(
        request_id=got["request_id"],
        requester=requester,
        action=MOTION_ACTIONS[got["action"]],
        height_m=got["height_m"] if got["has_height"] else None,
        duration_s=got["duration_s"],
        clockwise=got["clockwise"],
        pattern=PATTERNS[got["pattern"]],
    )
    if request.action != "search":
        return _with_places(replace(request, spacing_m=width_m), body, kept)
    search = _SEARCH.unpack(body)
    radius_m = float(search["radius_m"]) or None
    request = replace(request, accuracy_m=width_m, radius_m=radius_m, tags=search["tags"])
    return _with_places(request, search["body"], kept)


def _with_places(request: MotionRequest, body: bytes, kept: int) -> MotionRequest:
    """Add the corners of the search area and of the keep-out areas to a motion order."""
    shapes = [_KEPT.unpack_from(body, _KEPT.size * number) for number in range(kept)]
    places = _places(body[_KEPT.size * kept :])
    first = len(places) - sum(count for count, _ in shapes)
    if first < 0:
        raise TunnelError("a motion order lacks corners", body)
    keep_out, at = [], first
    for count, radius in shapes:
        corners, at = places[at : at + count], at + count
        if len(corners) < 3 and not (radius and count == 1):
            raise TunnelError("a keep-out area has too few corners", body)
        keep_out.append(KeepOut(places=corners, radius_m=float(radius) if count == 1 else None))
    return replace(request, places=places[:first], keep_out=tuple(keep_out))


def _places(body: bytes) -> tuple[tuple[float, float], ...]:
    if not body:
        return ()
    north, east = (number * _FINE for number in _FIRST.unpack_from(body))
    further = _FURTHER.iter_unpack(body[_FIRST.size :])
    return ((north, east), *((north + a * _COARSE, east + b * _COARSE) for a, b in further))


def cut_text(text: str, tail: str = "") -> str:
    """Cut a text after a whole word, so that text and uncut `tail` fit together."""
    most = MAX_TEXT - len(tail.encode())
    if len(text.encode()) <= most:
        return text + tail
    room = most - len("…".encode())
    fits = text.encode()[:room].decode("utf-8", "ignore")
    whole, space, _ = fits.rpartition(" ")
    return f"{whole.rstrip(' ,;:') if space else fits}…{tail}"


def _printable(text: str) -> str:
    """Replace control characters, which could affect a terminal, in an unsealed text."""
    return "".join(one if one.isprintable() else "\ufffd" for one in text)


def encode_state(state: MotionState) -> bytes:
    """Encode a motion state; a text that is too long is cut."""
    return _STATE.pack(
        state,
        kind=_KINDS.index(state.kind) + 1,
        standing=CONTROL_STAGES.index(state.standing),
        text=cut_text(state.text).encode(),
    )


def decode_state(payload: bytes) -> MotionState:
    """Decode a motion state; raises `TunnelError` for anything else."""
    got = _STATE.unpack(payload)
    return MotionState(
        **{
            **got,
            "kind": _KINDS[got["kind"] - 1],
            "standing": CONTROL_STAGES[got["standing"]],
            "text": _printable(got["text"].decode("utf-8", "replace")),
        }
    )
