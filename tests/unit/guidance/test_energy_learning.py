"""What flying takes is learnt from the battery, and the way home is reckoned with it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from flown import Flown
from searched import Animal, Searched

from uavrt.core.errors import PlanError
from uavrt.guidance.energy_learning import EnergyLearning, energy_of
from uavrt.guidance.operator_orders import Limits, VehicleNow
from uavrt.guidance.plans import must_return, way_home_wh
from uavrt.planning.drone_model.drone_motion import Wind
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.simulated_flying import MODES

BOTH = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
HOME = (47.1, 8.5)
NOW = VehicleNow(
    time_s=100.0,
    latitude_deg=47.1 + 300.0 / 111_200.0,
    longitude_deg=8.5,
    altitude_amsl_m=470.0,
    altitude_relative_m=40.0,
    speed_m_s=5.0,
    yaw_deg=0.0,
    home=HOME,
    battery_percent=90.0,
    order_id=1,
    began=True,
    obeyed=True,
    requests_sent=1,
    requests_refused=0,
    turned_deg=0.0,
    ground_silent_s=0.0,
)
LIMITS = Limits(battery_wh=120.0, fence_m=500.0)


def lessons_of(
    power_w: float, *, battery_wh: float = 120.0, hover_w: float | None = None, s: int = 240
) -> EnergyLearning:
    """Readings in whole percents, ten a second, of a drone that takes a power."""
    lessons = EnergyLearning(hover_w, battery_wh)
    for tenths in range(10 * s):
        used = 100.0 * power_w * 0.1 * tenths / 3600.0 / battery_wh
        lessons.learn(replace(NOW, time_s=0.1 * tenths, battery_percent=round(95.0 - used)))
    return lessons


@pytest.mark.parametrize("power_w", [280.0, 400.0, 1200.0])
@pytest.mark.parametrize("hover_w", [None, 400.0])
def test_the_battery_teaches_what_flying_takes(power_w: float, hover_w: float | None) -> None:
    lessons = lessons_of(power_w, hover_w=hover_w)
    assert lessons.learnt >= 4
    assert lessons.energy.power_w(5.0) == pytest.approx(power_w, rel=0.12)
    certain = 2.0 * lessons.energy.scale_sigma / lessons.energy.scale
    assert certain < 0.5


def test_before_the_first_lesson_an_untold_drone_may_take_thrice_the_power() -> None:
    untold, told = energy_of(None), energy_of(1200.0)
    assert untold.scale + 2.0 * untold.scale_sigma == pytest.approx(3.0)
    assert told.power_w(0.0) == pytest.approx(1200.0)
    assert told.scale + 2.0 * told.scale_sigma == pytest.approx(1.5)


def test_nothing_is_learnt_while_no_order_is_flown() -> None:
    """The drone may stand on the ground."""
    lessons = EnergyLearning(None, 120.0)
    for second in range(600):
        lessons.learn(
            replace(NOW, time_s=second, battery_percent=95.0 - second // 60, began=False)
        )
    assert lessons.learnt == 0
    assert lessons.energy == energy_of(None)


def test_a_pause_and_another_battery_are_no_lesson() -> None:
    lessons = EnergyLearning(None, 120.0)
    readings = [(0, 60.0), (30, 59.0), (60, 58.0), (90, 99.0), (120, 98.0), (150, 97.0)]
    for second, percent in readings:
        lessons.learn(replace(NOW, time_s=second, battery_percent=percent))
    assert lessons.learnt == 0
    lessons.learn(replace(NOW, time_s=160.0, began=False))
    lessons.learn(replace(NOW, time_s=1000.0, battery_percent=90.0))
    lessons.learn(replace(NOW, time_s=1010.0, battery_percent=60.0))
    assert lessons.learnt == 0  # what was used while nobody looked taught nothing


def test_without_a_size_or_readings_of_the_battery_nothing_is_learnt() -> None:
    assert lessons_of(900.0, battery_wh=1e9).learnt == 0
    lessons = EnergyLearning(None, None)
    for second in range(600):
        lessons.learn(replace(NOW, time_s=second, battery_percent=95.0 - second // 6))
    assert lessons.learnt == 0


def test_the_way_home_is_reckoned_with_what_was_learnt() -> None:
    place = (0.0, 300.0)
    hungry = replace(NOW, energy=lessons_of(1200.0).energy)
    frugal = replace(NOW, energy=lessons_of(400.0).energy)
    needed = way_home_wh(place, 40.0, hungry, LIMITS)
    assert needed > 2.5 * way_home_wh(place, 40.0, frugal, LIMITS)
    left = needed + 0.25 * 120.0 - 0.6
    low = replace(hungry, battery_percent=100.0 * left / 120.0)
    assert must_return(low, LIMITS) == f"{left:.0f} Wh left; the return takes {needed:.0f} Wh"
    assert must_return(replace(frugal, battery_percent=low.battery_percent), LIMITS) is None


def test_the_way_home_is_against_the_wind_that_is_told_or_else_the_worst() -> None:
    place = (0.0, 400.0)
    known = replace(NOW, energy=energy_of(400.0))

    def needed(wind: Wind | None, limits: Limits = LIMITS) -> float:
        return way_home_wh(place, 40.0, replace(known, wind=wind), limits)

    calm, against = needed(Wind()), needed(Wind(north_m_s=9.0))
    assert against > 1.3 * calm
    assert needed(None) > 1.05 * calm
    assert needed(None, replace(LIMITS, wind_m_s=9.0)) == pytest.approx(against)
    assert needed(None, replace(LIMITS, wind_m_s=0.0)) == pytest.approx(calm)
    # A wind that helps may turn: it makes the way no shorter.
    assert needed(Wind(north_m_s=-9.0)) > 0.9 * calm
    assert needed(Wind(), replace(LIMITS, return_height_m=40.0)) < calm


def test_in_as_much_wind_as_it_can_fly_against_it_goes_home_and_nowhere_else() -> None:
    status_text = must_return(replace(NOW, wind=Wind(east_m_s=11.0)), LIMITS)
    assert status_text == "wind of 11 m/s, close to the drone's airspeed of 12 m/s"
    assert must_return(replace(NOW, wind=Wind(east_m_s=10.0)), LIMITS) is None
    flown = Flown("px4", frame=Frame(wind_m_s=(0.0, 11.5)))
    flown.run(6.0)
    with pytest.raises(PlanError, match="wind of 12 m/s"):
        flown.order("goto", places=(flown.place(50.0, 0.0),), height_m=40.0)


@BOTH
def test_wind_that_rises_in_flight_ends_a_search(flavour: Flavour) -> None:
    search = Searched(flavour, [], absent=1, duration_s=300.0)
    search.begin()
    search.run(20.0)
    assert not search.out
    search.flown.vehicle.body.frame = replace(search.frame, wind_m_s=(0.0, 11.5))
    search.run(10.0)
    assert search.flown.authority.reason == "returning: the autopilot flies home"
    assert any(
        "wind of" in one for one in (search.execution.status_text, search.notes[-1].reason)
    )


@pytest.mark.parametrize("seed", range(5))
def test_whatever_it_takes_and_in_whatever_wind_it_is_home_with_the_reserve(seed: int) -> None:
    """Surveys that look short enough before, of drones that take 0.7 to 3 times the model's."""
    rng = np.random.default_rng(seed)
    flavour: Flavour = "px4" if rng.random() < 0.5 else "ardupilot"
    hunger = math.exp(rng.uniform(math.log(0.7), math.log(3.0))) if seed else 3.0
    battery = float(rng.uniform(90.0, 140.0)) * max(1.0, hunger)
    wind, towards = rng.uniform(0.0, 6.0), rng.uniform(0.0, 2.0 * math.pi)
    flown = Flown(
        flavour,
        limits=Limits(battery_wh=battery, fence_m=900.0, speed_m_s=8.0, return_height_m=30.0),
        frame=Frame(
            hover_w=400.0 * hunger,
            battery_wh=battery,
            wind_m_s=(wind * math.cos(towards), wind * math.sin(towards)),
        ),
    )
    flown.wind_m_s, flown.wind_told = None, bool(rng.random() < 0.5)
    north, east = rng.uniform(-450.0, 450.0, 2)
    corners = ((-150, -150), (-150, 150), (150, 150), (150, -150))
    places = tuple(flown.place(north + a, east + b) for a, b in corners)
    for spacing_m in (10.0, 15.0, 20.0, 30.0, 50.0, 75.0, 100.0, 150.0, 290.0):
        try:
            execution = flown.order("survey", places=places, spacing_m=spacing_m, height_m=60.0)
        except PlanError:
            continue
        break
    else:
        raise AssertionError("no survey is short enough")
    flown.run(3000.0, until=lambda: execution.ended is not None)
    if execution.ended == "done":
        execution = flown.order("return")
    flown.run(900.0, until=lambda: not flown.vehicle.armed)
    assert not flown.vehicle.armed
    assert flown.vehicle.mode == MODES[flavour]["return"]
    assert flown.vehicle.body.battery_percent >= 25.0


def test_a_search_and_its_pilot_reckon_with_the_same_lessons() -> None:
    """A drone that takes thrice what is believed, and an animal that nobody can find."""
    search = Searched(
        "px4",
        [Animal(90.0, 60.0, level_db=8.0)],
        limits=Limits(
            battery_wh=160.0, speed_m_s=8.0, fence_m=500.0, hover_w=400.0, return_height_m=30.0
        ),
        frame=Frame(battery_wh=160.0, hover_w=1200.0),
        duration_s=900.0,
    )
    search.begin()
    search.run(600.0)
    assert search.flown.authority.reason == "returning: the autopilot flies home"
    assert "the return" in f"{search.execution.status_text} {search.notes[-1].reason}"
    assert search.flown.lessons.energy.power_w(0.0) == pytest.approx(1200.0, rel=0.15)
    search.flown.run(300.0, until=lambda: not search.flown.vehicle.armed)
    assert 25.0 <= search.flown.vehicle.body.battery_percent < 45.0
