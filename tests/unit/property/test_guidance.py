"""After a takeover of any kind, at any time, the drone gets no further command from uavrt.

Random histories in virtual time: a simulated PX4 or ArduCopter, an order of any kind, and at a
random time a pilot, a second ground station or a fault that ends the order. Two of five
histories include the motion handler and a link that delivers telemetry late, out of order,
twice or not at all, and an operator who presses stop. ``UAVRT_HISTORIES=10000`` sets the
number of histories.
"""

import os
import random
from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest
from flown import CENTRED, HOME, STEP_S, Flown, nonce_of
from motion_handled import MotionHandled
from rough import Rough
from searched import Animal, Searched

from uavrt.core.errors import CommandRefused
from uavrt.core.messages import FlyThere, VehicleRequest
from uavrt.guidance.control.authority import ControlStage
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.simulated_flying import MODES
from uavrt.simulation.vehicle.vehicle_telemetry import target_message

HISTORIES = int(os.environ.get("UAVRT_HISTORIES", "200"))
ROUGH = 2 * HISTORIES // 5
"""Of these, so many; each kind of event has its turn: 60 histories of 17 kinds, 40 of 18."""
AFTERWARDS_S = 3.0

Event = Callable[[Flown, random.Random], None]


def other_mode(flown: Flown, rng: random.Random) -> None:
    names = MODES[flown.flavour]
    ours = (names["hold"], names.get("takeoff"), flown.vehicle.mode)
    flown.vehicle.set_mode(rng.choice([m for m in names.values() if m not in ours]))


def sticks(flown: Flown, rng: random.Random) -> None:
    channels = list(flown.channels)
    channels[rng.randrange(4)] += rng.choice((-1, 1)) * rng.randint(65, 400)
    flown.channels = tuple(channels)


def switch(flown: Flown, rng: random.Random) -> None:
    switches = list(flown.switches)
    switches[rng.randrange(len(switches))] += rng.choice((-500, 500, 1000))
    flown.switches = tuple(switches)


def remote_switched_on(flown: Flown, rng: random.Random) -> None:
    flown.channels = CENTRED


def remote_lost(flown: Flown, rng: random.Random) -> None:
    flown.channels = ()


def failsafe(flown: Flown, rng: random.Random) -> None:
    flown.failsafe = rng.choice(("heartbeat", "fence", "battery"))


def restart(flown: Flown, rng: random.Random) -> None:
    flown.boot_s = 0.0


def no_position(flown: Flown, rng: random.Random) -> None:
    flown.position = False


def no_mode(flown: Flown, rng: random.Random) -> None:
    flown.mode_told = False


def home_moved(flown: Flown, rng: random.Random) -> None:
    flown.home_north_m = rng.choice((-1, 1)) * rng.uniform(3.0, 300.0)


def height_jump(flown: Flown, rng: random.Random) -> None:
    flown.jump_m = rng.choice((-1, 1)) * rng.uniform(6.0, 20.0)


def disarmed(flown: Flown, rng: random.Random) -> None:
    flown.vehicle.armed = False


def guide_dies(flown: Flown, rng: random.Random) -> None:
    flown.alive = False


EVENTS: dict[str, tuple[Event, float, float]] = {
    # What happens; how long until the vehicle shows it: PX4, ArduPilot [s].
    "pause": (lambda f, r: f.pause(), 0.1, 0.1),
    "go to": (lambda f, r: f.go_to(r.uniform(-200, 200), r.uniform(-200, 200)), 0.1, 0.1),
    "height": (lambda f, r: f.change_height(r.choice((-8.0, 5.0, 9.0))), 0.1, 0.1),
    # ArduPilot shows no heading asked for: 25° at 40°/s, and what is free at first.
    "heading": (
        lambda f, r: f.change_heading(r.choice((-1, 1)) * r.uniform(45, 170)),
        0.1,
        1.0,
    ),
    "mode": (other_mode, 0.5, 0.1),
    "sticks": (sticks, 0.2, 0.2),
    "switch": (switch, 0.2, 0.2),
    "remote on": (remote_switched_on, 0.2, 0.2),
    "remote lost": (remote_lost, 1.75, 1.75),
    "failsafe": (failsafe, 1.0, 0.5),
    "restart": (restart, 0.1, 0.1),
    "no position": (no_position, 0.1, 0.1),
    "no mode": (no_mode, 3.1, 3.1),
    "home moved": (home_moved, 1.0, 1.0),
    "height jump": (height_jump, 0.1, 0.1),
    "disarmed": (disarmed, 1.0, 0.1),
    "guide dies": (guide_dies, 2.1, 2.1),
}
SAME_PLACE = ("pause", "heading")
"""By PX4 the drone is told to stay where it is: if that is the target that we gave, to 5 cm in
all three directions, nothing that it tells is different."""
TAKEN_BACK = ("pause", "go to", "height", "heading", "mode")
"""What a command of ours undoes, when it is on its way already."""
NEED_STICKS = ("sticks", "switch", "remote lost")
NEED_NO_STICKS = ("remote on",)
ORDERS = ("rotate", "rotate", "goto", "survey", "takeoff")
ROUGH_ORDERS = (*ORDERS, *ORDERS, "search")
LOST_S = 1.5
"""What shows it may be lost three times in a row; PX4 tells its mode every half second."""
SWITCHES = (1000, 1500, 1000, 1000)


