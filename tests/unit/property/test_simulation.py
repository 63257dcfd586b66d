import itertools
from dataclasses import replace

import made
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from uavrt.simulation.scene import geometry
from uavrt.simulation.scene.counter_random import stream_key, uniform
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.propagation import Fading, Propagation
from uavrt.simulation.scene.scenario import Interferer, Radio, Scenario, SimulatedTag
from uavrt.simulation.scene.scenario_file import parse_scenario, scenario_toml
from uavrt.simulation.scene.world import World
from uavrt.simulation.synthesis import IQSynthesizer

TAG = made.simulated_tag(
    1,
    150_001_000.0,
    0.7,
    0.9,
    north_m=100.0,
    erp_dbm=-50.0,
    jitter_s=0.03,
    rate_pattern=(1, 2, 2),
)
SCENARIO = Scenario(
    seed=11,
    radio=Radio(sample_rate_hz=96_000.0, center_frequency_hz=150e6),
    propagation=Propagation(fading=Fading(kind="rician")),
    tag=(TAG, replace(TAG, tag_id=2, first_pulse_s=0.51, frequency_hz=149_990_000.0)),
    interferer=(
        Interferer(kind="carrier", frequency_hz=150_013_000.0, power_dbm=-120.0),
        Interferer(kind="impulses", impulses_per_s=30.0, power_dbm=-90.0, impulse_width_s=1e-3),
    ),
    flight=Flight(leg=(Leg(duration_s=5.0, height_m=30.0, turn_deg=200.0),)),
)
TOTAL = 400_000
WHOLE = IQSynthesizer(SCENARIO).block(0, TOTAL)


@settings(max_examples=25)
@given(
    first=st.integers(0, TOTAL - 1),
    sizes=st.lists(st.integers(0, 90_000), min_size=1, max_size=6),
)
def test_blocks_of_any_size_from_anywhere_are_the_same_samples(
    first: int, sizes: list[int]
) -> None:
    synthesizer = IQSynthesizer(SCENARIO)
    for size in sizes:
        count = min(size, TOTAL - first)
        block = synthesizer.block(first, count)
        np.testing.assert_array_equal(block, WHOLE[first : first + count])
        first += count


@settings(max_examples=20)
@given(order=st.permutations(range(7)))
def test_chunks_asked_for_in_any_order_are_the_same_samples(order: list[int]) -> None:
    synthesizer = IQSynthesizer(SCENARIO)
    for chunk in order:
        expected = WHOLE[chunk * 65_536 : (chunk + 1) * 65_536]
        np.testing.assert_array_equal(synthesizer.chunk(chunk)[: expected.size], expected)


@settings(max_examples=25)
@given(cuts=st.lists(st.integers(0, 30 * 10**9), max_size=5))
def test_the_truth_of_parts_is_the_truth_of_the_whole(cuts: list[int]) -> None:
    start, end = SCENARIO.start_time_ns, SCENARIO.start_time_ns + 30 * 10**9
    whole = World(SCENARIO).truth(start, end)
    edges = [start, *sorted(start + cut for cut in cuts), end]
    # A new world for every part: nobody's history may matter.
    parts = [
        pulse
        for low, high in itertools.pairwise(edges)
        for pulse in World(SCENARIO).truth(low, high)
    ]
    assert parts == whole


ANGLES = st.floats(-180.0, 180.0)
VECTORS = st.tuples(*[st.floats(-100.0, 100.0)] * 3)


@given(roll=ANGLES, pitch=ANGLES, yaw=ANGLES, vector=VECTORS)
def test_a_rotation_keeps_lengths_and_can_be_undone(
    roll: float, pitch: float, yaw: float, vector: geometry.Vector
) -> None:
    rotation = geometry.from_euler_deg(roll, pitch, yaw)
    turned = geometry.rotate(rotation, vector)
    np.testing.assert_allclose(geometry.length(turned), geometry.length(vector), atol=1e-9)
    np.testing.assert_allclose(geometry.unrotate(rotation, turned), vector, atol=1e-9)


@given(
    latitude=st.floats(-80.0, 80.0),
    longitude=st.floats(-180.0, 180.0),
    north=st.floats(-5000.0, 5000.0),
    east=st.floats(-5000.0, 5000.0),
)
def test_metres_to_degrees_and_back(
    latitude: float, longitude: float, north: float, east: float
) -> None:
    plane = geometry.TangentPlane(
        latitude_deg=latitude, longitude_deg=longitude, altitude_amsl_m=300.0
    )
    there = plane.to_geodetic(north, east)
    assert -180.0 <= there[1] < 180.0
    np.testing.assert_allclose(plane.to_local(*there), (north, east), atol=1e-4)


@given(seed=st.integers(0, 2**32 - 1), name=st.text(), index=st.integers(-(2**40), 2**40))
def test_random_numbers_depend_on_their_name_alone(seed: int, name: str, index: int) -> None:
    alone = float(uniform(stream_key(seed, name), index))
    among = uniform(stream_key(seed, name), np.arange(index - 3, index + 4))
    assert alone == among[3]
    assert 0.0 <= alone < 1.0
    assert np.unique(among).size == 7


RECORDS = st.builds(
    Scenario,
    name=st.text(st.characters(codec="utf-8"), max_size=20),
    seed=st.integers(0, 2**32 - 1),
    duration_s=st.floats(1e-3, 1e6),
    flight=st.builds(
        Flight,
        heading_deg=st.floats(-1e3, 1e3),
        leg=st.lists(
            st.builds(
                Leg,
                duration_s=st.floats(1e-3, 1e4),
                north_m=st.none() | st.floats(-1e4, 1e4),
                turn_deg=st.floats(-1e4, 1e4),
            ),
            max_size=3,
        ).map(tuple),
    ),
    tag=st.builds(
        SimulatedTag,
        tag_id=st.integers(1, 2**31),
        frequency_hz=st.floats(1e8, 2e8),
        pulse_width_s=st.floats(1e-3, 0.1),
        pulse_intervals_s=st.tuples(st.floats(0.5, 4.0)),
        name=st.none() | st.text(max_size=10),
        listed=st.booleans(),
    ).map(lambda tag: (tag,)),
)


@settings(max_examples=25)
@given(scenario=RECORDS)
def test_any_scenario_survives_its_file(scenario: Scenario) -> None:
    assert parse_scenario(scenario_toml(scenario)) == scenario


@settings(max_examples=40)
@given(
    durations=st.lists(st.floats(5.0, 60.0), min_size=1, max_size=5),
    turns=st.lists(st.floats(-360.0, 360.0), min_size=5, max_size=5),
    at=st.floats(0.0, 1.0),
)
def test_a_flight_has_no_jumps(durations: list[float], turns: list[float], at: float) -> None:
    legs = tuple(
        Leg(duration_s=duration, turn_deg=turn, height_m=30.0, north_m=turn / 40)
        for duration, turn in zip(durations, turns, strict=False)
    )
    scenario = Scenario(flight=Flight(leg=legs))
    time_ns = scenario.start_time_ns + round(at * sum(durations) * 1e9)
    one = scenario.vehicle_pose(time_ns).quaternion_wxyz
    two = scenario.vehicle_pose(time_ns + 1_000_000).quaternion_wxyz
    # 360° in 5 s is at most 90°/s, and gusts and tilt add less than 90°/s: 0.18° in 1 ms.
    assert abs(sum(a * b for a, b in zip(one, two, strict=True))) > np.cos(np.radians(0.1))
    np.testing.assert_allclose(np.linalg.norm(one), 1.0, atol=1e-12)
