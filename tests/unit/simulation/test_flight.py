import math

import numpy as np
import pytest

from uavrt.core.errors import ConfigError
from uavrt.simulation.scene import geometry
from uavrt.simulation.scene.antenna import Antenna
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.scenario import Scenario


def heading_of(quaternion: geometry.Quaternion) -> float:
    north, east, _ = geometry.rotate(quaternion, (1.0, 0.0, 0.0))
    return math.degrees(math.atan2(east, north))


@pytest.mark.parametrize("duration_s", [40.0, 60.0, 300.0])
def test_the_demo_turns_three_times_and_never_faster_than_60_degrees_a_second(
    duration_s: float,
) -> None:
    scenario = demo_scenario(duration_s)
    times_s = np.arange(0.0, duration_s, 0.05)
    states = [scenario.vehicle_state(scenario.start_time_ns + round(t * 1e9)) for t in times_s]
    headings = np.unwrap([state.heading_deg for state in states], period=360.0)
    assert headings[-1] - headings[0] == pytest.approx(3 * 360.0)
    assert np.abs(np.diff(headings)).max() / 0.05 <= 60.0


@pytest.mark.parametrize("duration_s", [39.9, math.nan, math.inf, -1.0])
def test_a_demo_fills_its_duration_and_a_too_short_one_is_refused(duration_s: float) -> None:
    assert demo_scenario(77.0).flight.duration_s == pytest.approx(77.0)
    with pytest.raises(ConfigError, match="at least 40 s"):
        demo_scenario(duration_s)


def test_the_drone_stays_where_it_is_before_and_after_the_flight() -> None:
    scenario = demo_scenario(40.0)
    start, end = scenario.start_time_ns, scenario.start_time_ns + 40 * 10**9
    assert scenario.vehicle_pose(start - 10**9).altitude_relative_m == 0.0
    before, after = scenario.vehicle_state(end), scenario.vehicle_state(end + 10**10)
    assert before.position_ned_m == pytest.approx(after.position_ned_m)
    assert scenario.vehicle_pose(end).altitude_relative_m == pytest.approx(12.8)


def test_velocity_is_the_change_of_position() -> None:
    scenario = demo_scenario(60.0)
    for elapsed_ns in range(3 * 10**9, 60 * 10**9, 1_370_000_000):
        time_ns = scenario.start_time_ns + elapsed_ns
        before, now, after = (
            scenario.vehicle_state(time_ns + step) for step in (-10_000_000, 0, 10_000_000)
        )
        moved = geometry.subtract(after.position_ned_m, before.position_ned_m)
        assert now.velocity_ned_m_s == pytest.approx(geometry.scale(moved, 50.0), abs=0.02)


def test_a_multirotor_leans_into_its_acceleration_and_against_the_wind() -> None:
    leg = Leg(duration_s=10.0, east_m=80.0)
    flight = Flight(height_m=30.0, wobble_deg=0.0, heading_deg=90.0, leg=(leg,))
    scenario = Scenario(flight=flight)
    poses = [scenario.vehicle_pose(scenario.start_time_ns + t * 10**8) for t in (10, 50, 90)]
    nose_up = [-geometry.rotate(one.quaternion_wxyz, (1.0, 0.0, 0.0))[2] for one in poses]
    assert nose_up[0] < nose_up[1] < 0.0 < nose_up[2]
    # At 80 m / (10 s · 0.65) the drag of 0.15/s wants 1.85 m/s² of thrust: atan(1.85/9.81).
    assert math.degrees(math.asin(nose_up[1])) == pytest.approx(-10.7, abs=0.1)


@pytest.mark.parametrize("duration_s", [40.0, 60.0, 130.0, 600.0])
def test_the_demo_flies_as_a_multirotor_can(duration_s: float) -> None:
    scenario = demo_scenario(duration_s)
    for elapsed_s in np.arange(0.0, duration_s, 0.1):
        state = scenario.vehicle_state(scenario.start_time_ns + round(elapsed_s * 1e9))
        up = -geometry.rotate(state.quaternion_wxyz, (0.0, 0.0, -1.0))[2]
        assert math.degrees(math.acos(min(1.0, up))) < 36.0
        assert geometry.length(state.velocity_ned_m_s) < 15.0


def test_the_antenna_is_turned_and_placed_as_mounted() -> None:
    scenario = Scenario(
        flight=Flight(height_m=20.0, wobble_deg=0.0, heading_deg=90.0),
        antenna=Antenna(yaw_offset_deg=30.0, offset_forward_m=2.0, offset_down_m=0.5),
    )
    time_ns = scenario.start_time_ns
    pose = scenario.antenna_pose(time_ns)
    assert heading_of(pose.quaternion_wxyz) == pytest.approx(120.0)
    assert pose.altitude_relative_m == pytest.approx(19.5)
    north_m, east_m = scenario.plane.to_local(pose.latitude_deg, pose.longitude_deg)
    assert (north_m, east_m) == pytest.approx((0.0, 2.0), abs=1e-4)
    assert heading_of(scenario.vehicle_pose(time_ns).quaternion_wxyz) == pytest.approx(90.0)


@pytest.mark.parametrize(("height_m", "wobble_deg"), [(30.0, 2.0), (0.0, 0.0)])
def test_wobble_has_the_asked_size_in_the_air_and_none_on_the_ground(
    height_m: float, wobble_deg: float
) -> None:
    scenario = Scenario(flight=Flight(height_m=height_m, wobble_deg=2.0))
    times_ns = scenario.start_time_ns + 37_000_000 * np.arange(3000)
    poses = [scenario.vehicle_pose(int(time_ns)) for time_ns in times_ns]
    down = [geometry.rotate(pose.quaternion_wxyz, (0.0, 1.0, 0.0))[2] for pose in poses]
    rolls_deg = np.degrees(np.arcsin(down))
    assert np.std(rolls_deg) == pytest.approx(wobble_deg, rel=0.1, abs=1e-9)
