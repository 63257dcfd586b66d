"""What takes an offer away, what must be seen first, and what silence ends an order."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import pytest
from flown import HOME, Flown

from uavrt.core.errors import CommandRefused
from uavrt.core.messages import FlyThere, GoHome
from uavrt.guidance.autopilot_behaviour import BEHAVIOURS
from uavrt.guidance.control.authority import Authority, ControlStage
from uavrt.guidance.control.vehicle_commands import CommandWriter
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.simulated_flying import MODES

BOTH = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])


def manoeuvre(flown: Flown, north_m: float = 60.0) -> FlyThere:
    latitude, longitude = flown.place(north_m, 0.0)
    return FlyThere(
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl_m=HOME.altitude_amsl_m + 40.0,
    )


def stop(flown: Flown) -> None:
    flown.authority.stop(flown.time_s)


def disarm(flown: Flown) -> None:
    flown.vehicle.armed = False
    flown.run(1.1)
    flown.vehicle.armed = True


def move_home(flown: Flown) -> None:
    flown.home_north_m = 10.0


def lose_position(flown: Flown) -> None:
    flown.position = False
    flown.run(0.2)
    flown.position = True


def give_target(flown: Flown) -> None:
    flown.go_to(100.0, 0.0)


def turn_and_back(flown: Flown, by_deg: float) -> None:
    """Where it stands nothing else differs: not the mode, and the target is the same place."""
    flown.change_heading(by_deg)
    flown.run(1.0)
    flown.change_heading(-by_deg)
    flown.run(2.0)


def fly_and_return_the_mode(flown: Flown) -> None:
    before = flown.vehicle.mode
    flown.vehicle.set_mode(MODES[flown.flavour]["hold"])
    flown.run(1.2)
    flown.vehicle.set_mode(before)


def change_mode(flown: Flown) -> None:
    flown.vehicle.set_mode(MODES[flown.flavour]["return"])


def at_rest(flavour: Flavour) -> Flown:
    """One that holds in our own mode, by nobody's order."""
    flown = Flown(flavour, frame=Frame(gust_m=0.0))
    flown.vehicle.set_mode(MODES[flavour]["hold"])
    flown.run(1.2)
    return flown


@BOTH
@pytest.mark.parametrize(
    ("begin", "objection", "status_text"),
    [
        *(
            (Flown, one, "not the proposed one")
            for one in (stop, disarm, move_home, lose_position)
        ),
        (Flown, fly_and_return_the_mode, "the mode has changed"),
        (Flown, change_mode, "the mode has changed to R"),
        (at_rest, give_target, "another program has set a target"),
        (at_rest, partial(turn_and_back, by_deg=-120.0), "another program turns the drone"),
        (at_rest, partial(turn_and_back, by_deg=40.0), "another program turns the drone"),
    ],
)
def test_what_would_end_an_order_takes_away_one_that_is_only_offered(
    flavour: Flavour,
    begin: Callable[[Flavour], Flown],
    objection: Callable[[Flown], None],
    status_text: str,
) -> None:
    flown = begin(flavour)
    flown.authority.offer(1, 77, flown.time_s)
    objection(flown)
    flown.run(1.2)
    with pytest.raises(CommandRefused, match=status_text):
        flown.authority.confirm(1, 77, flown.time_s, sticks_unseen=True)


def untold_target(flavour: Flavour) -> Flown:
    """One in our own mode of which no target is known yet."""
    flown = Flown(flavour)
    flown.vehicle.set_mode(MODES[flavour]["hold"])
    flown.run(1.2)
    flown.authority = Authority(CommandWriter(behaviour=BEHAVIOURS[flavour]))
    flown.target_told = False
    flown.run(1.2)
    return flown


@BOTH
@pytest.mark.parametrize("when", ["offered", "confirmed"])
def test_the_first_target_that_another_gives_is_anothers_too(
    flavour: Flavour, when: str
) -> None:
    """Guided tells no target before there is one."""
    flown = untold_target(flavour)
    flown.authority.offer(1, 77, flown.time_s)
    if when == "confirmed":
        flown.authority.confirm(1, 77, flown.time_s, sticks_unseen=True)
    flown.target_told = True
    flown.go_to(100.0, 0.0)
    flown.run(0.3)
    flown.authority.planner_alive(flown.time_s)
    if when == "offered":
        with pytest.raises(CommandRefused, match="another program has set a target"):
            flown.authority.confirm(1, 77, flown.time_s, sticks_unseen=True)
    assert flown.authority.standing is ControlStage.OUT
    with pytest.raises(CommandRefused):
        flown.authority.command(1, manoeuvre(flown), flown.time_s)


