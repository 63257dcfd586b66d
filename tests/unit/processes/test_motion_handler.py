"""The motion handler at the link: who may move the drone, and when it lets go."""

import json
import random
from dataclasses import dataclass, field, replace
from typing import Any

import made
import pytest
from flown import Flown
from rough import Rough
from some import some
from virtual_time import follow

from uavrt.config.settings import GuidanceSettings
from uavrt.core.messages import (
    Command,
    Course,
    FlyThere,
    KeepOut,
    MotionOffer,
    MotionRequest,
    Neighbour,
    StatusText,
    TakeMode,
    TakeOff,
    TurnInPlace,
    VehicleFence,
    VehicleReport,
    VehicleRequest,
)
from uavrt.drone.processes.motions.motion_control import MotionOutputs
from uavrt.drone.processes.motions.motion_handler import MotionHandler
from uavrt.drone.processes.motions.reported_autopilot import SIMULATOR_NUMBER
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.links.address import parse_address
from uavrt.link.tunnel.own_messages.motion_messages import (
    MotionConfirmation,
    MotionState,
    MotionStop,
    decode_state,
    encode_confirmation,
    encode_request,
    encode_stop,
)
from uavrt.link.tunnel.own_messages.neighbour_messages import encode_neighbour
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt.simulation.vehicle.mission_store import MissionStore
from uavrt.simulation.vehicle.simulated_flying import MODES

US, OTHERS = (254, 190), (254, 191)
SETTINGS = GuidanceSettings(enabled=True, battery_wh=120.0, may_take_off=True)


@dataclass
class Link:
    """A motion handler between a flown vehicle and the test."""

    flown: Flown = field(default_factory=lambda: Flown("px4"))
    commands: list[Any] = field(default_factory=list)
    states: list[MotionState] = field(default_factory=list)
    asked: list[Command] = field(default_factory=list)
    records: list[Any] = field(default_factory=list)
    texts: list[StatusText] = field(default_factory=list)
    missions: MissionStore = field(default_factory=lambda: MissionStore("px4"))
    answers: list[Any] = field(default_factory=list)
    settings: GuidanceSettings = SETTINGS
    address: str = "udpin://127.0.0.1:14540"
    leaves: bool = True
    """Whether the bytes of a command do not wait for others."""
    silent_s: dict[tuple[int, int], float] = field(default_factory=lambda: {US: 0.0})

    def __post_init__(self) -> None:
        follow(lambda: self.flown.time_s)
        numbers = iter(range(1, 1000))
        self.handler = MotionHandler(
            self.settings,
            MotionOutputs(
                command=self.command,
                leaves=lambda: self.leaves,
                state=lambda payload, _: self.states.append(decode_state(payload)),
                ask=self.asked.append,
                record=lambda _, record: self.records.append(record),
                text=self.texts.append,
            ),
            own_place=lambda: (1, 191),
            next_request_id=lambda: next(numbers),
            autopilot_link=parse_address(self.address),
        )

    def command(self, message: Any) -> None:
        place, now_s = (1, 191), self.flown.time_s
        if self.missions.receive(message, place, now_s, self.answers.append):
            return
        self.commands.append(message)
        self.flown.vehicle.command(message)

    @property
    def motions(self) -> list[Any]:
        return [m for m in self.commands if m.command != dialect.MavCmd.REQUEST_MESSAGE]

    @property
    def reports(self) -> list[VehicleReport]:
        return [one for one in self.records if isinstance(one, VehicleReport)]

    @property
    def refusal(self) -> str:
        """Why the last request was refused."""
        assert self.states[-1].kind == "refused"
        return self.states[-1].text

    def pass_time(self, seconds: float) -> None:
        self.flown.time_s += seconds
        self.flown.boot_s += seconds

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.05)):
            self.stall(0.05)
            answers, self.answers = self.answers, []
            told = self.flown.through(self.flown.time_s, self.flown.telemetry())
            for message in (*told, *answers):
                self.handler.vehicle(message)
            self.handler.tick(self.silent_s)

    def alive(self) -> None:
        self.handler.handle_request(VehicleRequest(order_id=5))

    def stall(self, seconds: float) -> None:
        """The vehicle lives on; nothing is read."""
        for _ in range(round(seconds / 0.05)):
            self.flown.steps += 1
            self.pass_time(0.05)
            self.flown.vehicle.advance(0.05)

    def say(
        self, payload: bytes, requester: tuple[int, int] = US, *, sealed: bool = True
    ) -> None:
        self.handler.orders.receive(payload, requester, None, sealed=sealed)
        self.supervisor_answers()

    def supervisor_answers(self) -> None:
        for command in self.asked:
            self.handler.orders.reply(made.reply(command))
        self.asked.clear()

    def stop(self, requester: tuple[int, int] = US) -> None:
        self.say(encode_stop(MotionStop(request_id=3)), requester)

    def simulator(self, number: int = SIMULATOR_NUMBER) -> None:
        self.handler.vehicle(dialect.AutopilotVersion(uid=number, uid2=bytes(18)))

    def offered(self, mode: str = "Position", **fields: Any) -> None:
        offer = MotionOffer(
            request_id=9, requester=US, order_id=5, nonce=77, summary="hold here", mode=mode
        )
        self.handler.orders.offer(replace(offer, **fields))

    def confirm(
        self, requester: tuple[int, int] = US, nonce: int = 77, order_id: int = 5
    ) -> MotionState:
        self.say(confirmation(nonce, order_id), requester)
        return self.states[-1]

    def fly(self, north_m: float = 0.0) -> None:
        latitude, longitude = self.flown.place(north_m, 0.0)
        self.handler.handle_request(
            VehicleRequest(
                order_id=5,
                manoeuvre=FlyThere(
                    latitude_deg=latitude, longitude_deg=longitude, altitude_amsl_m=470.0
                ),
            )
        )


