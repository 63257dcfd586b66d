"""The battery teaches what flying costs, and the drone goes home in time."""

import numpy as np
import pytest

from uavrt.core.errors import ConfigError
from uavrt.planning.drone_model.drone_motion import Multirotor, VehicleState, Wind
from uavrt.planning.drone_model.energy import Battery, EnergyModel

DRONE = Multirotor(speed_m_s=10.0)


def test_flying_fast_costs_more_than_cruising_and_climbing_costs_on_top() -> None:
    model = EnergyModel()
    assert model.power_w(0.0) == pytest.approx(400.0)
    assert model.power_w(10.0) == pytest.approx(420.0)
    assert model.power_w(16.0) > model.power_w(10.0)
    assert model.power_w(4.0) < model.power_w(0.0)
    level, up = model.used_wh(60.0, 0.0), model.used_wh(60.0, 0.0, climb_m=50.0)
    assert up - level == pytest.approx(50.0 * 60.0 / 3600.0)
    assert model.used_wh(60.0, 0.0, climb_m=-50.0) == level


def test_a_battery_that_gives_more_than_told_is_believed_bit_by_bit() -> None:
    rng = np.random.default_rng(1)
    model = EnergyModel()
    for _ in range(10):
        told = model.used_wh(60.0, 8.0)
        true = 1.35 / model.scale * told
        model = model.learnt(told, true + rng.normal(0.0, 0.3), 0.3)
    assert model.scale == pytest.approx(1.35, abs=0.04)
    assert model.scale_sigma < 0.05
    with pytest.raises(ConfigError, match="battery"):
        model.learnt(1.0, float("nan"), 0.3)


def test_the_way_home_against_the_wind_needs_more_and_may_be_impossible() -> None:
    model = EnergyModel()
    far = VehicleState(time_s=0.0, east_m=0.0, north_m=1000.0, height_m=40.0)
    calm = model.way_home_wh(DRONE, far, (0.0, 0.0), Wind())
    against = model.way_home_wh(DRONE, far, (0.0, 0.0), Wind(north_m_s=6.0))
    assert against > 1.8 * calm
    assert model.way_home_wh(DRONE, far, (0.0, 0.0), Wind(north_m_s=12.0)) == float("inf")
    battery = Battery(remaining_wh=calm + 15.1, reserve_wh=15.0)
    assert not battery.must_return(calm)
    assert battery.must_return(calm, next_leg_wh=0.2)


def test_a_payload_that_nobody_told_of_is_believed_within_some_lessons() -> None:
    """Thrice what is believed, by a model that was rather sure."""
    model = EnergyModel(scale_sigma=0.2)
    for _ in range(4):
        told = model.used_wh(30.0, 8.0)
        true = 3.0 / model.scale * told
        before = model
        model = model.learnt(told, true, 0.4)
        assert model.scale > before.scale
    assert model.scale == pytest.approx(3.0, abs=0.2)
    # And back: what was learnt once does not hold for ever.
    for _ in range(8):
        told = model.used_wh(30.0, 8.0)
        model = model.learnt(told, told / model.scale, 0.4)
    assert model.scale == pytest.approx(1.0, abs=0.15)


def test_an_autopilot_holds_the_speed_over_ground_while_it_can() -> None:
    drone = Multirotor(speed_m_s=8.0, airspeed_m_s=12.0)
    far = VehicleState(time_s=0.0, east_m=0.0, north_m=1000.0, height_m=40.0)
    south = np.array([0.0]), np.array([0.0])

    def lasts_s(wind_m_s: float) -> float:
        return float(drone.durations(far, *south, Wind(north_m_s=wind_m_s))[0])

    assert lasts_s(3.0) == pytest.approx(lasts_s(0.0))
    assert lasts_s(-3.0) == pytest.approx(lasts_s(0.0))
    assert lasts_s(6.0) == pytest.approx(1000.0 / 6.0, rel=0.02)
    assert lasts_s(13.0) == float("inf")


def test_against_the_wind_it_needs_more_at_the_same_speed_over_ground() -> None:
    drone, model = Multirotor(speed_m_s=5.0, airspeed_m_s=14.0), EnergyModel()
    far = VehicleState(time_s=0.0, east_m=0.0, north_m=1000.0, height_m=40.0)
    calm = model.way_home_wh(drone, far, (0.0, 0.0), Wind())
    against = model.way_home_wh(drone, far, (0.0, 0.0), Wind(north_m_s=8.0))
    assert 1.1 * calm < against < 1.5 * calm


def test_a_return_that_climbs_first_needs_more() -> None:
    model = EnergyModel()
    near = VehicleState(time_s=0.0, east_m=0.0, north_m=50.0, height_m=25.0)
    low, high = (
        model.way_home_wh(DRONE, near, (0.0, 0.0), Wind(), return_height_m=height)
        for height in (0.0, 60.0)
    )
    climbed = 35.0 * 60.0 / 3600.0 + 400.0 * (35.0 / 3.0 + 35.0 / 1.5) / 3600.0
    assert high - low == pytest.approx(1.4 * climbed)
