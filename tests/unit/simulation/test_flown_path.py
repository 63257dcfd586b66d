"""Pulses are as strong as they are where the drone has flown by commands."""

import math
from dataclasses import replace
from pathlib import Path

import made
import pytest
from some import some

from uavrt.link.mavlink import dialect
from uavrt.simulation.scene.antenna import Antenna
from uavrt.simulation.scene.flight import Flight
from uavrt.simulation.scene.flown_path import FlownPath, PathWriter
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.scene.world import World
from uavrt.simulation.synthesis import IQSynthesizer
from uavrt.simulation.vehicle.commanded_vehicle import STEP_NS, Flown

SECOND_NS = 10**9


def reposition(scenario: Scenario, north_m: float, east_m: float) -> dialect.CommandInt:
    latitude, longitude = scenario.plane.to_geodetic(north_m, east_m)
    return made.reposition(
        frame=5,
        x=round(latitude * 1e7),
        y=round(longitude * 1e7),
        z=scenario.plane.altitude_amsl_m + 30.0,
    )


def flown(scenario: Scenario, path: Path, seconds: float = 20.0) -> Flown:
    """Fly 60 m to the east, away from the scenario's own flight."""
    start_ns = scenario.start_time_ns
    vehicle = Flown(scenario.vehicle_pose(start_ns), "px4", False, path)
    vehicle.vehicle.command(reposition(scenario, 0.0, 60.0))
    vehicle.advance(start_ns + round(seconds * SECOND_NS))
    return vehicle


def test_level_frequency_and_direction_are_those_of_where_it_flew(tmp_path: Path) -> None:
    scenario = made.still_scenario(antenna=Antenna(pattern="RA-23K", polarization="any"))
    vehicle = flown(scenario, tmp_path / "path").vehicle
    world = World(scenario, FlownPath(tmp_path / "path", scenario.plane))
    tag = scenario.tag[0]
    heard = world.pulse(tag, 17)
    place = vehicle.body.place_m
    stood = replace(
        scenario,
        flight=Flight(
            north_m=place[0],
            east_m=place[1],
            height_m=vehicle.body.shown_height_m,
            heading_deg=vehicle.heading.yaw_deg,
            wobble_deg=0.0,
        ),
    )
    expected = World(stood).pulse(tag, 17)
    assert heard.enr_db == pytest.approx(expected.enr_db, abs=0.1)
    assert heard.bearing_deg == pytest.approx(expected.bearing_deg, abs=0.5)
    assert abs(heard.enr_db - World(scenario).pulse(tag, 17).enr_db) > 3.0
    # In the fifth second it flies at 8 m/s across the way to the tag.
    closing = heard.frequency_hz - tag.frequency_hz
    assert abs(world.pulse(tag, 4).frequency_hz - tag.frequency_hz) > abs(closing) + 0.5


def test_samples_are_made_of_what_the_drone_has_reached(tmp_path: Path) -> None:
    scenario = made.still_scenario(tag=(replace(made.STILL_TAG, erp_dbm=-40.0),))
    flown(scenario, tmp_path / "path")
    path = FlownPath(tmp_path / "path", scenario.plane, keep_s=5.0)
    synthesizer = IQSynthesizer(scenario, path=path)
    at = synthesizer.index_at(scenario.start_time_ns + 17 * SECOND_NS + SECOND_NS // 2)
    there = abs(synthesizer.block(at + 48, 800)).mean()
    hovering = abs(IQSynthesizer(scenario).block(at + 48, 800)).mean()
    # 60 m aside of 100 m is 1.3 dB.
    assert 20.0 * math.log10(hovering / there) == pytest.approx(1.33, abs=0.4)


def test_motion_is_carried_on_for_half_a_second(tmp_path: Path) -> None:
    scenario = made.still_scenario()
    vehicle = flown(scenario, tmp_path / "path", seconds=5.0)
    path = FlownPath(tmp_path / "path", scenario.plane)
    end_ns = scenario.start_time_ns + 5 * SECOND_NS
    last = some(path.state(end_ns))
    speed = vehicle.vehicle.body.velocity_m_s[1]
    assert last.velocity_ned_m_s[1] == pytest.approx(speed, abs=0.5)
    for later_s, carried_s in ((0.1, 0.1), (3.0, 0.5)):
        state = some(path.state(end_ns + round(later_s * SECOND_NS)))
        moved = state.position_ned_m[1] - last.position_ned_m[1]
        assert moved == pytest.approx(carried_s * speed, abs=0.3)


def test_it_is_read_while_it_is_written_and_half_a_record_waits(tmp_path: Path) -> None:
    scenario = made.still_scenario()
    file = tmp_path / "path"
    path = FlownPath(file, scenario.plane)
    start_ns = scenario.start_time_ns
    assert path.state(start_ns) is None
    assert World(scenario, path).pulse(scenario.tag[0], 0) == World(scenario).pulse(
        scenario.tag[0], 0
    )
    writer = PathWriter(file)
    poses = [scenario.vehicle_pose(start_ns + step * STEP_NS) for step in range(3)]
    writer.add((pose, 10.0 * step) for step, pose in enumerate(poses))
    whole = file.read_bytes()
    file.write_bytes(whole[:-7])
    state = some(path.state(start_ns + STEP_NS))
    assert state.heading_deg == pytest.approx(10.0)
    file.write_bytes(whole)
    state = some(path.state(start_ns + 2 * STEP_NS))
    assert state.heading_deg == pytest.approx(20.0)
