"""Worlds of several drones: one and the same animals, flights that stay apart."""

import math
from itertools import pairwise

import pytest

from uavrt.simulation.scene.demo_world import demo_scenario, fleet_scenarios


@pytest.mark.parametrize("duration_s", [40.0, 120.0])
def test_drones_of_the_demo_meet_the_same_animals_and_never_each_other(
    duration_s: float,
) -> None:
    worlds = fleet_scenarios(3, demo_scenario(duration_s, seed=3))
    assert worlds[0] == demo_scenario(duration_s, 3)
    assert all(one.tag == worlds[0].tag for one in worlds)
    for tenth in range(int(10 * duration_s)):
        poses = [one.vehicle_pose(one.start_time_ns + tenth * 100_000_000) for one in worlds]
        for a, b in pairwise(poses):
            apart = math.radians(a.latitude_deg - b.latitude_deg) * 6_371_000.0
            assert apart > 100.0
    heights = [one.vehicle_pose(one.start_time_ns + int(duration_s * 5e8)) for one in worlds]
    steps = [b.altitude_relative_m - a.altitude_relative_m for a, b in pairwise(heights)]
    assert steps == pytest.approx([10.0, 10.0], abs=0.1)