def confirmation(nonce: int = 77, order_id: int = 5) -> bytes:
    return encode_confirmation(
        MotionConfirmation(request_id=10, order_id=order_id, nonce=nonce, sticks_unseen=True)
    )


def started(
    flown: Flown,
    address: str = "udpin://127.0.0.1:14540",
    settings: GuidanceSettings = SETTINGS,
) -> Link:
    link = Link(flown=flown, address=address, settings=settings)
    link.run(1.5)
    return link


@pytest.fixture
def link() -> Link:
    return started(Flown("px4"))


def request(number: int = 9) -> bytes:
    return encode_request(MotionRequest(request_id=number, requester=US, action="hold"))


def test_an_unsealed_order_moves_the_simulator_alone(link: Link) -> None:
    link.say(request(), sealed=False)
    assert "sealed" in link.refusal
    assert not any(isinstance(one, MotionRequest) for one in link.records)
    link.simulator()
    link.say(request(10), sealed=False)
    assert any(isinstance(one, MotionRequest) for one in link.records)


def test_a_new_autopilot_is_no_simulator_until_it_says_so(link: Link) -> None:
    link.simulator()
    link.handler.autopilot_found()
    link.run(1.5)
    link.say(request(), sealed=False)
    assert "sealed" in link.states[-1].text


def test_an_order_that_is_repeated_on_the_way_is_offered_once(link: Link) -> None:
    link.say(request())
    link.offered()
    link.say(request())
    offers = [one for one in link.states if one.kind == "offer"]
    assert len(offers) == 2
    assert offers[0] == offers[1]
    assert sum(isinstance(one, MotionRequest) for one in link.records) == 1


def test_it_is_flown_when_confirmed_by_who_asked(link: Link) -> None:
    link.offered()
    assert link.confirm(OTHERS).kind == "refused"
    link.offered(nonce=78)
    assert link.confirm(nonce=78).standing == "confirmed"
    assert not link.motions
    link.run(0.6)
    for _ in range(12):
        if not link.motions:
            link.fly()
        link.run(0.05)
    assert link.motions[0].param2 == 1.0
    assert link.motions[0].command == dialect.MavCmd.DO_REPOSITION