@BOTH
@pytest.mark.parametrize("by_deg", [-120.0, 40.0])
def test_who_turns_it_before_the_first_command_has_taken_it(
    flavour: Flavour, by_deg: float
) -> None:
    flown = at_rest(flavour)
    flown.authority.offer(1, 77, flown.time_s)
    flown.authority.confirm(1, 77, flown.time_s, sticks_unseen=True)
    flown.change_heading(by_deg)
    flown.run(1.0)
    assert flown.authority.reason == "another program turns the drone"
    with pytest.raises(CommandRefused):
        flown.authority.command(1, manoeuvre(flown), flown.time_s)


def turn(flown: Flown) -> None:
    flown.change_heading(-120.0)


def push_down(flown: Flown) -> None:
    """By a hand that is not seen: the target stays."""
    flown.vehicle.body.height_m -= 4.0
    flown.run(0.5)
    flown.vehicle.body.height_m -= 4.0


@BOTH
@pytest.mark.parametrize("takeover", [turn, push_down])
def test_what_is_flown_between_two_orders_is_watched_until_the_second_begins(
    flavour: Flavour, takeover: Callable[[Flown], None]
) -> None:
    flown = Flown(flavour, frame=Frame(gust_m=0.0))
    flown.order("goto", places=(flown.place(60.0, 0.0),), height_m=40.0)
    flown.run(2.0)
    flown.execution = None
    flown.run(30.0, until=lambda: flown.vehicle.body.north_m > 59.9)
    flown.authority.offer(7, 77, flown.time_s)
    flown.authority.confirm(7, 77, flown.time_s, sticks_unseen=True)
    flown.run(0.5)
    assert not flown.authority.reason
    takeover(flown)
    flown.run(1.0)
    assert flown.authority.reason
    with pytest.raises(CommandRefused):
        flown.authority.command(7, manoeuvre(flown), flown.time_s)


@BOTH
def test_a_heading_that_a_gust_pushes_is_nobodys_order(flavour: Flavour) -> None:
    flown = at_rest(flavour)
    flown.authority.offer(1, 77, flown.time_s)
    flown.vehicle.heading.yaw_deg += 12.0
    flown.run(1.0)
    flown.authority.confirm(1, 77, flown.time_s, sticks_unseen=True)
    flown.vehicle.heading.yaw_deg -= 20.0
    flown.run(1.0)
    assert flown.authority.standing is ControlStage.CONFIRMED


@BOTH
def test_where_it_holds_as_its_first_target_is_nobodys_order(flavour: Flavour) -> None:
    flown = untold_target(flavour)
    flown.authority.offer(1, 77, flown.time_s)
    flown.target_told = True
    flown.run(1.0)
    flown.authority.confirm(1, 77, flown.time_s, sticks_unseen=True)
    assert flown.authority.standing is ControlStage.CONFIRMED


@BOTH
def test_a_stick_held_since_the_offer_is_a_hand_and_no_new_rest(flavour: Flavour) -> None:
    flown = Flown(flavour, sticks=True)
    flown.authority.offer(1, 77, flown.time_s)
    flown.channels = (1900, *flown.channels[1:])
    flown.run(0.5)
    with pytest.raises(CommandRefused, match="the sticks were moved"):
        flown.authority.confirm(1, 77, flown.time_s)
    flown.authority.offer(1, 78, flown.time_s)
    flown.authority.confirm(1, 78, flown.time_s)


@BOTH
def test_a_drone_that_stays_where_it_was_told_to_may_be_confirmed_again(
    flavour: Flavour,
) -> None:
    flown = Flown(flavour)
    execution = flown.order("goto", places=(flown.place(60.0, 0.0),), height_m=40.0)
    flown.run(60.0, until=lambda: execution.ended is not None)
    flown.run(1.0)
    flown.order("hold")
    assert flown.authority.standing is ControlStage.CONFIRMED


