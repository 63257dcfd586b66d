"""The times of samples behind gaps and where the clock was corrected."""

import numpy as np
import pytest

from uavrt.dsp.block_times import BlockTimes

RATE_HZ = 1000.0
START_NS = 1_714_543_200_000_000_000


def times_of(*stamps: tuple[int, float]) -> BlockTimes:
    """Blocks by the index of their first sample and its time since the start [s]."""
    times = BlockTimes(RATE_HZ)
    for index, at_s in stamps:
        times.add(index, START_NS + round(at_s * 1e9))
    return times


def test_each_block_counts_from_its_own_time() -> None:
    times = times_of((0, 0.0), (1000, 1.0), (2000, 2.7), (3000, 3.7))
    for index, at_s in ((0, 0.0), (-10, -0.01), (1999, 1.999), (2000, 2.7), (3500.5, 4.2005)):
        assert times.time_ns(index) - START_NS == pytest.approx(at_s * 1e9, abs=1)
        assert times.index(START_NS + round(at_s * 1e9)) == pytest.approx(index, abs=1e-3)
    found = times.seconds(np.array([2000.0, 0.0, 1999.0]), START_NS)
    assert found == pytest.approx([2.7, 0.0, 1.999], abs=1e-9)
    assert times.start_ns == START_NS


def test_a_time_within_a_gap_is_at_a_sample_that_was_lost() -> None:
    # Of 700 lost samples 640 were counted: the crystal was slow.
    times = times_of((0, 0.0), (2640, 2.7))
    for at_s in (2.01, 2.3, 2.63):
        assert 2000 < times.index(START_NS + round(at_s * 1e9)) < 2640
    # What was not counted is at the first sample after it.
    assert times.index(START_NS + 2_670_000_000) == 2640.0


def test_a_time_that_came_twice_is_at_the_first_of_both() -> None:
    times = times_of((0, 0.0), (2000, 1.94))
    assert times.index(START_NS + 1_950_000_000) == pytest.approx(1950.0)
    assert times.index(START_NS + 2_000_000_000) == pytest.approx(2060.0)


def test_a_crystal_that_is_off_is_followed() -> None:
    ppm = 50.0
    stamps = [(index, index / RATE_HZ * (1.0 + 1e-6 * ppm)) for index in range(0, 10**6, 100)]
    times = times_of(*stamps)
    for index, at_s in stamps[::997]:
        assert times.time_ns(index) - START_NS == pytest.approx(at_s * 1e9, abs=1e5)


def test_without_blocks_there_is_no_sample() -> None:
    with pytest.raises(ValueError, match="no block"):
        BlockTimes(RATE_HZ).index(START_NS)
    assert BlockTimes(RATE_HZ).start_ns == 0
