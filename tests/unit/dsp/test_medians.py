"""The faster medians are NumPy's."""

import numpy as np
import pytest

from uavrt.dsp.sliding_medians import medians


@pytest.mark.parametrize("times", [1, 2, 3, 7, 64, 501])
def test_medians_are_those_of_numpy(times: int) -> None:
    rng = np.random.default_rng(times)
    power = rng.exponential(size=(times, 37)).astype(np.float32)
    power[rng.random(power.shape) < 0.2] = 0.5
    given = power.copy()
    found = medians(power)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, np.median(power, axis=0))
    np.testing.assert_array_equal(power, given)