@BOTH
def test_nothing_is_offered_while_the_autopilot_says_that_it_is_critical(
    flavour: Flavour,
) -> None:
    flown = Flown(flavour)
    flown.failsafe = "heartbeat"
    flown.run(1.1)
    with pytest.raises(CommandRefused, match="a failsafe: critical state"):
        flown.authority.offer(1, 77, flown.time_s)
    flown.failsafe = ""
    flown.run(4.5)
    flown.authority.offer(2, 78, flown.time_s)


def test_a_return_changes_the_mode_and_needs_one_that_was_seen_just_now() -> None:
    flown = Flown("px4")
    execution = flown.order("goto", places=(flown.place(200.0, 0.0),), height_m=40.0)
    flown.run(6.0)
    flown.run(1.0, until=lambda: flown.steps % 20 == 12)  # told at 0, 5 and 15
    with pytest.raises(CommandRefused, match="mode was not reported recently"):
        flown.authority.command(execution.order.order_id, GoHome(), flown.time_s)
    flown.run(1.0, until=lambda: flown.steps % 20 == 16)
    command = flown.authority.command(execution.order.order_id, GoHome(), flown.time_s)
    assert command.name == "NAV_RETURN_TO_LAUNCH"


@BOTH
def test_an_order_ends_when_the_target_is_not_told_any_more(flavour: Flavour) -> None:
    flown = Flown(flavour)
    flown.order("goto", places=(flown.place(200.0, 0.0),), height_m=40.0)
    flown.run(4.0)
    flown.target_told = False
    lost_s = BEHAVIOURS[flavour].target_lost_s
    flown.run(lost_s - 0.2)
    assert flown.authority.standing is ControlStage.IN_COMMAND
    flown.run(0.4)
    assert flown.authority.reason == "the target is no longer reported"


def test_no_command_leaves_on_a_target_that_is_not_told_any_more() -> None:
    flown = Flown("px4")
    execution = flown.order("goto", places=(flown.place(200.0, 0.0),), height_m=40.0)
    flown.run(4.0)
    flown.target_told = False
    flown.run(0.4)
    with pytest.raises(CommandRefused, match=r"target report is older than 0\.3 s"):
        flown.authority.command(execution.order.order_id, manoeuvre(flown), flown.time_s)


def test_an_order_ends_when_only_the_mode_is_told_and_no_heartbeat_comes() -> None:
    flown = Flown("px4")
    flown.order("goto", places=(flown.place(200.0, 0.0),), height_m=40.0)
    flown.run(4.0)
    flown.heartbeat_told = False
    flown.run(6.1)
    assert flown.authority.reason == "no heartbeat of the autopilot"


@BOTH
@pytest.mark.parametrize("jump_m", [-12.0, 12.0])
def test_a_jump_of_the_height_is_seen_across_a_gap_too(flavour: Flavour, jump_m: float) -> None:
    flown = Flown(flavour)
    flown.order("hold")
    flown.execution = None
    flown.position_told = False
    flown.run(1.5)
    assert flown.authority.standing is ControlStage.CONFIRMED
    flown.position_told, flown.jump_m = True, jump_m
    flown.run(0.1)
    assert flown.authority.reason == f"the height jumped by {jump_m:+.0f} m"


@BOTH
def test_it_returns_when_the_battery_is_not_told_any_more(flavour: Flavour) -> None:
    flown = Flown(flavour)
    execution = flown.order("goto", places=(flown.place(300.0, 0.0),), height_m=40.0)
    flown.run(6.0)
    flown.status_told = False
    flown.run(5.0)
    assert execution.status_text == "returning: the battery is no longer reported"
    assert flown.vehicle.mode == MODES[flavour]["return"]


@BOTH
def test_it_holds_within_its_heights_where_the_ground_is_lost_above_them(
    flavour: Flavour,
) -> None:
    flown = Flown(flavour)
    flown.vehicle.body.height_m = 160.0
    flown.run(0.5)
    flown.order("goto", places=(flown.place(300.0, 0.0),), height_m=100.0)
    flown.run(5.0)
    assert flown.vehicle.body.height_m > 130.0
    flown.ground_silent_s = 6.0
    flown.run(20.0)
    assert flown.authority.standing is ControlStage.IN_COMMAND
    assert flown.vehicle.body.north_m < 150.0
    assert flown.vehicle.body.height_m == pytest.approx(120.0, abs=1.0)


