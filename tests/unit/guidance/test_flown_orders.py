"""Orders flown to their end, and ended, by both autopilots' manners in virtual time."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from flown import HOME, STEP_S, Flown
from some import some

from uavrt.core.errors import CommandRefused, PlanError
from uavrt.core.messages import TurnInPlace
from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.height_frames import target_amsl_m
from uavrt.guidance.operator_orders import Limits
from uavrt.guidance.plans import Go
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.simulated_flying import MODES, FlyingVehicle

BOTH = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
FIELD = ((50, 0), (50, 150), (150, 150), (150, 0))


def flown_to_its_end(flown: Flown, action: str, **values: Any) -> str | None:
    execution = flown.order(action, **values)
    flown.run(400.0, until=lambda: execution.ended is not None)
    return execution.ended


@BOTH
def test_goes_there_at_the_height_above_home_that_was_asked_for(flavour: Flavour) -> None:
    flown = Flown(flavour)
    assert (
        flown_to_its_end(flown, "goto", places=(flown.place(120, 80),), height_m=55.0) == "done"
    )
    vehicle = flown.vehicle
    assert math.hypot(vehicle.body.north_m - 120, vehicle.body.east_m - 80) < 3.0
    assert vehicle.body.height_m == pytest.approx(55.0, abs=2.0)
    assert flown.commands[0][1].z == pytest.approx(HOME.altitude_amsl_m + 55.0, abs=0.01)
    assert flown.authority.reason == "done"


@BOTH
@pytest.mark.parametrize("clockwise", [True, False])
def test_turns_once_in_place_to_the_side_asked_for(flavour: Flavour, clockwise: bool) -> None:
    flown = Flown(flavour)
    turned, before = 0.0, flown.vehicle.heading.yaw_deg
    execution = flown.order("rotate", duration_s=24.0, clockwise=clockwise)
    while execution.ended is None:
        flown.step()
        step = (flown.vehicle.heading.yaw_deg - before + 180.0) % 360.0 - 180.0
        turned, before = turned + step, flown.vehicle.heading.yaw_deg
    assert execution.ended == "done"
    least = 325.0 if flavour == "px4" else 350.0
    assert least <= (turned if clockwise else -turned) <= 361.0
    assert math.hypot(flown.vehicle.body.north_m, flown.vehicle.body.east_m) < 1.0
    assert len(flown.commands) == (12 if flavour == "px4" else 2)


@BOTH
def test_surveys_the_lines_of_an_area(flavour: Flavour) -> None:
    flown = Flown(flavour)
    places = tuple(flown.place(*corner) for corner in FIELD)
    assert flown_to_its_end(flown, "survey", places=places, spacing_m=50.0) == "done"
    assert len(flown.commands) == 4


@BOTH
def test_flies_around_an_area_and_closes_the_round(flavour: Flavour) -> None:
    flown = Flown(flavour)
    places = tuple(flown.place(*corner) for corner in FIELD)
    assert flown_to_its_end(flown, "survey", places=places, pattern="around") == "done"
    assert len(flown.commands) == 5
    assert math.hypot(flown.vehicle.body.north_m - 50, flown.vehicle.body.east_m) < 3.0


def test_a_turn_in_place_begins_once_the_drone_has_ended_its_turn_to_the_course() -> None:
    """ArduCopter turned at 160 deg/s at the arrival, and by 70 deg after the next command."""
    flown = Flown("ardupilot")
    order = flown.order("rotate", duration_s=24.0).order
    flown.run(5.0, until=lambda: flown.began)
    flown.execution = None
    flown.run(1.0)
    heading, turn = flown.vehicle.heading, TurnInPlace(turn_deg=360.0, rate_deg_s=15.0)
    before_deg = heading.yaw_deg
    while abs(heading.yaw_deg - before_deg) < 15.0:
        heading.yaw_deg = heading.setpoint_deg = heading.yaw_deg - 160.0 * STEP_S
        flown.step()
    with pytest.raises(CommandRefused, match="still moving or turning"):
        flown.authority.command(order.order_id, turn, flown.time_s)
    flown.run(0.8)
    assert not flown.authority.vehicle.heading_rests
    flown.run(0.4)
    assert flown.authority.command(order.order_id, turn, flown.time_s)


def test_a_turn_in_place_begins_once_the_heading_cannot_follow_the_course() -> None:
    """ArduCopter's heading stood for .1 s between two swings, at 1.6 m/s."""
    flown = Flown("ardupilot")
    order = flown.order("goto", places=(flown.place(60.0, 0.0),), height_m=40.0).order
    flown.run(20.0, until=lambda: math.hypot(*flown.vehicle.body.velocity_m_s) > 1.6)
    turn = TurnInPlace(turn_deg=360.0, rate_deg_s=15.0)
    assert flown.authority.obeyed
    with pytest.raises(CommandRefused, match="still moving or turning"):
        flown.authority.command(order.order_id, turn, flown.time_s)


