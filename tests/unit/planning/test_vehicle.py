"""Where a drone is at each instant of its way."""

import numpy as np
import pytest

from uavrt.core.errors import ConfigError
from uavrt.planning.drone_model.drone_motion import (
    FixedWing,
    Multirotor,
    VehicleState,
    Wind,
    flown,
)
from uavrt.planning.drone_model.planner_actions import FlyTo, Hold, Rotate
from uavrt_experiments.search.flight import reachable

START = VehicleState(time_s=100.0, east_m=0.0, north_m=0.0, height_m=30.0, yaw_deg=0.0)


def test_a_multirotor_gathers_speed_and_stops() -> None:
    drone = Multirotor(speed_m_s=10.0, acceleration_m_s2=4.0)
    path = flown(drone, START, FlyTo(east_m=0.0, north_m=100.0), step_s=0.1)
    assert path.time_s[-1] - 100.0 == pytest.approx(12.5, abs=0.11)
    speed = np.diff(path.north_m) / 0.1
    assert speed.max() == pytest.approx(10.0, abs=0.01)
    assert np.abs(np.diff(speed)).max() <= 4.0 * 0.1 + 1e-6
    assert path.north_m[-1] == pytest.approx(100.0)


def test_it_turns_first_where_it_is_told_to() -> None:
    drone = Multirotor(acceleration_m_s2=float("inf"), yaw_rate_deg_s=30.0, turns_first=True)
    path = flown(drone, START, FlyTo(east_m=-50.0, north_m=0.0))
    assert path.yaw_deg[:3].tolist() == pytest.approx([-30.0, -60.0, -90.0])
    assert path.east_m[:4].tolist() == pytest.approx([0.0, 0.0, 0.0, -10.0])


def test_wind_from_ahead_takes_its_time_and_too_much_of_it_is_refused() -> None:
    drone = Multirotor(speed_m_s=10.0, acceleration_m_s2=float("inf"))
    there = FlyTo(east_m=0.0, north_m=120.0)
    against = flown(drone, START, there, wind=Wind(north_m_s=-4.0))
    across = flown(drone, START, there, wind=Wind(east_m_s=6.0))
    assert len(against.time_s) == 20
    assert len(across.time_s) == 15
    with pytest.raises(ConfigError, match="wind"):
        flown(drone, START, there, wind=Wind(north_m_s=-11.0))


def test_a_turn_in_place_sees_every_direction() -> None:
    path = flown(Multirotor(), START, Rotate(duration_s=12.0))
    assert np.all(path.north_m == 0.0)
    assert path.yaw_deg[-1] == pytest.approx(360.0)


@pytest.mark.parametrize("east_m", [300.0, -300.0, 30.0])
@pytest.mark.parametrize("north_m", [200.0, -200.0, 10.0])
def test_a_fixed_wing_reaches_places_on_circles_of_its_radius(
    east_m: float, north_m: float
) -> None:
    """Also those inside its turning circle."""
    plane = FixedWing(speed_m_s=16.0, turn_radius_m=60.0)
    path = flown(plane, START, FlyTo(east_m=east_m, north_m=north_m), step_s=0.05)
    assert np.hypot(path.east_m[-1] - east_m, path.north_m[-1] - north_m) < 1.0
    speed = np.hypot(np.diff(path.east_m), np.diff(path.north_m))[:-1] / 0.05
    assert speed == pytest.approx(16.0, rel=0.01)
    course = np.unwrap(np.arctan2(np.diff(path.east_m), np.diff(path.north_m)))
    assert np.abs(np.diff(course)[:-1]).max() / 0.05 <= 16.0 / 60.0 * 1.01


def test_a_fixed_wing_holds_by_circling() -> None:
    path = flown(FixedWing(), START, Hold(duration_s=30.0))
    middle = np.hypot(path.east_m - 60.0, path.north_m)
    assert middle == pytest.approx(60.0)


def test_a_drone_that_must_stand_in_time_goes_less_far() -> None:
    drone = Multirotor(speed_m_s=10.0, acceleration_m_s2=5.0)
    near = reachable(drone, START, FlyTo(east_m=0.0, north_m=500.0), Wind(), 8.0)
    assert near.north_m == pytest.approx(60.0, abs=5.0)
    assert near.north_m <= 60.0
