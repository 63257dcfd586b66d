import made
import numpy as np
import pytest

from uavrt.radio.source import SampleSource
from uavrt.simulation.synthesis import IQSynthesizer
from uavrt_experiments.simulated_source import SimulatedSource


def test_blocks_follow_one_another_to_the_end() -> None:
    scenario = made.still_scenario()
    source: SampleSource = SimulatedSource(scenario, duration_s=2.5, block_samples=7000)
    assert source.total_samples == 120_000
    assert (source.sample_rate_hz, source.center_frequency_hz) == (48_000.0, 150e6)
    blocks: list[np.ndarray] = []
    while (done := sum(part.size for part in blocks)) < 120_000:
        block = source.read()
        assert block is not None
        assert (block.sample_index, block.lost_before) == (done, 0)
        assert block.time_ns == scenario.start_time_ns + round(done / 48_000.0 * 1e9)
        blocks.append(block.samples)
    with pytest.raises(EOFError):
        source.read()
    np.testing.assert_array_equal(
        np.concatenate(blocks), IQSynthesizer(scenario).block(0, 120_000)
    )


def test_a_closed_source_has_ended() -> None:
    source = SimulatedSource(made.still_scenario())
    source.close()
    source.close()
    with pytest.raises(EOFError):
        source.read()