@BOTH
def test_turns_once_at_each_place_of_an_area(flavour: Flavour) -> None:
    flown = Flown(flavour)
    places = tuple(flown.place(*corner) for corner in FIELD)
    execution = flown.order(
        "survey", places=places, pattern="points", spacing_m=75.0, duration_s=12.0
    )
    turned, before = 0.0, flown.vehicle.heading.yaw_deg
    stood: list[tuple[float, float]] = []
    while execution.ended is None:
        flown.step()
        vehicle = flown.vehicle
        turned += abs((vehicle.heading.yaw_deg - before + 180.0) % 360.0 - 180.0)
        before = vehicle.heading.yaw_deg
        if turned > 300.0 * (len(stood) + 1):
            stood.append((vehicle.body.north_m, vehicle.body.east_m))
    assert execution.ended == "done"
    assert execution.plan.summary.startswith("turn at 4 places, from")
    assert turned >= 4 * 325.0
    wanted = [(75.0, 37.5), (75.0, 112.5), (125.0, 112.5), (125.0, 37.5)]
    flown_over = flown.commands[0][1], flown.commands[-1][1]
    assert flown_over[0] != flown_over[1]
    assert len(stood) >= 4
    for north, east in stood[:1]:
        assert min(math.hypot(north - a, east - b) for a, b in wanted) < 3.0


@BOTH
def test_a_return_is_the_autopilots_own_and_ends_the_order(flavour: Flavour) -> None:
    flown = Flown(flavour)
    assert flown_to_its_end(flown, "return") == "the order has ended"
    assert flown.vehicle.mode == MODES[flavour]["return"]
    flown.run(60.0)
    assert not flown.vehicle.armed
    assert len(flown.commands) == 1


@BOTH
def test_it_holds_while_the_ground_is_not_heard_and_returns_after_a_minute(
    flavour: Flavour,
) -> None:
    flown = Flown(flavour)
    flown.order("goto", places=(flown.place(300, 0),), height_m=40.0)
    flown.run(8.0)
    flown.ground_silent_s = 6.0
    flown.run(20.0)
    held = flown.vehicle.body.north_m
    flown.run(30.0)
    assert flown.vehicle.body.north_m == pytest.approx(held, abs=1.0)
    assert held < 150.0
    flown.run(12.0)
    assert flown.vehicle.mode == MODES[flavour]["return"]


@BOTH
def test_it_goes_on_when_the_ground_is_heard_again(flavour: Flavour) -> None:
    flown = Flown(flavour)
    execution = flown.order("goto", places=(flown.place(200, 0),), height_m=40.0)
    flown.run(8.0)
    flown.ground_silent_s = 6.0
    flown.run(20.0)
    flown.ground_silent_s = 0.0
    flown.run(60.0, until=lambda: execution.ended is not None)
    assert execution.ended == "done"
    assert flown.vehicle.body.north_m == pytest.approx(200.0, abs=3.0)


@BOTH
def test_it_returns_when_the_battery_is_needed_for_the_way_home(flavour: Flavour) -> None:
    flown = Flown(flavour)
    execution = flown.order("goto", places=(flown.place(300, 0),), height_m=40.0)
    flown.run(10.0)
    flown.vehicle.body.used_wh = 88.0
    flown.run(5.0)
    assert "the return takes" in execution.status_text
    assert flown.vehicle.mode == MODES[flavour]["return"]


@BOTH
def test_a_confirmation_ends_after_ten_seconds_without_a_command(flavour: Flavour) -> None:
    flown = Flown(flavour)
    flown.order("hold")
    flown.execution = None
    flown.run(9.5)
    assert flown.authority.standing is ControlStage.CONFIRMED
    flown.run(1.0)
    assert flown.authority.reason == "the order did not begin within 10 s"
    assert not flown.commands