def test_a_stop_makes_it_stand_and_then_nothing_is_commanded(link: Link) -> None:
    begin(link)
    link.stop(OTHERS)
    assert link.states[-1].standing == "out"
    sent = len(link.motions)
    assert link.motions[-1].param2 == 0.0
    link.fly(100.0)
    link.run(1.0)
    link.fly(100.0)
    assert len(link.motions) == sent == 2


def test_a_stop_in_the_moment_of_a_command_makes_it_stand_all_the_same(link: Link) -> None:
    begin(link)
    link.fly(200.0)
    link.stop()
    link.fly(100.0)
    link.run(1.0)
    assert link.states[-1].standing == "out"
    assert link.states[-1].text == "stopped by the operator"
    assert [m.param2 for m in link.motions] == [1.0, 0.0, 0.0]
    link.run(20.0)
    assert link.flown.vehicle.body.north_m < 60.0


def test_a_stop_between_two_orders_stops_what_the_first_one_flies(link: Link) -> None:
    begin(link)
    link.fly(200.0)
    link.run(2.0)
    link.offered("Hold", request_id=11, order_id=6, nonce=78)
    assert link.confirm(nonce=78, order_id=6).text == "confirmed"
    sent = len(link.motions)
    link.stop()
    link.run(1.0)
    assert len(link.motions) == sent + 1
    assert link.states[-1].standing == "out"
    north_m = link.flown.vehicle.body.north_m
    link.run(20.0)
    assert link.flown.vehicle.body.north_m < north_m + 10.0


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.parametrize("phase", range(10))
def test_a_stop_between_two_orders_leaves_a_return_alone(flavour: Flavour, phase: int) -> None:
    """The pilot's return has begun, and is not told yet."""
    link = started(Flown(flavour))
    link.run(0.05 * phase)
    own = link.flown.authority.behaviour.mode_name(MODES[flavour]["hold"])
    begin(link, north_m=200.0)
    link.handler.handle_request(VehicleRequest(order_id=5))
    link.offered(own, request_id=11, order_id=6, nonce=78)
    assert link.confirm(nonce=78, order_id=6).text == "confirmed"
    link.run(0.05)
    link.flown.vehicle.set_mode(MODES[flavour]["return"])
    link.pass_time(0.05)
    sent = len(link.motions)
    link.stop()
    link.run(3.0)
    assert link.states[-1].standing == "out"
    assert not any(m.param2 for m in link.motions[sent:])
    assert link.flown.vehicle.mode == MODES[flavour]["return"]


@pytest.mark.parametrize("first", ["the stop", "a turn of the process"])
def test_a_stop_after_a_stall_waits_for_what_the_pilot_did(link: Link, first: str) -> None:
    begin(link, north_m=200.0)
    if first == "a turn of the process":  # the stop waits for a command to be obeyed
        link.fly(210.0)
        link.stop()
    sent = len(link.motions)
    link.stall(0.2)
    link.flown.go_to(-100.0, -100.0)
    link.stall(0.2)
    pilots = link.flown.vehicle.target
    if first == "the stop":
        link.stop(OTHERS)
    else:
        link.handler.tick(link.silent_s)
    assert len(link.motions) == sent
    link.run(3.0)
    assert len(link.motions) == sent
    assert link.flown.vehicle.target == pilots
    assert link.states[-1].text == "another program has set a target"


def test_a_stop_that_cannot_be_commanded_says_that_it_flies_on(link: Link) -> None:
    begin(link, north_m=200.0)
    link.flown.through = Rough(random.Random(1), late_s=0.3)
    link.run(0.4)
    link.stop()
    link.run(1.0)
    assert link.states[-1].standing == "in command"
    link.run(0.6)
    assert len(link.motions) == 1
    assert link.states[-1].text == "stopped by the operator: it flies on to its last target"


