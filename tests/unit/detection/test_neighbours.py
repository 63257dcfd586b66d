"""A stronger tag in the channel, whose pulses run through the tag's own."""

import numpy as np

from uavrt.detection.search.grid import make_grid
from uavrt.detection.search.refine import Measured, Refiner
from uavrt.detection.signal.sample_buffer import SampleBuffer
from uavrt_experiments.detection.company import Neighbour
from uavrt_experiments.detection.signals import TruePulse, make_samples


def test_a_tag_is_followed_through_the_pulses_of_one_twenty_decibels_stronger() -> None:
    """100 Hz away, 8 ms a pulse apart: nine of our pulses lie in its flanks or beneath."""
    company = Neighbour(apart_hz=100.0, levels_db=(20.0,)).fly(
        np.random.default_rng([501, 11]), 11
    )
    assert company.true - company.confirmed <= 2  # the first two are reported before
    assert company.foreign == 0


def test_a_pulse_taken_out_leaves_the_samples_as_they_were() -> None:
    pulse = TruePulse(start_s=0.1, offset_hz=433.0, enr_db=36.0)
    samples = make_samples(np.random.default_rng(1), [pulse], duration_s=0.3)
    buffer = SampleBuffer(sample_rate_hz=3750.0, keep=5000, tolerance_s=0.002)
    buffer.append(samples, 0)
    grid = make_grid(
        sample_rate_hz=3750.0, pulse_width_s=0.02, offset_hz=333.0, half_width_hz=1e6
    )
    refiner = Refiner(grid, buffer)
    refiner.upto = buffer.end
    known = Measured(start=375.0, offset_hz=433.0, power=4000.0, noise=1.0, contrast=1.0)
    window = buffer.view(375, 450)
    with refiner.without([known]):
        left = float(np.mean(np.abs(window) ** 2))
    assert left < 1.5  # noise of 1, of a pulse of 53
    np.testing.assert_array_equal(buffer.view(0, len(samples)), samples)