def prepared(flavour: Flavour = "px4", **values: Any) -> Flown:
    return Flown(flavour, **values)


def test_what_was_confirmed_once_cannot_be_confirmed_again() -> None:
    flown = prepared()
    flown.authority.offer(1, 77, flown.time_s)
    flown.authority.confirm(1, 77, flown.time_s, sticks_unseen=True)
    flown.authority.stop(flown.time_s)
    with pytest.raises(CommandRefused, match="not the proposed one"):
        flown.authority.confirm(1, 77, flown.time_s, sticks_unseen=True)
    with pytest.raises(CommandRefused, match="an earlier nonce"):
        flown.authority.offer(1, 77, flown.time_s)


def test_a_wrong_nonce_confirms_nothing_and_ends_the_offer() -> None:
    flown = prepared()
    flown.authority.offer(1, 77, flown.time_s)
    for nonce in (78, 77):
        with pytest.raises(CommandRefused, match="not the proposed one"):
            flown.authority.confirm(1, nonce, flown.time_s, sticks_unseen=True)
    assert flown.authority.standing is ControlStage.OUT


def test_unseen_sticks_must_be_confirmed() -> None:
    flown = prepared()
    flown.authority.offer(1, 77, flown.time_s)
    with pytest.raises(CommandRefused, match="sticks are not received"):
        flown.authority.confirm(1, 77, flown.time_s)


def disarm(vehicle: FlyingVehicle) -> None:
    vehicle.armed = False


def stand_on_the_ground(vehicle: FlyingVehicle) -> None:
    vehicle.body.height_m, vehicle.ground.landed = 0.0, True


@pytest.mark.parametrize(
    ("change", "reason"), [(disarm, "not armed"), (stand_on_the_ground, "on the ground")]
)
def test_nothing_is_offered_for_a_vehicle_that_does_not_fly(
    change: Callable[[FlyingVehicle], None], reason: str
) -> None:
    flown = prepared()
    change(flown.vehicle)
    flown.run(1.1)
    with pytest.raises(CommandRefused, match=reason):
        flown.authority.offer(1, 77, flown.time_s)


def test_nothing_is_offered_in_a_failsafe_or_without_position_or_mode() -> None:
    for fault, reason in (
        ("failsafe", "a failsafe: battery"),
        ("position", "no position"),
        ("mode_told", "mode is unknown"),
    ):
        flown = prepared()
        setattr(flown, fault, "battery" if fault == "failsafe" else False)
        flown.run(1.6)
        with pytest.raises(CommandRefused, match=reason):
            flown.authority.offer(1, 77, flown.time_s)


def test_a_height_is_given_above_sea_level_as_this_autopilot_counts_it() -> None:
    # The autopilot's sea level is 37 m off the map's: both its numbers have it.
    assert target_amsl_m(467.0, 40.0, 25.0) == 452.0


@pytest.mark.parametrize(
    ("action", "values", "reason"),
    [
        ("goto", {"places": ((900.0, 0.0),), "height_m": 40.0}, "beyond the fence"),
        ("goto", {"places": ((50.0, 0.0),), "height_m": 12.0}, "the least permitted is 20 m"),
        ("goto", {"places": ((50.0, 0.0),), "height_m": 150.0}, "the most permitted is 120 m"),
        ("goto", {"places": (), "height_m": 40.0}, "goto takes one position, got 0"),
        (
            "survey",
            {"places": ((0.0, 0.0), (100.0, 100.0), (0.0, 100.0), (100.0, 0.0))},
            "crosses itself",
        ),
        ("survey", {"places": ((0.0, 0.0), (0.0, 900.0), (90.0, 900.0))}, "beyond the fence"),
        ("survey", {"places": ()}, "no corners"),
        ("rotate", {"duration_s": 2.0}, "full turn in 2 s is not possible"),
    ],
)
def test_what_cannot_be_flown_is_refused_before_anything_moves(
    action: str, values: dict[str, Any], reason: str
) -> None:
    flown = prepared()
    local = values.get("places", ())
    values = values | ({"places": tuple(flown.place(*one) for one in local)} if local else {})
    with pytest.raises(PlanError, match=reason):
        flown.order(action, **values)
    assert flown.authority.standing is ControlStage.OUT
    assert not flown.commands


