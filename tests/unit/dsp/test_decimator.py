import numpy as np
import pytest
from filter_response import response_db

from uavrt.core.errors import UsageError
from uavrt.dsp.decimator import Decimator
from uavrt.dsp.filters import compatible_decimator_taps, decimator_taps


def noise(count: int, seed: int = 1) -> np.ndarray[tuple[int], np.dtype[np.complex64]]:
    rng = np.random.default_rng(seed)
    parts = rng.standard_normal((count, 2), dtype=np.float32)
    return parts.view(np.complex64)[:, 0]


@pytest.mark.parametrize("mode", ["default", "compatible"])
@pytest.mark.parametrize("factor", [2, 3, 5, 8, 10, 16, 21, 64])
def test_the_output_is_the_convolution_at_every_dth_sample(factor: int, mode: str) -> None:
    decimator = Decimator(
        factor=factor, mode="compatible" if mode == "compatible" else "default"
    )
    samples = noise(30_011)
    expected = np.convolve(samples.astype(np.complex128), decimator.taps)[
        : samples.size : factor
    ]
    result = decimator.process(samples)
    assert result.dtype == np.complex64
    assert result.shape == expected.shape
    np.testing.assert_allclose(result, expected, atol=3e-6)


def test_the_compatible_response_is_the_one_measured_on_the_original() -> None:
    # The original's filters, from its description.
    taps = compatible_decimator_taps(8)
    at = np.array([126e3, 140e3, 150e3, 160e3, 170e3, 187.5e3])
    response = response_db(taps, at, 3e6)
    np.testing.assert_allclose(response, [-0.05, -0.3, -0.7, -1.5, -2.7, -6.0], atol=0.06)
    images = response_db(taps, 375e3 - at[[0, 1, 2, 4]], 3e6)
    np.testing.assert_allclose(images, [-52, -30, -22, -12], atol=0.6)
    assert taps.size == 81
    assert taps.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("factor", [*range(2, 11), 13, 16, 21, 26, 40, 64])
def test_aliases_in_the_clean_span_are_60_db_down_and_the_span_is_flat(factor: int) -> None:
    taps = decimator_taps(factor)
    frequencies = np.linspace(0, factor / 2, 80 * factor)  # in output rates
    response = response_db(taps, frequencies, factor)
    clean = np.abs(frequencies) <= 0.336
    folded = np.abs((frequencies + 0.5) % 1 - 0.5)
    assert response[(folded <= 0.336) & (frequencies > 0.5)].max() <= -60.0
    assert np.ptp(response[clean]) <= 0.02
    assert np.array_equal(taps, taps[::-1])


def test_an_impulse_comes_out_after_the_stated_latency() -> None:
    decimator = Decimator(factor=8, sample_rate_hz=3e6)
    samples = np.zeros(40_000, dtype=np.complex64)
    samples[16_000] = 1.0
    power = np.abs(decimator.process(samples)) ** 2
    centroid = float((power * np.arange(power.size)).sum() / power.sum())
    assert centroid * 8 / 3e6 - 16_000 / 3e6 == pytest.approx(decimator.latency_s, abs=1e-6)
    assert decimator.latency_s == pytest.approx(15e-6)


def test_a_reset_decimator_is_as_new() -> None:
    used, new = Decimator(factor=5), Decimator(factor=5)
    used.process(noise(1003))
    used.reset()
    assert np.array_equal(used.process(noise(500, 2)), new.process(noise(500, 2)))


@pytest.mark.parametrize("factor", [1, 0, 65])
def test_a_factor_out_of_range_is_refused(factor: int) -> None:
    with pytest.raises(UsageError, match="Use 2 to 64"):
        Decimator(factor=factor)
