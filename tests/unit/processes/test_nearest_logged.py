"""The log says how near each leg came to its target: real flights show where drones rest."""

import json

import pytest
from flown import Flown
from tests.unit.processes.test_motion_handler import Link, begin

from uavrt.core.messages import TurnInPlace, VehicleRequest


def logged(capsys: pytest.CaptureFixture[str], event: str) -> list[float | None]:
    lines = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    return [line["nearest_m"] for line in lines if line["event"] == event]


def test_the_log_says_how_near_each_leg_came_to_its_target(
    capsys: pytest.CaptureFixture[str],
) -> None:
    link = Link(flown=Flown("ardupilot"))
    link.run(1.5)
    begin(link, 30.0)
    for _ in range(15):
        link.run(1.0)
        link.alive()
    turn = VehicleRequest(order_id=5, manoeuvre=TurnInPlace(turn_deg=90.0, rate_deg_s=20.0))
    link.handler.handle_request(turn)
    link.run(1.0)
    first, after_leg = logged(capsys, "command sent")
    assert first is None, "no leg before the first command"
    assert after_leg is not None
    assert after_leg < 0.7


def test_an_order_that_ends_on_its_way_says_how_far_it_was(
    capsys: pytest.CaptureFixture[str],
) -> None:
    link = Link(flown=Flown("px4"))
    link.run(1.5)
    begin(link, 60.0)
    left_m = 60.0 - link.flown.vehicle.body.north_m
    link.flown.vehicle.set_mode(3 << 16)
    link.run(1.0)
    assert link.states[-1].standing == "out"
    ended = logged(capsys, "state of motion control changed")[-1]
    assert ended is not None
    assert left_m - 5.0 < ended < left_m + 1.0
