"""Clipping: samples at a converter's limits, and sources that have none."""

import made
import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.dsp.clipping import Clipping

RATE_HZ = 48_000.0


def share(samples: NDArray[np.complex64]) -> float:
    clipping = Clipping()
    for first in range(0, len(samples), 4800):
        clipping.check(made.iq_block(samples[first : first + 4800], first, RATE_HZ))
    return clipping.share


def noise(scale: float) -> NDArray[np.complex64]:
    values = np.random.default_rng(3).normal(0.0, scale, (48_000, 2))
    return np.ascontiguousarray(values, np.float32).view(np.complex64)[:, 0]


@pytest.mark.parametrize("gain", [1.0, 1.2], ids=["converter", "filter beyond full scale"])
def test_what_a_converter_cut_off_is_clipped(gain: float) -> None:
    parts = np.clip(noise(0.5).view(np.float32), -1.0, 1.0) * np.float32(gain)
    assert share(parts.view(np.complex64)) > 0.5


def test_computed_samples_have_no_full_scale_to_be_clipped_at() -> None:
    assert share(noise(0.707)) == 0.0
