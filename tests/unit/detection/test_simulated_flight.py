"""The demo's flight, from the simulator through the front end to the detectors.

Strong and weak pulses, an antenna that turns, samples far below 1.0, 7500 S/s channels: what
the synthetic tests beside this file do not have.
"""

import made
import pytest
from depth import share
from some import some

from uavrt.core.messages import Pulse
from uavrt.detection.detector import PulseDetector
from uavrt.dsp.frontend import FrontEnd
from uavrt.simulation.demo.summary import summarize_tag
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.scene.world import World
from uavrt_experiments.simulated_source import SimulatedSource

RATE_HZ = 375_000.0


@pytest.mark.parametrize("seed", share([1, 3], 2))
def test_the_pulses_of_a_turning_drone_are_found(seed: int) -> None:
    scenario = demo_scenario(60.0, seed)
    source = SimulatedSource(
        scenario, center_frequency_hz=148_678_500.0, sample_rate_hz=RATE_HZ, duration_s=60.0
    )
    front_end = FrontEnd(
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=148_678_500.0,
        frequencies_hz=[tag.frequency_hz for tag in scenario.tags],
    )
    detectors: dict[int, PulseDetector] = {}
    found: list[Pulse] = []
    while True:
        try:
            block = source.read()
        except EOFError:
            break
        for channel in front_end.process(some(block)):
            for tag in scenario.tags:
                if front_end.channel_of(tag.frequency_hz) == channel.channel:
                    detector = detectors.setdefault(
                        tag.tag_id,
                        made.detector(
                            tag,
                            channel.sample_rate_hz,
                            center_frequency_hz=channel.center_frequency_hz,
                        ),
                    )
                    found += detector.process(channel.samples, channel.time_ns)
    for detector in detectors.values():
        found += detector.flush()
    truth = World(scenario).truth(
        scenario.start_time_ns, scenario.start_time_ns + 59_500_000_000
    )
    summaries = [summarize_tag(tag, truth, found, []) for tag in scenario.tags]
    detectable = sum(summary.detectable for summary in summaries)
    assert sum(summary.detectable_detected for summary in summaries) >= 0.95 * detectable
    assert sum(summary.false for summary in summaries) <= 3
    for summary in summaries:
        assert abs(some(summary.snr_error_db)) < 0.5
        assert some(summary.frequency_error_hz) < 5.0
        assert some(summary.time_error_ms) < 1.5