def test_refusals_count_until_a_command_is_taken() -> None:
    flown = Flown("px4")
    execution = flown.order("rotate", duration_s=12.0)
    flown.execution = None
    for turn in range(3):
        for refused in range(45):
            now = flown.now()
            assert now is not None
            execution.next(
                replace(now, requests_sent=turn, requests_refused=45 * turn + refused)
            )
            assert execution.ended is None


@pytest.mark.parametrize("longitude_deg", [368.5, -351.5, 1e9])
def test_a_longitude_beyond_the_globe_is_no_place(longitude_deg: float) -> None:
    flown = Flown("px4")
    execution = flown.order("hold")
    flown.execution = None
    flown.run(1.0, until=lambda: flown.steps % 20 == 6)
    place = FlyThere(
        latitude_deg=HOME.latitude_deg,
        longitude_deg=longitude_deg,
        altitude_amsl_m=HOME.altitude_amsl_m + 40.0,
    )
    with pytest.raises(CommandRefused, match="is not a position"):
        flown.authority.command(execution.order.order_id, place, flown.time_s)


@BOTH
def test_home_cannot_creep_away_by_steps_that_are_small_each(flavour: Flavour) -> None:
    flown = Flown(flavour)
    flown.order("rotate", duration_s=60.0)
    for _ in range(2):
        flown.run(1.0)
        assert flown.authority.standing is not ControlStage.OUT
        flown.home_north_m += 1.9
    flown.run(1.1)
    assert flown.authority.reason == "home was moved"


@BOTH
def test_heights_stay_those_of_the_confirmation_when_home_is_corrected(
    flavour: Flavour,
) -> None:
    """PX4 corrects the altitude of home in flight; the altitude of the drone stays."""
    flown = Flown(flavour)
    execution = flown.order("goto", places=(flown.place(60.0, 0.0),), height_m=50.0)
    flown.run(2.0)
    for _ in range(8):
        flown.home_up_m += 1.1
        flown.run(0.3)
    flown.run(60.0, until=lambda: execution.ended is not None)
    assert execution.ended == "done"
    assert flown.vehicle.body.height_m == pytest.approx(50.0, abs=0.5)


@BOTH
def test_an_altitude_that_creeps_away_by_small_jumps_ends_the_order(flavour: Flavour) -> None:
    """The height above home stays: its estimate has moved, and home with it."""
    flown = Flown(flavour)
    flown.order("rotate", duration_s=60.0)
    flown.run(1.0)
    for _ in range(3):
        flown.jump_m += 0.8
        flown.home_up_m += 0.8
        flown.run(0.2)
    assert flown.authority.reason == "the altitude jumped by +2 m"


@BOTH
def test_home_that_crept_before_the_confirmation_is_home(flavour: Flavour) -> None:
    flown = Flown(flavour)
    for _ in range(3):
        flown.home_north_m += 1.9
        flown.run(1.0)
    flown.order("rotate", duration_s=60.0)
    flown.run(3.0)
    assert flown.authority.standing is ControlStage.IN_COMMAND


@BOTH
def test_the_operator_has_ten_seconds_to_confirm(flavour: Flavour) -> None:
    flown = Flown(flavour)
    flown.authority.offer(1, 77, flown.time_s)
    flown.run(10.2)
    with pytest.raises(CommandRefused, match="confirm within 10 s"):
        flown.authority.confirm(1, 77, flown.time_s, sticks_unseen=True)
    flown.authority.offer(2, 78, flown.time_s)
    flown.run(9.9)
    flown.authority.confirm(2, 78, flown.time_s, sticks_unseen=True)


def test_whether_a_restarted_autopilot_is_armed_counts_from_its_next_heartbeat() -> None:
    flown = Flown("px4")
    assert flown.authority.fault(flown.time_s) is None
    flown.boot_s, flown.heartbeat_told = 1.0, False
    flown.run(1.2)
    fault = flown.authority.fault(flown.time_s)
    assert fault is not None
    assert fault[0] == "no heartbeat of the autopilot"
    flown.heartbeat_told = True
    flown.run(1.2)
    assert flown.authority.fault(flown.time_s) is None
