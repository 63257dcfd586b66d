"""Candidates near the threshold are weighed by all that is not known of them."""

import tracemalloc
from dataclasses import replace

import made
import numpy as np
import pytest

from uavrt.detection.search.grid import make_grid
from uavrt.detection.search.group_evidence import Evidence, gate
from uavrt.detection.search.refine import Refiner
from uavrt.detection.signal.sample_buffer import SampleBuffer
from uavrt_experiments.detection.signals import THESIS_TAG, TruePulse, make_samples

RATE_HZ = 3750.0
STARTS_S = (0.5, 1.754, 3.008)


def weigh(levels_db: tuple[float, ...], *, seed: int = 0, strength: float = 9.0) -> float:
    """Evidence for three pulses of some ENR at 200 Hz, where they are expected."""
    pulses = [
        TruePulse(start_s=at, offset_hz=200.0, enr_db=level)
        for at, level in zip(STARTS_S, levels_db, strict=True)
    ]
    samples = make_samples(np.random.default_rng(seed), pulses, duration_s=4.0)
    buffer = SampleBuffer(sample_rate_hz=RATE_HZ, keep=20_000, tolerance_s=0.002)
    buffer.append(samples, 0)
    grid = make_grid(
        sample_rate_hz=RATE_HZ, pulse_width_s=0.02, offset_hz=0.0, half_width_hz=1e6
    )
    refiner = Refiner(grid, buffer)
    refiner.upto = buffer.end
    evidence = Evidence(THESIS_TAG, grid=grid, refiner=refiner)
    return evidence.weigh(np.array(STARTS_S) * RATE_HZ, 200.0, 1.0, strength)


def test_three_even_pulses_outweigh_two_stronger_ones_of_the_same_energy() -> None:
    even = np.mean([weigh((9.5, 9.5, 9.5), seed=seed) for seed in range(12)])
    uneven = np.mean([weigh((11.26, 11.26, -30.0), seed=seed) for seed in range(12)])
    none = np.mean([weigh((-30.0, -30.0, -30.0), seed=seed) for seed in range(12)])
    assert none + 5.0 < uneven < even


def test_no_pulse_counts_for_more_than_the_limit() -> None:
    """A burst of 40 dB in one place is no group, whatever its power."""
    one_burst = weigh((-30.0, 40.0, -30.0))
    assert one_burst < weigh((9.5, 9.5, 9.5))
    assert one_burst == pytest.approx(weigh((-30.0, 60.0, -30.0)), abs=1.0)


def test_noise_is_as_likely_with_pulses_as_without_on_the_average() -> None:
    """The mean over noise is the number of lattices and frequencies, for weak pulses."""
    ratios = [np.exp(weigh((-60.0,) * 3, seed=seed, strength=0.3)) for seed in range(40)]
    everything = np.exp(weigh((-60.0,) * 3, strength=1e-9))
    assert np.mean(ratios) == pytest.approx(everything, rel=0.25)


def test_long_groups_and_single_pulses_are_not_weighed() -> None:
    assert {gate(replace(THESIS_TAG, k=k)) for k in (1, 12, 40)} == {1.0}
    assert gate(replace(THESIS_TAG, k=3)) < 1.0


def test_a_jitter_of_many_pulse_widths_takes_neither_time_nor_memory() -> None:
    """A detector of such a tag took 13 s to make, and 5 GB."""
    tag = replace(THESIS_TAG, k=3, pulse_width_s=0.004, interval_jitter_s=0.5)
    assert gate(tag) == 1.0
    tracemalloc.start()
    made.detector(tag, 7500.0, center_frequency_hz=tag.frequency_hz)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 50e6
