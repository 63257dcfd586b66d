"""A stall of the drone's own process is not a silence of the autopilot."""

import pytest
from flown import Flown
from tests.unit.processes.test_motion_desk import Link, begin

STEP_S = 0.05


def flying() -> Link:
    link = Link(flown=Flown("ardupilot"))
    link.run(1.5)
    begin(link, 200.0)
    link.run(0.5)
    link.alive()
    assert link.states[-1].standing == "in command"
    return link


def stalled(link: Link, seconds: float) -> None:
    """What arrives meanwhile is read after the first turn of the process, with its time."""
    arrived = []
    for _ in range(round(seconds / STEP_S)):
        link.stall(STEP_S)
        arrived += [(link.flown.time_s, one) for one in link.flown.telemetry()]
    link.desk.tick(link.silent_s)
    for at_s, message in arrived:
        link.desk.vehicle(message, link.flown.time_s - at_s)
    link.alive()


@pytest.mark.parametrize("seconds", [0.3, 0.6, 0.95])
def test_an_order_is_flown_on_after_a_stall(seconds: float) -> None:
    link = flying()
    for _ in range(3):
        link.flown.target_told = False  # two reports are lost before the stall
        link.run(0.2)
        link.flown.target_told = True
        stalled(link, seconds)
        link.run(0.5)
        link.alive()
    assert link.states[-1].standing == "in command"


def test_a_target_that_is_lost_during_a_stall_ends_the_order_once_all_is_read() -> None:
    link = flying()
    link.flown.target_told = False
    stalled(link, 0.95)
    link.run(0.25)
    assert link.states[-1].text == "the target is no longer reported"


def test_silence_counts_although_every_turn_is_late() -> None:
    link = flying()
    link.flown.target_told = False
    for _ in range(8):
        stalled(link, 0.3)
    assert link.states[-1].text == "the target is no longer reported"