def searching(
    rng: random.Random, flavour: Flavour, make: Callable[..., Flown], with_sticks: bool
) -> Flown:
    """A drone that has been searching for some seconds."""
    search = Searched(
        flavour,
        [Animal(rng.uniform(-150, 150), rng.uniform(60, 200))],
        seed=rng.randrange(1000),
        frame=Frame(battery_wh=160.0, gust_m=rng.uniform(0.2, 0.6)),
        make=lambda *given, **values: make(
            *given, sticks=with_sticks, phase_s=rng.uniform(0.0, 100.0), **values
        ),
    )
    flown = search.flown
    flown.switches = SWITCHES
    flown.run(0.5)
    search.begin()
    flown.each_step = search.live
    return flown


def begin(
    rng: random.Random,
    flavour: Flavour,
    event: str,
    orders: tuple[str, ...] = ORDERS,
    make: Callable[..., Flown] = Flown,
) -> Flown:
    """A drone somewhere in an order; sometimes the first command has not been sent yet."""
    with_sticks = event in NEED_STICKS or (event not in NEED_NO_STICKS and rng.random() < 0.5)
    action = rng.choice(orders)
    if action == "search":
        flown = searching(rng, flavour, make, with_sticks)
        flown.run(rng.uniform(0.0, 8.0))
        return flown
    flown = make(
        flavour,
        on_ground=action == "takeoff",
        sticks=with_sticks,
        frame=Frame(gust_m=rng.uniform(0.2, 0.6)),
        phase_s=rng.uniform(0.0, 100.0),
    )
    flown.switches = SWITCHES
    flown.run(0.5)
    corners = ((40, 10), (45, 60), (80, 55), (85, 5))
    places = {
        "goto": (flown.place(rng.uniform(30, 150), rng.uniform(-150, 150)),),
        "survey": tuple(flown.place(*corner) for corner in corners),
    }
    flown.order(
        action,
        places=places.get(action, ()),
        duration_s=rng.uniform(9.0, 40.0),
        clockwise=rng.random() < 0.5,
        spacing_m=20.0,
        height_m=None if action == "rotate" else rng.uniform(25.0, 60.0),
    )
    waits = rng.random() < 0.15
    execution, flown.execution = flown.execution, None if waits else flown.execution
    shown_by_turning = flavour == "ardupilot" and event == "heading"
    flown.run(4.5 if shown_by_turning else rng.choice((0.1, 0.4, 1.0, 3.0, 6.0)) * rng.random())
    if waits and not shown_by_turning:
        flown.run(rng.uniform(0.0, 3.0))
    flown.execution = execution
    if waits and shown_by_turning:
        flown.run(4.5)
    return flown


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.timeout(1800)
def test_after_a_takeover_not_one_more_command_leaves(flavour: Flavour) -> None:
    alike = crossings = 0
    happened: Counter[str] = Counter()
    for seed in range((HISTORIES - ROUGH) // 2):
        rng = random.Random(seed)
        name = list(EVENTS)[seed % len(EVENTS)]
        event, *shown_s = EVENTS[name]
        flown = begin(rng, flavour, name)
        if is_out(flown):
            pytest.fail(f"{seed}: out by itself: {flown.authority.reason}")
        happened[name] += 1
        order_id = flown.authority.order_id
        for _ in range(8):
            before = target_message(flown.vehicle, 0)
            event(flown, rng)
            same = flavour == "px4" and name in SAME_PLACE
            same = same and same_to_5_cm(before, target_message(flown.vehicle, 0))
            undone = same or name in TAKEN_BACK
            again = watch(flown, shown_s[flavour == "ardupilot"], undone=undone, same=same)
            if not again and (is_out(flown) or not same):
                break
            # Undone before any message showed it, or no message differs: the pilot repeats it.
            alike, crossings = alike + same, crossings + (not same)
            flown.run(rng.uniform(0.0, 1.0))
        story = f"{seed} {name} {flown.execution and flown.execution.order.action}"
        sent = len(flown.commands)
        flown.run(15.0)  # a turn of ours that stops too early
        assert is_out(flown), story
        assert len(flown.commands) == sent, story
        assert_nothing_brings_it_back(flown, order_id)
    print(f"{flavour}: {happened}, {crossings} crossed, {alike} within 5 cm")
    assert len(happened) == len(EVENTS)
    assert crossings <= 0.05 * happened.total()
    assert alike <= 0.15 * sum(happened[name] for name in SAME_PLACE)


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.timeout(1800)
def test_nor_through_the_motion_handler_over_a_rough_link(flavour: Flavour) -> None:
    crossings = alone = commanded = 0
    happened: Counter[str] = Counter()
    for seed in range(ROUGH // 2):
        rng = random.Random(f"rough {seed}")
        name = [*EVENTS, "stop"][seed % (len(EVENTS) + 1)]
        flown = begin(rng, flavour, name, ROUGH_ORDERS, MotionHandled)
        assert isinstance(flown, MotionHandled)
        order_id = flown.authority.order_id
        slack_s = roughen(flown, rng)
        flown.run(rng.uniform(0.0, 4.0))
        happened[name] += 1
        stop_s = rng.uniform(-0.4, 0.4) if name == "stop" or rng.random() < 0.2 else None
        if is_out(flown):  # what was overtaken on its way may end an order, too
            alone += 1
        else:
            crossings += take_over(flown, rng, name, stop_s, slack_s)
        story = f"{seed} {name} {flown.execution and flown.execution.order.action}"
        commanded += bool(flown.commands)
        sent = len(flown.commands)
        flown.run(15.0)
        assert is_out(flown), story
        assert len(flown.commands) == sent, story
        assert not flown.sent_when_out, story
        assert_only_the_first_changes_the_mode(flown)
        assert_the_motion_handler_is_not_brought_back(flown, order_id)
    print(f"{flavour}: {happened}, {crossings} crossed, {alone} out before, {commanded} flew")
    assert len(happened) == len(EVENTS) + 1
    assert crossings <= 0.1 * happened.total()
    assert alone <= 0.1 * happened.total()
    assert commanded >= 0.7 * happened.total()


def roughen(flown: Flown, rng: random.Random) -> float:
    """Let its link be rough from now on; give by how much later anything may be seen [s]."""
    late_s = rng.choice((0.0, rng.uniform(0.0, 0.2), rng.uniform(0.2, 0.4)))
    jitter_s = rng.choice((0.0, 0.05, 0.4 - late_s))
    loss = rng.choice((0.0, 0.15))
    flown.through = Rough(
        rng, late_s=late_s, jitter_s=jitter_s, loss=loss, doubled=rng.choice((0.0, 0.1))
    )
    return late_s + jitter_s + (LOST_S if loss else 0.0)


def take_over(
    flown: MotionHandled,
    rng: random.Random,
    name: str,
    stop_s: float | None,
    slack_s: float,
) -> int:
    """Let it happen, with a stop so long after it; give how often ours undid it."""
    crossings = 0
    for _ in range(8):
        before = target_message(flown.vehicle, 0)
        if stop_s is not None and stop_s < 0.0:
            flown.stop()
            flown.run(-stop_s)
        shown_s = 1.5
        if name != "stop":
            event, *shown = EVENTS[name]
            event(flown, rng)
            shown_s = shown[flown.flavour == "ardupilot"]
        if stop_s is not None and stop_s >= 0.0:
            at_s = flown.time_s + stop_s
            flown.each_step = once(flown, at_s, flown.each_step)
        same = flown.flavour == "px4" and name in SAME_PLACE
        same = same and same_to_5_cm(before, target_message(flown.vehicle, 0))
        undone = same or name in TAKEN_BACK
        again = watch(flown, shown_s + slack_s, undone=undone, same=same)
        if not again and (is_out(flown) or not same):
            break
        crossings += not same
        flown.run(rng.uniform(0.0, 1.0))
    return crossings


def once(flown: MotionHandled, at_s: float, before: Callable[[], None]) -> Callable[[], None]:
    """Stop it at a time, and else do as before."""

    def each_step() -> None:
        before()
        if flown.time_s >= at_s:
            flown.each_step = before
            flown.stop()

    return each_step


def assert_only_the_first_changes_the_mode(flown: MotionHandled) -> None:
    repositions = [m for _, m in flown.commands if m.command == 192]
    assert not any(m.param2 for m in repositions[1:])
    assert not any(m.param2 for m in flown.stop_commands if m.command == 192)


def assert_the_motion_handler_is_not_brought_back(
    flown: MotionHandled, order_id: int | None
) -> None:
    """Neither by the wish that was on its way, nor by the old confirmation or offer."""
    assert order_id is not None
    sent = len(flown.commands)
    latitude, longitude = flown.place(50.0, 50.0)
    flown.handler.handle_request(
        VehicleRequest(
            order_id=order_id,
            manoeuvre=FlyThere(
                latitude_deg=latitude,
                longitude_deg=longitude,
                altitude_amsl_m=HOME.altitude_amsl_m + 40,
            ),
        )
    )
    flown.say_yes(order_id)
    assert flown.states[-1].kind == "refused"
    flown.offer(order_id)
    assert flown.states[-1].kind == "refused"
    assert len(flown.commands) == sent


def is_out(flown: Flown) -> bool:
    return flown.authority.standing is ControlStage.OUT


def watch(flown: Flown, shown_s: float, *, undone: bool, same: bool) -> bool:
    """Fly on; whether a command left before anything showed the event, and has undone it.

    None may leave later: neither after the message that shows it nor after its time.
    """
    sent, silent_s = len(flown.commands), flown.time_s + shown_s + STEP_S
    when_out: int | None = None
    while flown.time_s < silent_s + AFTERWARDS_S:
        flown.step()
        standing = flown.authority.standing
        if standing is ControlStage.OUT and when_out is None:
            when_out = len(flown.commands)
        if len(flown.commands) > sent:
            assert same or flown.time_s <= silent_s
            assert when_out in (None, len(flown.commands))
            if undone:
                return True
            sent = len(flown.commands)
    return False


def same_to_5_cm(before: Any, after: Any) -> bool:
    if before is None or after is None:
        return False
    north = 111_200.0 * (before.lat_int - after.lat_int) / 1e7
    east = 75_700.0 * (before.lon_int - after.lon_int) / 1e7
    up = before.alt - after.alt
    return bool(max(north * north + east * east, up * up) <= 0.0025)


def assert_nothing_brings_it_back(flown: Flown, order_id: int | None) -> None:
    """Neither the wish that was on its way, nor the old confirmation."""
    latitude, longitude = flown.place(50.0, 50.0)
    manoeuvre = FlyThere(
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl_m=HOME.altitude_amsl_m + 40,
    )
    assert order_id is not None
    with pytest.raises(CommandRefused):
        flown.authority.command(order_id, manoeuvre, flown.time_s)
    nonce = nonce_of(order_id)
    with pytest.raises(CommandRefused):
        flown.authority.confirm(order_id, nonce, flown.time_s, sticks_unseen=True)
    with pytest.raises(CommandRefused):
        flown.authority.offer(order_id, nonce, flown.time_s)


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_only_the_first_command_of_an_order_may_change_the_mode(flavour: Flavour) -> None:
    for seed in range(20):
        flown = begin(random.Random(seed), flavour, "mode", ORDERS[:-1])
        flown.run(20.0)
        repositions = [m.param2 for _, m in flown.commands if m.command == 192]
        assert repositions[0] == 1.0
        assert not any(repositions[1:])
        assert all(m.command in (192, 115, 20) for _, m in flown.commands)


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_a_command_that_is_lost_is_not_repeated(flavour: Flavour) -> None:
    lost = 0
    for seed in range(30):
        flown = Flown(flavour, loss=0.3, seed=seed)
        flown.order("rotate", duration_s=12.0)
        flown.run(20.0)
        lost += flown.lost
        changing = [m for _, m in flown.commands if m.command == 192 and m.param2 == 1.0]
        assert len(changing) == 1
        if flown.lost:
            assert flown.authority.standing is ControlStage.OUT
            assert flown.lost == 1
    assert lost > 5
