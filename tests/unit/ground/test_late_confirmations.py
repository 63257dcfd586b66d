"""A confirmation is of what its operator saw just now, or is not sent."""

import asyncio
from types import SimpleNamespace
from typing import Any

import made
import pytest

from uavrt.core.errors import CommandRefused, LinkError
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.link.motions import page_motions as flying
from uavrt.ground.link.motions.motion_requests import confirm
from uavrt.ground.link.motions.page_motions import MotionCommands, with_names
from uavrt.link.tunnel.own_messages.motion_messages import (
    MotionConfirmation,
    MotionState,
    encode_confirmation,
    is_stop,
)

SECOND_NS = 10**9


class Hands:
    """A clock that stands, and what was sent."""

    def __init__(self) -> None:
        self.time_ns = 0
        self.sent: list[Any] = []

    def now_ns(self) -> int:
        return self.time_ns


@pytest.fixture
def hands() -> Hands:
    return Hands()


@pytest.fixture
def link(hands: Hands, monkeypatch: pytest.MonkeyPatch) -> GroundLink:
    """One that sends to a list."""
    link = GroundLink(hands.now_ns, ack_wait_s=0.01)
    monkeypatch.setattr(link.protocol, "tunnel_message", lambda payload, kind: payload)
    monkeypatch.setattr(link._links, "send", hands.sent.append)
    return link


@pytest.mark.parametrize(("waited_ns", "sent"), [(SECOND_NS // 2, 1), (2 * SECOND_NS, 0)])
async def test_what_waited_for_another_command_is_not_sent(
    waited_ns: int, sent: int, hands: Hands, link: GroundLink
) -> None:
    payload = encode_confirmation(MotionConfirmation(request_id=3, order_id=5, nonce=7))
    async with link._exchange._busy:
        waiting = asyncio.create_task(link.motion(payload, 3))
        await asyncio.sleep(0)
        hands.time_ns += waited_ns
    with pytest.raises(LinkError, match="did not answer" if sent else "was not sent"):
        await waiting
    assert len(hands.sent) == sent


async def test_an_unsent_confirmation_is_reported_although_the_stop_is_not_answered(
    hands: Hands, link: GroundLink
) -> None:
    offer = MotionState(
        kind="offer", standing="out", text="", request_id=3, order_id=5, nonce=7
    )
    async with link._exchange._busy:
        waiting = asyncio.create_task(confirm(link, offer, sticks_unseen=False))
        await asyncio.sleep(0)
        hands.time_ns += 2 * SECOND_NS
    with pytest.raises(LinkError, match="was not sent"):
        await waiting
    assert hands.sent, "the stop is sent all the same"
    assert all(is_stop(payload) for payload in hands.sent)


@pytest.mark.parametrize("heard", [False, True])
async def test_an_offer_runs_out_also_while_the_drone_is_not_heard(
    heard: bool, hands: Hands, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle: Any = SimpleNamespace(
        clock=hands,
        feed=SimpleNamespace(note=lambda *what: None, send_state=lambda: None),
        connection=SimpleNamespace(watch=None, link=object()),
        situation=lambda: SimpleNamespace(drone_present=True),
    )
    state = MotionState(kind="offer", standing="out", text="hold", order_id=5, nonce=7)

    async def offer(*_: Any, **__: Any) -> MotionState:
        return state

    async def confirm(*_: Any, **__: Any) -> MotionState:
        hands.sent.append(5)
        return MotionState(kind="state", standing="confirmed", text="confirmed", order_id=5)

    monkeypatch.setattr(flying, "request_motion", offer)
    monkeypatch.setattr(flying, "confirm", confirm)
    wish = {"order_id": 5, "sticks_unseen": True}
    page = MotionCommands(vehicle)
    if heard:
        page.receive_state(MotionState(kind="state", standing="out", text="x"))
    await page.request_motion({"action": "hold"}, "page")
    hands.time_ns += 9 * SECOND_NS
    await page.confirm(wish, "page")
    await page.request_motion({"action": "hold"}, "page")
    hands.time_ns += 11 * SECOND_NS
    with pytest.raises(CommandRefused, match="has expired"):
        await page.confirm(wish, "page")
    assert hands.sent == [5]


def test_the_reason_of_a_search_names_the_animal() -> None:
    otter, owl = made.tag(4, name="otter"), made.tag(14, name="")
    reason = "fly 40 m NW: to learn more about tag 4"
    assert with_names(reason, [otter, owl]) == f"{reason} (otter)"
    assert with_names("tag 14 was found", [otter, owl]) == "tag 14 was found"