@pytest.mark.parametrize("busy_s", [0.5, 3.0])
def test_a_stop_at_a_busy_port_is_none_before_it_has_left(link: Link, busy_s: float) -> None:
    begin(link, north_m=200.0)
    link.leaves = False
    link.stop()
    assert link.states[-1].standing == "in command"
    link.run(busy_s)
    link.leaves = True
    link.run(1.0)
    soon = busy_s < 1.0
    flies_on = "" if soon else ": it flies on to its last target"
    assert link.states[-1].text == f"stopped by the operator{flies_on}"
    assert len(link.motions) == (2 if soon else 1)
    link.run(20.0)
    assert (link.flown.vehicle.body.north_m < 60.0) == soon


def test_a_wish_while_the_port_is_busy_is_refused_and_moves_nothing_later(link: Link) -> None:
    begin(link)
    link.leaves = False
    link.fly(100.0)
    link.leaves = True
    link.run(1.0)
    assert len(link.motions) == 1
    assert link.handler.counters()["motion_commands_sent"] == 1
    link.fly(100.0)
    assert len(link.motions) == 2


def test_the_silence_of_who_confirmed_counts_whoever_else_is_heard(link: Link) -> None:
    def told() -> float:
        return float(some(link.reports[-1].seen).ground_silent_s)

    link.silent_s = {US: 40.0, OTHERS: 0.5}
    link.run(0.2)
    assert told() == 0.5
    link.silent_s[US] = 0.2
    begin(link)
    link.silent_s[US] = 60.5
    link.run(0.2)
    assert told() == 60.5
    del link.silent_s[US]
    link.run(0.2)
    assert told() > 1e5


@pytest.mark.parametrize(
    "address", ["udpin://0.0.0.0:14540", "udpout://10.0.0.1:14550", "serial:///dev/ttyAMA0"]
)
def test_who_is_not_on_this_computer_is_no_simulator_whatever_it_says(address: str) -> None:
    link = started(Flown("px4"), address)
    link.simulator()
    link.say(request(), sealed=False)
    assert "sealed" in link.states[-1].text
    link.handler.neighbours.receive(encode_neighbour(ELSEWHERE), US, None, sealed=False)
    assert link.handler.counters()["neighbours_refused"] == 1


def test_no_order_is_flown_over_tcp_to_another_computer() -> None:
    """What TCP repeats arrives when a pilot may have taken over."""
    link = started(Flown("px4"), "tcp://192.168.1.7:5760")
    link.say(request())
    assert link.refusal.startswith("not flown over TCP")
    assert link.states[-1].text.endswith("UDP"), "the operator reads the whole sentence"
    assert "a serial port or UDP" in str(link.reports[-1].fault)
    link.offered()
    assert link.confirm().kind == "refused"
    link.stop()
    assert [one.kind for one in link.states[-2:]] == ["refused", "state"]
    near = started(Flown("px4"), "tcp://127.0.0.1:5760")
    begin(near)


def test_the_operator_is_told_once_that_the_link_is_too_late_to_command(link: Link) -> None:
    begin(link)
    link.flown.through = Rough(random.Random(1), late_s=0.5)
    link.run(0.8)
    for _ in range(5):
        link.fly(100.0)
        link.run(0.1)
        link.alive()
    assert len(link.motions) == 1
    texts = [one.text for one in link.texts]
    assert texts.count("No command sent: the autopilot's messages arrive 0.5 s late") == 1
    link.run(1.0)
    assert link.states[-1].text == (
        "the autopilot's messages arrive 0.5 s late: no command is sent"
    )
    link.handler.handle_request(
        VehicleRequest(order_id=5, ends=True, status_text="the commands are refused")
    )
    assert link.states[-1].text == (
        "the commands are refused: the autopilot's messages arrive 0.5 s late"
    )


def test_a_channel_of_the_settings_is_not_watched() -> None:
    settings = GuidanceSettings(enabled=True, unwatched_channels=(8,))
    link = started(Flown("px4", sticks=True), settings=settings)
    link.flown.switches = (1000,) * 4
    link.run(1.0)
    begin(link)
    link.flown.switches = (1000, 1000, 1000, 1900)
    link.run(0.5)
    assert link.states[-1].standing == "in command"
    link.flown.switches = (1900, 1000, 1000, 1900)
    link.run(0.5)
    assert "RC channel 5 was switched" in link.states[-1].text


