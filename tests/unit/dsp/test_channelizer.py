from typing import Literal

import numpy as np
import pytest
from filter_response import response_db

from uavrt.core.errors import UsageError
from uavrt.dsp.channelizer import Channelizer
from uavrt.dsp.filters import bank_taps, compatible_bank_taps

Complex = np.ndarray[tuple[int], np.dtype[np.complex64]]


def noise(count: int, seed: int = 1) -> Complex:
    rng = np.random.default_rng(seed)
    return rng.standard_normal((count, 2), dtype=np.float32).view(np.complex64)[:, 0]


def tone(cycles_per_sample: float, count: int) -> Complex:
    turns = cycles_per_sample * np.arange(count)
    samples: Complex = np.exp(2j * np.pi * turns).astype(np.complex64)
    return samples


@pytest.mark.parametrize("in_use", [None, (0, 1, 6, 50, 99)])
def test_the_compatible_bank_is_the_originals_formula(in_use: tuple[int, ...] | None) -> None:
    # The original's bank, evaluated term by term in float64.
    samples = noise(6_000)
    m = np.arange(1201)
    h = np.sinc((m - 600) / 100) / 100 * np.kaiser(1201, 0.1102 * (80 - 8.7))
    h[(m % 100 == 0) & (m != 600)] = 0.0
    padded = np.concatenate((np.zeros(1200), samples.astype(np.complex128)))
    result = Channelizer(mode="compatible", in_use=in_use).process(samples)
    assert result.dtype == np.complex64
    assert result.shape == (100 if in_use is None else len(in_use), 60)
    for row, channel in enumerate(in_use or range(100)):
        weights = h[:1200] * np.exp(2j * np.pi * channel * m[:1200] / 100)
        expected = [weights @ padded[1200 + 100 * n - m[:1200]] for n in range(60)]
        np.testing.assert_allclose(result[row], expected, atol=1e-6)


@pytest.mark.parametrize("in_use", [None, (0, 3, 26, 51, 99)])
@pytest.mark.parametrize("channels", [4, 66, 100])
def test_the_default_bank_is_mix_filter_and_keep_every_hth(
    channels: int, in_use: tuple[int, ...] | None
) -> None:
    if in_use is not None and channels < 100:
        in_use = (0, 3)
    samples = noise(channels * 40)
    taps = bank_taps(channels)
    result = Channelizer(channels=channels, in_use=in_use).process(samples)
    assert result.shape[1] == 80
    index = np.arange(samples.size)
    for row, channel in enumerate(in_use or range(channels)):
        mixed = samples * np.exp(-2j * np.pi * channel * index / channels)
        expected = np.convolve(mixed, taps)[: samples.size : channels // 2]
        np.testing.assert_allclose(result[row], expected, atol=2e-6)


def test_the_compatible_response_is_the_one_measured_on_the_original() -> None:
    offsets = np.array([1100, 1200, 1400, 1500, 1594, 1700, 1800, 1875, 2000, 2200, 2400, 2600])
    expected = [0, -0.03, -0.34, -0.78, -1.48, -2.70, -4.37, -6.02, -9.65, -18.4, -32.5, -59.6]
    taps = compatible_bank_taps(100)
    response = response_db(taps, offsets.astype(np.float64), 375e3)
    np.testing.assert_allclose(response, expected, atol=0.06)
    # The reference's -83 dB holds at 2660 Hz; the formula's highest side lobe is at -79.7.
    assert response_db(taps, np.array([2660.0]), 375e3)[0] <= -82.5
    assert response_db(taps, np.linspace(2660, 30_000, 2_000), 375e3).max() <= -79.5
    # Noise bandwidth: the reference says 0.9056 channels, but its own table of the response
    # integrates to 0.919, and so does the formula.
    assert 100 * float((taps**2).sum()) == pytest.approx(0.9183, abs=1e-4)


def test_no_tag_sits_on_an_edge_of_the_default_bank() -> None:
    # A tag is at most 1875 Hz from a centre, its search window 500 Hz further.
    taps = bank_taps(100)
    flat = response_db(taps, np.linspace(0, 2531, 500), 375e3)
    assert np.ptp(flat) <= 0.002
    # What folds into that lies 7500 - 2531 Hz away and further.
    assert response_db(taps, np.linspace(7500 - 2531, 187_500, 6_000), 375e3).max() <= -80


@pytest.mark.parametrize("mode", ["default", "compatible"])
@pytest.mark.parametrize("channel", [0, 7, 99])
def test_a_short_burst_comes_out_after_the_stated_latency(
    mode: Literal["default", "compatible"], channel: int
) -> None:
    bank = Channelizer(mode=mode, in_use=(channel,))
    samples = np.zeros(60_000, dtype=np.complex64)
    window = np.hanning(2001)
    samples[30_000 - 1000 : 30_000 + 1001] = window * tone(channel / 100, 2001)
    power = np.abs(bank.process(samples)[0]) ** 2
    centroid = float((power * np.arange(power.size)).sum() / power.sum()) / bank.channel_rate_hz
    assert centroid - 30_000 / 375e3 == pytest.approx(bank.latency_s, abs=1e-6)
    assert bank.latency_s == pytest.approx({"default": 400, "compatible": 600}[mode] / 375e3)


def test_few_channels_give_the_same_samples_as_all_channels() -> None:
    samples = noise(20_000)
    everything = Channelizer().process(samples)
    for count in (1, 4, 32, 33, 60):
        chosen = tuple(range(3, 3 + count))[::-1]
        few = Channelizer(in_use=chosen).process(samples)
        np.testing.assert_allclose(few, everything[list(chosen)], atol=2e-6)


def test_rates_and_spacing_are_those_of_the_thesis() -> None:
    assert Channelizer(mode="compatible").channel_rate_hz == 3750
    assert Channelizer().channel_rate_hz == 7500
    assert Channelizer().spacing_hz == 3750


def test_impossible_channels_are_refused() -> None:
    with pytest.raises(UsageError, match="even"):
        Channelizer(channels=101)
    with pytest.raises(UsageError, match="Use 0 to 99"):
        Channelizer(in_use=(100,))