@pytest.mark.parametrize("action", ["hold", "rotate"])
def test_beyond_the_fence_nothing_is_offered_that_the_authority_would_refuse(
    action: str,
) -> None:
    flown = prepared()
    flown.vehicle.body.north_m = 560.0
    flown.run(0.5)
    with pytest.raises(
        PlanError, match=r"is 560 m from home, beyond the fence of 500 m\. Run `uavrt"
    ):
        flown.order(action)
    flown.order("return")
    assert flown.authority.standing is ControlStage.CONFIRMED


@pytest.mark.parametrize("action", ["hold", "rotate"])
def test_what_would_end_in_a_return_at_once_is_refused(action: str) -> None:
    flown = prepared()
    flown.vehicle.body.north_m = 300.0
    flown.vehicle.body.used_wh = 85.0
    flown.run(0.5)
    with pytest.raises(PlanError, match=r"35 Wh left; the return takes \d+ Wh\. Return"):
        flown.order(action)
    assert not flown.commands


def test_a_way_beyond_the_battery_is_refused_with_the_figures() -> None:
    flown = prepared()
    flown.vehicle.body.used_wh = 85.0
    flown.run(0.5)
    with pytest.raises(PlanError, match=r"need \d+ Wh; the battery has 35 Wh"):
        flown.order("goto", places=(flown.place(450, 0),), height_m=40.0)


def test_without_the_size_of_the_battery_no_way_is_flown() -> None:
    flown = prepared(limits=Limits())
    with pytest.raises(PlanError, match="battery capacity"):
        flown.order("goto", places=(flown.place(50, 0),), height_m=40.0)


@BOTH
def test_told_to_go_elsewhere_at_speed_it_stands_first(flavour: Flavour) -> None:
    flown = Flown(flavour)
    execution = flown.order("goto", places=(flown.place(200, 0),), height_m=40.0)
    flown.run(8.0)
    now = some(flown.now())
    assert now.speed_m_s > 5.0
    execution.redirect((Go(place=flown.place(0, 60), height_m=40.0),), now)
    slowest = math.inf
    while execution.ended is None:
        flown.step()
        slowest = min(slowest, math.hypot(*flown.vehicle.body.velocity_m_s))
        if flown.vehicle.body.east_m > 30.0:
            break
    assert slowest < 1.0
    assert flown.authority.standing is ControlStage.IN_COMMAND


@BOTH
def test_a_small_bend_is_flown_without_standing(flavour: Flavour) -> None:
    flown = Flown(flavour)
    execution = flown.order("goto", places=(flown.place(200, 0),), height_m=40.0)
    flown.run(8.0)
    now = some(flown.now())
    execution.redirect((Go(place=flown.place(200, 40), height_m=40.0),), now)
    flown.run(4.0)
    assert math.hypot(*flown.vehicle.body.velocity_m_s) > 5.0
    flown.run(60.0, until=lambda: execution.ended is not None)
    assert execution.ended == "done"
    assert flown.vehicle.body.east_m == pytest.approx(40.0, abs=3.0)


@BOTH
def test_wind_slows_it_and_takes_more_of_the_battery(flavour: Flavour) -> None:
    times, left = [], []
    for wind in (0.0, -6.0):
        flown = Flown(flavour, frame=Frame(wind_m_s=(wind, 0.0)))
        begun = flown.time_s
        assert (
            flown_to_its_end(flown, "goto", places=(flown.place(300, 0),), height_m=40.0)
            == "done"
        )
        times.append(flown.time_s - begun)
        left.append(flown.vehicle.body.battery_percent)
    assert times[1] > times[0] + 8.0
    assert left[1] < left[0] - 0.5


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_home_among_others_is_flown_at_its_own_height(flavour: Flavour) -> None:
    """The autopilot's return climbs to a height of its own, where another may be."""
    frame = Frame(return_height_m=60.0)
    flown = Flown(flavour, frame=frame, limits=Limits(battery_wh=120.0, link_lost="return"))
    execution = flown.order("goto", places=(flown.place(150.0, 0.0),), height_m=40.0)
    execution.shared = True
    flown.run(15.0)
    flown.ground_silent_s = 60.0
    flown.run(3.0)
    assert execution.returning
    heights = []

    def over_home() -> bool:
        heights.append(flown.vehicle.body.height_m)
        return flown.vehicle.mode == MODES[flavour]["return"]

    flown.run(90.0, until=over_home)
    assert over_home()
    assert math.hypot(*flown.vehicle.body.place_m) < 5.0
    assert max(abs(height - 40.0) for height in heights) < 2.5