def test_a_guide_that_was_restarted_ends_the_order(link: Link) -> None:
    begin(link)
    link.handler.handle_request(VehicleRequest(order_id=None, ends=True))
    assert link.states[-1].text == "the guide process has restarted"
    assert link.texts[-1].text == "Not flying: the guide process has restarted"
    link.fly(100.0)
    assert len(link.motions) == 1


def test_a_pilots_mode_is_told_to_guide_and_ground_at_once(link: Link) -> None:
    begin(link)
    link.flown.vehicle.set_mode(3 << 16)
    link.run(0.55)
    assert (link.states[-1].standing, link.states[-1].text) == ("out", "the mode is Position")
    assert link.reports[-1].order_id is None


def test_another_autopilot_ends_the_order(link: Link) -> None:
    begin(link)
    link.handler.autopilot_found()
    assert link.states[-1].standing == "out"
    link.run(1.5)
    link.fly(100.0)
    assert len(link.motions) == 1


def test_a_process_that_stood_still_lets_go_before_anything_else(link: Link) -> None:
    begin(link)
    link.flown.time_s += 5.0
    link.fly(100.0)
    assert len(link.motions) == 1
    assert link.states[-1].text == "the drone's program paused for 5 s"


def test_what_arrived_long_ago_is_no_position_of_now(link: Link) -> None:
    begin(link)
    for _ in range(12):
        link.flown.time_s += 0.05
        link.handler.tick(link.silent_s)
    for message in link.flown.telemetry():
        link.handler.vehicle(message, 0.6)
    link.fly(100.0)
    assert len(link.motions) == 1


def test_a_stop_overtakes_a_confirmation_that_waits_for_the_supervisor(link: Link) -> None:
    link.offered()
    link.handler.orders.receive(confirmation(), US, None, sealed=True)
    link.handler.orders.receive(
        encode_stop(MotionStop(request_id=3)), OTHERS, None, sealed=True
    )
    link.supervisor_answers()
    assert link.states[-1].kind == "refused"
    link.fly(60.0)
    link.run(1.0)
    assert not link.motions


def test_a_confirmation_that_the_supervisor_kept_for_long_is_none(link: Link) -> None:
    link.offered()
    link.handler.orders.receive(confirmation(), US, None, sealed=True)
    link.run(3.0)
    link.supervisor_answers()
    assert "delayed by 3 s" in link.refusal


def test_a_reply_to_another_command_of_that_number_is_no_leave_to_fly(link: Link) -> None:
    link.offered()
    link.handler.orders.receive(confirmation(), US, None, sealed=True)
    other = replace(made.reply(link.asked[-1]), name="stop_detection")
    link.handler.orders.reply(other)
    assert all(one.standing == "out" for one in link.states)
    link.supervisor_answers()
    assert link.states[-1].standing == "confirmed"


def test_an_offer_out_of_a_mode_that_has_changed_meanwhile_is_not_made(link: Link) -> None:
    link.flown.vehicle.set_mode(4 << 16 | 5 << 24)
    link.run(1.0)
    link.offered("Position")
    assert "the flight mode has changed to Return" in link.refusal


def test_states_tell_of_which_order_they_are(link: Link) -> None:
    link.run(1.1)
    assert link.states[-1].order_id == 0
    begin(link)
    assert link.states[-1].order_id == 5
    link.stop()
    link.run(1.1)
    assert (link.states[-1].standing, link.states[-1].order_id) == ("out", 5)


@pytest.mark.parametrize(("height_m", "stands_at_m"), [(12.0, 20.0), (150.0, 120.0)])
def test_a_stop_makes_it_stand_at_a_height_where_nothing_else_is_commanded(
    link: Link, height_m: float, stands_at_m: float
) -> None:
    link.flown.vehicle.body.height_m = height_m
    link.run(0.5)
    begin(link, north_m=300.0)
    link.flown.vehicle.body.height_m = height_m
    link.stop()
    assert len(link.motions) == 2
    assert link.motions[-1].z == pytest.approx(430.0 + stands_at_m, abs=0.6)
    link.run(20.0)
    assert link.flown.vehicle.body.north_m < 100.0


