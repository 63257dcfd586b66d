"""A stall of the drone's own process is no silence of the autopilot, and no one's order."""

from collections.abc import Callable
from typing import Any

import pytest
from flown import Flown
from tests.unit.processes.test_motion_handler import Link, begin, started

from uavrt.core.messages import FlyThere, Manoeuvre, TakeMode, TakeOff, VehicleRequest
from uavrt.guidance.autopilot_behaviour import BEHAVIOURS
from uavrt.link.mavlink.dialect import MavCmd
from uavrt.simulation.vehicle.airframe import Flavour

STEP_S = 0.05
OBEYS_S = 0.1
"""Both autopilots show a new target 0.05 to 0.09 s after the command."""


class SlowLink(Link):
    """A vehicle that takes the commands of a stalled process a little later."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.on_their_way: list[tuple[float, Any]] | None = None

    def command(self, message: Any) -> None:
        if self.on_their_way is None or message.command == MavCmd.REQUEST_MESSAGE:
            super().command(message)
        else:
            self.commands.append(message)
            self.on_their_way.append((self.flown.time_s + OBEYS_S, message))

    def stall(self, seconds: float) -> None:
        super().stall(seconds)
        for at_s, message in self.on_their_way or ():
            if at_s <= self.flown.time_s + 1e-9:
                self.on_their_way = None
                self.flown.vehicle.command(message)


def flying() -> Link:
    link = started(Flown("ardupilot"))
    begin(link, 200.0)
    link.run(0.5)
    link.alive()
    assert link.states[-1].standing == "in command"
    return link


def stalled(
    link: Link,
    seconds: float,
    *,
    with_time: bool = True,
    pilot: Callable[[], object] = lambda: None,
) -> None:
    """What arrives meanwhile is read after the first turn of the process.

    A serial port or a TCP connection does not say when it arrived. The pilot acts 0.6 s after
    the process stalled.
    """
    arrived = []
    for step in range(round(seconds / STEP_S)):
        link.stall(STEP_S)
        if step == 12:
            pilot()
        arrived += [(link.flown.time_s, one) for one in link.flown.telemetry()]
    link.handler.tick(link.silent_s)
    for at_s, message in arrived:
        link.handler.vehicle(message, link.flown.time_s - at_s if with_time else 0.0)
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


def flight_to(link: Link, north_m: float) -> FlyThere:
    latitude, longitude = link.flown.place(north_m, 0.0)
    return FlyThere(latitude_deg=latitude, longitude_deg=longitude, altitude_amsl_m=470.0)


def wished_until_sent(link: SlowLink, manoeuvre: Manoeuvre) -> None:
    """Repeat a wish until the motion handler takes it; it is on its way to the vehicle then."""
    before, link.on_their_way = len(link.motions), []
    while len(link.motions) == before:
        link.run(STEP_S)
        link.handler.handle_request(VehicleRequest(order_id=5, manoeuvre=manoeuvre))


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.parametrize("order", ["first", "first in our mode", "next", "take-off"])
@pytest.mark.parametrize("seconds", [0.3, 0.6, 0.95])
def test_the_target_of_before_a_command_ends_nothing_when_it_is_read_late(
    flavour: Flavour, order: str, seconds: float
) -> None:
    takeoff = order == "take-off"
    for phase in range(4):
        link = SlowLink(flown=Flown(flavour, on_ground=takeoff))
        link.run(1.5 + phase * STEP_S)
        if order == "first in our mode":
            link.flown.vehicle.set_mode(BEHAVIOURS[flavour].own_mode)
            link.run(1.0)
        if order == "next":
            begin(link, 100.0)
        else:
            mode = BEHAVIOURS[flavour].mode_name(link.flown.vehicle.mode)
            link.offered(mode, takeoff=takeoff)
            assert link.confirm().standing == "confirmed"
        if takeoff and flavour == "ardupilot":
            wished_until_sent(link, TakeMode())
            stalled(link, seconds, with_time=False)
            link.run(1.0)
        climb = TakeOff(height_m=30.0, altitude_amsl_m=460.0)
        wished_until_sent(link, climb if takeoff else flight_to(link, 160.0))
        stalled(link, seconds, with_time=False)
        for _ in range(4):
            link.run(1.0)
            link.alive()
        assert link.states[-1].standing == "in command", link.states[-1].text


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.parametrize("with_time", [True, False])
def test_a_pilot_who_flies_back_to_the_target_of_before_is_noticed_after_a_stall(
    flavour: Flavour, with_time: bool
) -> None:
    link = SlowLink(flown=Flown(flavour))
    link.run(1.5)
    begin(link, 100.0)
    before = link.motions[-1]
    wished_until_sent(link, flight_to(link, 160.0))
    stalled(link, 0.95, with_time=with_time, pilot=lambda: link.flown.vehicle.command(before))
    assert link.states[-1].text == "another program has set a target"
    link.run(2.0)
    assert len(link.motions) == 2


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.parametrize("with_time", [True, False])
@pytest.mark.parametrize("turned_s", [0.3, 1.0])
def test_a_turn_under_way_that_is_read_late_takes_no_offer_away(
    flavour: Flavour, with_time: bool, turned_s: float
) -> None:
    link = Link(flown=Flown(flavour))
    link.flown.vehicle.set_mode(BEHAVIOURS[flavour].own_mode)
    link.run(2.0)
    link.flown.change_heading(175.0)
    link.run(turned_s)
    link.offered(BEHAVIOURS[flavour].mode_name(link.flown.vehicle.mode))
    stalled(link, 0.95, with_time=with_time)
    link.run(1.0)
    assert link.confirm().standing == "confirmed"
