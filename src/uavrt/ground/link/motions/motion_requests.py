"""Request, confirm and stop motions of the drone, for the page and the terminal."""

import secrets
from collections.abc import Sequence

from uavrt.core.errors import CommandRefused, LinkError, UsageError
from uavrt.core.messages import MotionAction, MotionRequest
from uavrt.ground.link.drone_link import GroundLink
from uavrt.link.tunnel.own_messages.motion_messages import (
    MOTION_ACTIONS,
    MotionConfirmation,
    MotionState,
    MotionStop,
    encode_confirmation,
    encode_request,
    encode_stop,
)


def new_number() -> int:
    """Draw a random request number; never 0."""
    return secrets.randbits(31) | 1


def motion_request(
    action: str, places: Sequence[tuple[float, float]] = (), **values: object
) -> MotionRequest:
    """Build a motion request with a new number; raises `UsageError` for an unknown action."""
    if action not in MOTION_ACTIONS:
        known = ", ".join(sorted(MOTION_ACTIONS))
        raise UsageError(
            f"there is no motion command {action[:40]!r}", remedy=f"Choose from {known}"
        )
    named: MotionAction = action
    return MotionRequest(
        request_id=new_number(),
        requester=(0, 0),
        action=named,
        places=tuple(places),
        **values,  # type: ignore[arg-type]
    )


async def request_motion(link: GroundLink, request: MotionRequest) -> MotionState:
    """Request a motion; return the order that the drone proposes. Nothing moves yet. Raises
    `CommandRefused` if the drone refuses, or `LinkError` without an answer.
    """
    return await link.motion(encode_request(request), request.request_id)


async def confirm(link: GroundLink, offer: MotionState, *, sticks_unseen: bool) -> MotionState:
    """Confirm a proposed order; if the drone does not answer, stop it.

    `sticks_unseen`: True if the operator accepts that the drone has no RC link. If the stop is
    not answered either, its error is the cause of the raised error.
    """
    number = new_number()
    confirmation = MotionConfirmation(
        request_id=number,
        order_id=offer.order_id,
        nonce=offer.nonce,
        sticks_unseen=sticks_unseen,
    )
    try:
        return await link.motion(encode_confirmation(confirmation), number)
    except LinkError as error:
        try:
            await stop(link)
        except (CommandRefused, LinkError) as unheard:
            raise error from unheard
        raise


async def stop(link: GroundLink) -> MotionState:
    """Stop the drone and uavrt's control of it; if this raises, a pilot must stop the drone."""
    number = new_number()
    return await link.motion(encode_stop(MotionStop(request_id=number)), number)
