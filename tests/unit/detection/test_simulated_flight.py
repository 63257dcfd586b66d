"""The demo's flight, from the simulator through the front end to the detectors.

Strong and weak pulses, an antenna that turns, samples far below 1.0, 7500 S/s channels: what
the synthetic tests beside this file do not have.
"""

import pytest
from depth import share
from some import some

from uavrt.analysis.measure.recorded_pulses import detect
from uavrt.core.messages import Pulse
from uavrt.simulation.demo.summary import summarize_tag
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.scene.world import World
from uavrt_experiments.simulated_source import SimulatedSource


@pytest.mark.parametrize("seed", share([1, 3], 2))
def test_the_pulses_of_a_turning_drone_are_found(seed: int) -> None:
    scenario = demo_scenario(60.0, seed)
    source = SimulatedSource(
        scenario, center_frequency_hz=148_678_500.0, sample_rate_hz=375e3, duration_s=60.0
    )
    found: list[Pulse] = []
    detect(source, scenario.tags, found.extend)
    start_ns = scenario.start_time_ns
    truth = World(scenario).truth(start_ns, start_ns + 59_500_000_000)
    summaries = [summarize_tag(tag, truth, found, []) for tag in scenario.tags]
    detectable = sum(summary.detectable for summary in summaries)
    assert sum(summary.detectable_detected for summary in summaries) >= 0.95 * detectable
    assert sum(summary.false for summary in summaries) <= 3
    for summary in summaries:
        assert abs(some(summary.snr_error_db)) < 0.5
        assert some(summary.frequency_error_hz) < 5.0
        assert some(summary.time_error_ms) < 1.5
