"""Table of all private messages between a drone and a ground station of uavrt.

A message from the drone has a decoder on the ground. A message to the drone has a number inside
a seal (`uavrt.link.tunnel.own_messages.seal`); some are accepted only sealed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from uavrt.link.tunnel.generations.wire import PAYLOAD_TYPE
from uavrt.link.tunnel.own_messages.beep import BEEP_TYPE, decode_beep
from uavrt.link.tunnel.own_messages.burst import BURST_TYPE, decode_burst
from uavrt.link.tunnel.own_messages.coded_tag import CODED_TAG_TYPE
from uavrt.link.tunnel.own_messages.live_bearing import BEARING_TYPE, decode_bearing
from uavrt.link.tunnel.own_messages.motion_messages import decode_state
from uavrt.link.tunnel.own_messages.neighbour_messages import decode_course
from uavrt.link.tunnel.own_messages.private import (
    COURSE_TYPE,
    MOTION_STATE_TYPE,
    MOTION_TYPE,
    NEIGHBOUR_TYPE,
    RECEIPT_TYPE,
)
from uavrt.link.tunnel.own_messages.seal import (
    ALIVE_INSIDE,
    CODED_TAG_INSIDE,
    MOTION_INSIDE,
    NEIGHBOUR_INSIDE,
    PARAMETER_INSIDE,
    PLAIN_INSIDE,
    RECEIPT_INSIDE,
)

FROM_DRONE: dict[int, Callable[[bytes], Any]] = {
    BEARING_TYPE: decode_bearing,
    BEEP_TYPE: decode_beep,
    BURST_TYPE: decode_burst,
    MOTION_STATE_TYPE: decode_state,
    COURSE_TYPE: decode_course,
}
"""Decoders of the drone's messages for display, by payload type."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ToDrone:
    """A kind of message from a ground station to a drone."""

    inside: int
    """Number that identifies this kind of message inside a sealed message."""
    payload_type: int | None = None
    """Payload type of the unsealed message; None if the message is only accepted sealed
    (authenticated)."""
    answers: int = 0
    """Number of messages that the drone sends in answer, used to limit unsealed requests."""


TO_DRONE = (
    ToDrone(inside=PLAIN_INSIDE, payload_type=PAYLOAD_TYPE, answers=1),
    ToDrone(inside=RECEIPT_INSIDE, payload_type=RECEIPT_TYPE),
    ToDrone(inside=PARAMETER_INSIDE),
    ToDrone(inside=MOTION_INSIDE, payload_type=MOTION_TYPE, answers=1),
    ToDrone(inside=CODED_TAG_INSIDE, payload_type=CODED_TAG_TYPE, answers=1),
    ToDrone(inside=NEIGHBOUR_INSIDE, payload_type=NEIGHBOUR_TYPE),
    ToDrone(inside=ALIVE_INSIDE),
)
UNSEALED = {one.payload_type: one for one in TO_DRONE if one.payload_type is not None}