@pytest.mark.parametrize("kind", [1, 7, 10, 12, 19, 22])
def test_a_vehicle_that_is_no_multirotor_is_not_flown(link: Link, kind: int) -> None:
    link.flown.kind = kind
    link.run(1.5)
    link.offered()
    assert link.states[-1].kind == "refused"
    assert "multirotor" in str(link.reports[-1].fault)


def test_an_autopilot_that_turns_out_to_be_another_is_told(link: Link) -> None:
    begin(link)
    link.flown.kind = 1
    for _ in range(6):
        link.handler.handle_request(VehicleRequest(order_id=5))
        link.run(0.2)
    assert link.texts[-1].text == "Not flying: the autopilot's type is unknown"


def test_an_autopilot_that_was_real_once_is_never_the_simulator(link: Link) -> None:
    link.simulator(number=4711)
    link.simulator()
    link.say(request(), sealed=False)
    assert "sealed" in link.states[-1].text


def test_the_simulator_is_asked_again_who_it_is_and_a_real_one_is_not(link: Link) -> None:
    def asked() -> int:
        return sum(m.command == dialect.MavCmd.REQUEST_MESSAGE for m in link.commands)

    link.simulator()
    before = asked()
    link.run(3.2)
    assert asked() > before
    link.simulator(number=4711)
    before = asked()
    link.run(6.5)
    assert asked() == before


@pytest.mark.parametrize("first", ["the request", "a sign of life"])
def test_a_wish_after_a_pause_waits_for_the_autopilots_messages(link: Link, first: str) -> None:
    begin(link)
    link.pass_time(0.4)
    if first == "a sign of life":
        link.handler.handle_request(VehicleRequest(order_id=5))
    link.fly(100.0)
    assert len(link.motions) == 1
    link.run(0.1)
    link.fly(100.0)
    assert len(link.motions) == 2


def test_what_the_battery_told_long_ago_is_not_told_to_the_guide(link: Link) -> None:
    assert some(link.reports[-1].seen).battery_percent is not None
    link.flown.status_told = False
    link.run(11.0)
    assert some(link.reports[-1].seen).battery_percent is None


def begin(link: Link, north_m: float = 60.0) -> None:
    """An order whose first command has been obeyed."""
    px4 = link.flown.flavour == "px4"
    link.offered("Position" if px4 else "Loiter")
    assert link.confirm().standing == "confirmed"
    for _ in range(12):
        if not link.motions:
            link.fly(north_m)
        link.run(0.05)
    assert len(link.motions) == 1
    link.run(1.0)
    assert link.states[-1].standing == "in command"
    link.alive()


CLIMB = VehicleRequest(order_id=5, manoeuvre=TakeOff(height_m=30.0, altitude_amsl_m=460.0))


def test_a_take_off_is_one_command_and_a_stop_after_it_is_silent() -> None:
    link = started(Flown("px4", on_ground=True))
    report = link.reports[-1]
    assert report.takeoff_fault is None
    assert "on the ground" in some(report.fault)
    link.offered("Position", summary="take off", takeoff=True)
    assert link.confirm().standing == "confirmed"
    for _ in range(20):  # until the mode was told just now
        if not link.motions:
            link.run(0.05)
            link.handler.handle_request(CLIMB)
    assert [one.command for one in link.motions] == [dialect.MavCmd.NAV_TAKEOFF]
    link.run(1.0)
    link.stop()
    before, after = link.states[-3], link.states[-1]
    assert (before.standing, after.standing) == ("in command", "out")
    assert after.text == "stopped by the operator: it continues to climb to its height"
    assert len(link.motions) == 1


