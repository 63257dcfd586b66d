"""A simulated radio that keeps the time of a real one."""

import made
from some import some

from uavrt.core.clock import Clock
from uavrt_experiments.simulated_source import SimulatedSource


def test_a_paced_source_gives_nothing_before_its_time() -> None:
    clock = Clock.start()
    scenario = made.still_scenario().starting_at(clock.now_ns())
    source = SimulatedSource(scenario, block_samples=4800, clock=clock)
    assert source.total_samples is None
    assert source.read(timeout_s=0.0) is None
    for number in range(3):
        some(source.read())
        assert clock.now_ns() >= scenario.start_time_ns + (number + 1) * 100_000_000
