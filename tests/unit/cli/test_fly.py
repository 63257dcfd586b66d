"""`uavrt fly` follows its own order, and leaves nothing flying that it does not follow."""

import json
from contextlib import suppress
from typing import Any

import made
import pytest
from willing_drone import WillingDrone

from uavrt.cli.fly import fly
from uavrt.demo.programs import free_udp_port
from uavrt.errors import ConfigError, LinkError, TunnelError, UavrtError
from uavrt.messages import MotionRequest
from uavrt.tunnel import (
    MOTION_STATE_TYPE,
    MotionConfirmation,
    MotionState,
    decode_motion,
    encode_state,
)

EARLIER, ORDER, LATER = 3, 5, 7


class MovingDrone(WillingDrone):
    """Offers what it is asked for; its words on an earlier order come late."""

    def __init__(self, port: int, *, answers: bool, ends: int = ORDER) -> None:
        self.heard: list[Any] = []
        self._answers, self._ends = answers, ends
        super().__init__(port)

    def _beat(self) -> None:
        with suppress(ConnectionRefusedError):  # nobody listens yet
            super()._beat()

    def _obey(self, payload: bytes) -> None:
        try:
            said = decode_motion(payload, (254, 190))
        except TunnelError:
            return  # a receipt
        self.heard.append(said)
        if isinstance(said, MotionRequest):
            self._say("offer", "out", "hold here", said.request_id, ORDER)
        elif isinstance(said, MotionConfirmation) and self._answers:
            self._say("state", "out", "done", 0, EARLIER)
            self._say("state", "confirmed", "confirmed", said.request_id, ORDER)
            self._say("state", "out", "done", 0, EARLIER)
            self._say("state", "in command", "hold here", 0, ORDER)
            if self._ends == ORDER:
                self._say("state", "out", "the sticks were moved", 0, ORDER)
            else:
                self._say("state", "confirmed", "confirmed", 0, LATER)
        elif not isinstance(said, MotionConfirmation):
            self._say("state", "out", "stopped by the operator", said.request_id, ORDER)

    def _say(self, kind: Any, standing: Any, text: str, answers: int, order_id: int) -> None:
        payload = encode_state(
            MotionState(
                kind=kind, standing=standing, text=text, request_id=answers, order_id=order_id
            )
        )
        message = made.tunnel(MOTION_STATE_TYPE, payload)
        self._sock.send(self._companion.encode(message))


def fly_with(*, answers: bool, ends: int = ORDER) -> tuple[MovingDrone, BaseException | None]:
    """Fly until the command ends; the drone, and how it ended."""
    port, ended = free_udp_port(), None
    drone = MovingDrone(port, answers=answers, ends=ends)
    try:
        fly("hold", mavlink=f"udpin://127.0.0.1:{port}", yes=True, json_lines=True)
    except (SystemExit, UavrtError) as end:
        ended = end
    finally:
        drone.close()
    return drone, ended


def test_the_end_of_an_earlier_order_is_not_taken_for_that_of_this_one(
    capsys: pytest.CaptureFixture[str],
) -> None:
    _, ended = fly_with(answers=True)
    told = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert told == [
        {"event": "offer", "text": "hold here"},
        {"event": "confirmed", "text": "confirmed"},
        {"event": "in command", "text": "hold here"},
        {"event": "out", "text": "the sticks were moved"},
    ]
    assert isinstance(ended, SystemExit)
    assert ended.code == 1


def test_an_order_of_another_ends_the_following_of_this_one(
    capsys: pytest.CaptureFixture[str],
) -> None:
    _, ended = fly_with(answers=True, ends=LATER)
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert last == {"event": "out", "text": "another order was confirmed"}
    assert isinstance(ended, SystemExit)
    assert ended.code == 1


def test_a_confirmation_without_an_answer_is_followed_by_a_stop() -> None:
    drone, ended = fly_with(answers=False)
    assert isinstance(ended, LinkError)
    kinds = [type(said).__name__ for said in drone.heard]
    assert kinds == ["MotionRequest", "MotionConfirmation", "MotionStop"]


@pytest.mark.parametrize(
    ("action", "numbers", "values", "reason"),
    [
        ("goto", (), {}, "goto needs a place"),
        ("goto", (47.1,), {}, "goto needs a place"),
        ("goto", (8.5, 147.1, 3.0), {}, "goto needs a place"),
        ("goto", (147.1, 8.5), {}, "is not a latitude"),
        ("goto", (float("nan"), 8.5), {}, "is not a latitude"),
        ("hold", (30.0,), {}, "hold takes no numbers"),
        ("takeoff", (), {}, "takeoff needs one height"),
        ("takeoff", (30.0, 8.0), {}, "takeoff needs one height"),
        ("takeoff", (30.0,), {"height": 20.0}, "takeoff needs one height"),
    ],
)
def test_numbers_that_do_not_fit_are_refused_with_the_right_ones(
    action: Any, numbers: tuple[float, ...], values: dict[str, Any], reason: str
) -> None:
    with pytest.raises(ConfigError, match=reason) as refused:
        fly(action, *numbers, **values)
    assert refused.value.remedy
