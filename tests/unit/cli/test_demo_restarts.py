"""What the demo counts as false after a receiver was killed whose reports never came."""

import made

from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.simulation.demo.summary import sampled_span, summarize_tag
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.scene.world import World


def test_pulses_before_the_first_reported_sample_are_not_false() -> None:
    scenario = demo_scenario(60.0)
    world, begin_ns = World(scenario), scenario.start_time_ns
    end_ns = begin_ns + 60 * NANOSECONDS_PER_SECOND
    recorded = [
        made.pulse(one.start_time_ns + 1000, tag_id=one.tag_id, frequency_hz=one.frequency_hz)
        for one in world.truth(begin_ns, end_ns)
    ]
    reported = (begin_ns + 20 * NANOSECONDS_PER_SECOND, end_ns - 9 * NANOSECONDS_PER_SECOND)
    truth = world.truth(*sampled_span(*reported, recorded))
    for tag in scenario.tags:
        found = summarize_tag(tag, truth, recorded, [])
        assert (found.false, found.detected) == (0, found.transmitted)
        assert found.transmitted > 30
    assert sampled_span(*reported, []) == reported