def test_a_stop_before_the_take_off_itself_leaves_the_drone_on_the_ground() -> None:
    """ArduPilot was given its mode, and not told to climb yet."""
    link = started(Flown("ardupilot", on_ground=True))
    link.offered("Loiter", summary="take off", takeoff=True)
    assert link.confirm().standing == "confirmed"
    link.handler.handle_request(VehicleRequest(order_id=5, manoeuvre=TakeMode()))
    assert [one.command for one in link.motions] == [dialect.MavCmd.DO_SET_MODE]
    link.run(0.5)
    link.stop()
    assert link.states[-1].standing == "out"
    assert link.states[-1].text == "stopped by the operator"
    link.handler.handle_request(CLIMB)
    link.run(3.0)
    assert len(link.motions) == 1
    assert link.flown.vehicle.ground.landed


MEADOW = VehicleFence(
    within=(
        KeepOut(places=((47.09, 8.49), (47.09, 8.51), (47.11, 8.5)), name="vehicle's fence"),
    )
)


@pytest.mark.parametrize(
    ("items", "fault"), [(3, ""), (2, "a corner of the vehicle's fence is missing")]
)
def test_a_fence_is_told_as_read_and_to_a_restarted_guide(items: int, fault: str) -> None:
    link = Link()
    link.missions.held[1] = made.mission_items(made.fence_items(MEADOW), 1)[:items]
    link.run(3.0)
    (fence,) = (one for one in link.records if isinstance(one, VehicleFence))
    assert (fence == MEADOW) is (fault == "")
    assert fault in (fence.fault or "")
    link.handler.handle_request(VehicleRequest(order_id=None, ends=True))
    assert link.records[-1] == fence


ELSEWHERE = Neighbour(
    vehicle=2,
    version=3,
    granted=5,
    course=Course(sequence=1, place=(46.5, 8.0), altitude_amsl_m=480.0, goal=(46.51, 8.0)),
)


def test_what_is_told_of_another_drone_commands_nothing() -> None:
    """Neither in command nor out: it goes to the guide, which may only withhold by it."""
    link = Link()
    link.run(2.0)
    for standing in ("out", "confirmed", "in command"):
        if standing == "confirmed":
            link.offered()
            link.confirm()
        elif standing == "in command":
            link.fly(50.0)
            link.run(0.5)
        before = len(link.motions)
        link.handler.neighbours.receive(encode_neighbour(ELSEWHERE), US, None, sealed=True)
        link.run(0.2)
        told = [one for one in link.records if isinstance(one, Neighbour)]
        assert told[-1].granted == 5
        assert len(link.motions) == before


def test_words_on_others_that_are_not_to_be_trusted_are_counted_and_dropped() -> None:
    link = Link()
    link.run(2.0)
    payload, receive = encode_neighbour(ELSEWHERE), link.handler.neighbours.receive
    receive(payload, US, None, sealed=False)
    receive(payload, US, "may not command", sealed=True)
    receive(payload[:-1], US, None, sealed=True)
    receive(encode_neighbour(replace(ELSEWHERE, vehicle=1)), US, None, sealed=True)
    assert link.handler.counters()["neighbours_refused"] == 4
    receive(payload, US, None, sealed=True)
    receive(payload, OTHERS, None, sealed=True)  # two would give the same way
    assert link.handler.counters()["neighbours_refused"] == 5
    assert len([one for one in link.records if isinstance(one, Neighbour)]) == 1
    link.simulator()
    receive(payload, US, None, sealed=False)
    assert link.handler.counters()["neighbours_refused"] == 5


def logged(capsys: pytest.CaptureFixture[str], event: str) -> list[float | None]:
    lines = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    return [line["nearest_m"] for line in lines if line["event"] == event]


def test_the_log_says_how_near_each_leg_came(capsys: pytest.CaptureFixture[str]) -> None:
    link = started(Flown("ardupilot"))
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


def test_an_order_that_ends_says_how_far_it_was(capsys: pytest.CaptureFixture[str]) -> None:
    link = started(Flown("px4"))
    begin(link, 60.0)
    left_m = 60.0 - link.flown.vehicle.body.north_m
    link.flown.vehicle.set_mode(3 << 16)
    link.run(1.0)
    assert link.states[-1].standing == "out"
    ended = logged(capsys, "state of motion control changed")[-1]
    assert ended is not None
    assert left_m - 5.0 < ended < left_m + 1.0
