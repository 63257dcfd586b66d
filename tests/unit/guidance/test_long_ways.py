"""Ways that take minutes, and orders that are cut short far from home."""

import pytest
from flown import Flown
from some import some

from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.operator_orders import Limits
from uavrt.guidance.plans import Go
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.simulated_flying import MODES

BOTH = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
FAR = Limits(battery_wh=600.0, fence_m=1500.0, speed_m_s=5.0)


def far_flown(flavour: Flavour, **frame: object) -> Flown:
    return Flown(
        flavour,
        frame=Frame(battery_wh=600.0, **({"speed_m_s": 5.0} | frame)),  # type: ignore[arg-type]
        limits=FAR,
    )


@pytest.mark.parametrize(
    ("flavour", "wind_m_s"),
    [("px4", (0.0, 0.0)), ("px4", (0.0, 6.0)), ("ardupilot", (-8.0, 0.0))],
)
def test_a_leg_of_a_kilometre_is_flown_to_its_end(
    flavour: Flavour, wind_m_s: tuple[float, float]
) -> None:
    flown = far_flown(flavour, wind_m_s=wind_m_s, airspeed_m_s=10.0)
    execution = flown.order("goto", places=(flown.place(1000.0, 0.0),), height_m=40.0)
    flown.run(900.0, until=lambda: execution.ended is not None)
    assert execution.ended == "done"
    assert flown.vehicle.body.north_m == pytest.approx(1000.0, abs=3.0)
    assert flown.time_s > 100.0 + 200.0


def slow_far_away(flavour: Flavour) -> Flown:
    """On its way, and as slow as against a wind."""
    flown = far_flown(flavour)
    flown.order("goto", places=(flown.place(1000.0, 0.0),), height_m=40.0)
    flown.run(60.0)
    flown.vehicle.body.frame = Frame(battery_wh=600.0, speed_m_s=0.5)
    return flown


@BOTH
def test_slow_progress_is_progress(flavour: Flavour) -> None:
    """Against a wind it may take an hour; a battery that runs low brings the drone home."""
    flown = slow_far_away(flavour)
    flown.run(300.0)
    assert flown.authority.standing is ControlStage.IN_COMMAND
    assert len(flown.commands) == 1


@BOTH
def test_a_drone_that_stops_on_its_way_is_somebodys_and_is_not_sent_home(
    flavour: Flavour,
) -> None:
    flown = slow_far_away(flavour)
    flown.run(10.0)
    flown.vehicle.body.frame = Frame(battery_wh=600.0, speed_m_s=0.0)
    flown.run(4.0)
    assert flown.authority.reason == "the drone has stopped before its target"
    flown.run(300.0)
    assert len(flown.commands) == 1


@BOTH
def test_nobody_who_took_over_is_sent_home(flavour: Flavour) -> None:
    flown = slow_far_away(flavour)
    flown.run(60.0)
    sent = len(flown.commands)
    flown.vehicle.set_mode(MODES[flavour]["position"])
    flown.run(300.0)
    assert len(flown.commands) == sent
    assert flown.vehicle.mode == MODES[flavour]["position"]


@BOTH
def test_commands_that_are_refused_again_and_again_end_in_a_return(flavour: Flavour) -> None:
    """Only a fault of ours would wish for them; the drone must not pay for it."""
    flown = far_flown(flavour)
    execution = flown.order("goto", places=(flown.place(60.0, 0.0),), height_m=40.0)
    flown.run(5.0)
    now = some(flown.now())
    execution.redirect([Go(place=flown.place(5_000.0, 0.0), height_m=40.0)], now)
    flown.run(60.0)
    assert execution.status_text == "returning: the commands are refused"
    assert flown.vehicle.mode == MODES[flavour]["return"]


@BOTH
@pytest.mark.parametrize("begun", [True, False])
def test_what_gives_up_by_itself_returns_only_where_it_has_begun(
    flavour: Flavour, begun: bool
) -> None:
    flown = far_flown(flavour)
    execution = flown.order("goto", places=(flown.place(300.0, 0.0),), height_m=40.0)
    flown.run(20.0 if begun else 0.0)
    execution.give_up("the search has failed: a fault")
    flown.run(3.0)
    if begun:
        assert flown.vehicle.mode == MODES[flavour]["return"]
        assert execution.status_text == "returning: the search has failed: a fault"
    else:
        assert not flown.commands
        assert flown.authority.reason == "the search has failed: a fault"
