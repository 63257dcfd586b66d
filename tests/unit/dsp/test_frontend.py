from typing import Literal

import made
import numpy as np
import pytest

from uavrt.core.errors import TunerError, UsageError
from uavrt.core.messages import ChannelBlock, IQBlock
from uavrt.dsp.frontend import FrontEnd

CENTER_HZ = 148.7e6
START_NS = 1_700_205_419_230_494_976
Mode = Literal["default", "compatible"]
Complex = np.ndarray[tuple[int], np.dtype[np.complex64]]


def front(rate_hz: float, *offsets_hz: float, mode: Mode = "default") -> FrontEnd:
    """Make a front end for tags at some offsets from the centre."""
    tags_hz = [CENTER_HZ + offset_hz for offset_hz in offsets_hz]
    return FrontEnd(
        sample_rate_hz=rate_hz, center_frequency_hz=CENTER_HZ, frequencies_hz=tags_hz, mode=mode
    )


def block(samples: Complex, index: int, rate_hz: float, lost: int = 0) -> IQBlock:
    return made.iq_block(samples, index, rate_hz, start_ns=START_NS, lost_before=lost)


def burst(start: int, length: int, offset_hz: float, rate_hz: float) -> Complex:
    """A pulse with soft edges, as a function of the absolute sample index."""
    index = np.arange(start, start + length)
    samples: Complex = (
        np.hanning(length) * np.exp(2j * np.pi * offset_hz / rate_hz * index)
    ).astype(np.complex64)
    return samples


def centroid_ns(blocks: list[ChannelBlock]) -> float:
    """Power-weighted mean time of all samples, relative to START_NS."""
    power = time = 0.0
    for part in blocks:
        weights = np.abs(part.samples.astype(np.complex128)) ** 2
        index = np.arange(weights.size)
        times = part.time_ns - START_NS + index * 1e9 / part.sample_rate_hz
        power += float(weights.sum())
        time += float(weights @ times)
    return time / power


@pytest.mark.parametrize("mode", ["default", "compatible"])
@pytest.mark.parametrize(
    ("rate_hz", "factor"),
    [
        (3e6, 8),
        (6e6, 16),
        (2.4e6, 6),
        (250e3, 1),
        (1.024e6, 2),
        (2.048e6, 5),
        (768e3, 2),
        (384e3, 1),
        (192e3, 1),
        (2e6, 5),
        (4e6, 10),
        (8e6, 21),
        (10e6, 26),
        (20e6, 53),
        (48e3, 1),
    ],
)
def test_every_usual_rate_gets_channels_of_the_thesis_width_and_right_times(
    rate_hz: float, factor: int, mode: Mode
) -> None:
    offset_hz = 0.2 * min(rate_hz, 375e3)
    front_end = front(rate_hz, offset_hz, mode=mode)
    plan = front_end.plan
    assert plan.decimation_factor == factor
    assert 3500 <= plan.channel_spacing_hz <= 4200
    rate = plan.channel_spacing_hz * (2 if mode == "default" else 1)
    assert plan.channel_rate_hz == pytest.approx(rate)
    length = round(0.02 * rate_hz)
    start = round(0.03 * rate_hz)
    samples = np.zeros(round(0.08 * rate_hz), dtype=np.complex64)
    samples[start : start + length] = burst(start, length, offset_hz, rate_hz)
    channels = front_end.process(block(samples, 0, rate_hz))
    assert [part.channel for part in channels] == list(plan.channels_in_use)
    expected = (start + (length - 1) / 2) * 1e9 / rate_hz
    # In the compatible bank a tag near an edge is aliased; its time is still good.
    assert centroid_ns(channels) == pytest.approx(expected, abs=1000)


@pytest.mark.parametrize("rate_hz", [3000.0, 3750.0, 7500.0, 10_000.0])
def test_a_slow_recording_is_one_channel_and_passes_untouched(rate_hz: float) -> None:
    front_end = front(rate_hz, 900.0)
    samples = np.arange(10).astype(np.complex64)
    (channel,) = front_end.process(block(samples, 40, rate_hz, lost=3))
    np.testing.assert_array_equal(channel.samples, samples)
    # Blocks of channels wait until they are searched; a source writes over what it gave.
    assert not np.shares_memory(channel.samples, samples)
    assert (channel.channel, channel.sample_index, channel.lost_before) == (0, 40, 3)
    assert channel.center_frequency_hz == CENTER_HZ
    assert channel.sample_rate_hz == rate_hz
    assert front_end.plan.latency_s == 0.0


def test_a_tag_appears_in_its_channel_at_its_offset() -> None:
    offsets_hz = [-100e3, 1234.0, 61_875.0, 126e3]
    front_end = front(3e6, *offsets_hz)
    index = np.arange(600_000)
    for offset_hz, number in zip(offsets_hz, front_end.plan.frequency_channels, strict=True):
        tag = CENTER_HZ + offset_hz
        assert front_end.channel_of(tag) == number
        front_end.reset()
        tone = np.exp(2j * np.pi * offset_hz / 3e6 * index).astype(np.complex64)
        channels = {part.channel: part for part in front_end.process(block(tone, 0, 3e6))}
        part = channels[number]
        settled = part.samples[20:]
        step = np.angle(np.vdot(settled[:-1], settled[1:]))
        frequency = part.center_frequency_hz + step * part.sample_rate_hz / (2 * np.pi)
        assert frequency == pytest.approx(tag, abs=0.05)
        assert np.abs(settled) == pytest.approx(1.0, abs=0.003)


def test_band_times_and_rates_follow_the_measured_rate() -> None:
    front_end = front(3e6, 5e3)
    measured = 3e6 * (1 + 150e-6)
    first = block(np.zeros(80_000, dtype=np.complex64), 0, measured)
    second = block(np.zeros(80_000, dtype=np.complex64), 80_000, measured)
    band = front_end.decimate(first)
    assert band.sample_rate_hz == pytest.approx(measured / 8)
    assert band.time_ns == START_NS - 15_000 + 2  # 45 samples of a slightly fast clock
    (channel,) = front_end.channelize(band)
    (following,) = front_end.process(second)
    assert channel.sample_rate_hz == pytest.approx(measured / 400)
    assert following.sample_index == channel.sample_index + channel.samples.size
    step = following.sample_index * 400 / measured * 1e9
    assert following.time_ns - channel.time_ns == pytest.approx(step, abs=2)


def test_frequencies_outside_the_span_are_all_named() -> None:
    both = r"148\.500000, 149\.000000 MHz.*Tune the radio"
    with pytest.raises(TunerError, match=both) as info:
        front(250e3, -200e3, 10e3, 300e3)
    assert "148.71" not in str(info.value)
    front_end = front(3e6, 0.0)
    for outside_hz in (CENTER_HZ + 130e3, float("nan")):
        with pytest.raises(TunerError, match="span"):
            front_end.channel_of(outside_hz)


def test_a_tag_beyond_the_usual_band_widens_it() -> None:
    plan = front(3e6, -10e3, 400e3).plan
    assert plan.decimation_factor == 2
    assert plan.usable_half_span_hz >= 400e3


@pytest.mark.parametrize("rate_hz", [0.0, -3e6, 2999.0, 1e9, float("nan")])
def test_a_rate_that_cannot_be_served_is_refused(rate_hz: float) -> None:
    with pytest.raises(UsageError, match="sample rate"):
        front(rate_hz)


def test_without_frequencies_every_channel_is_computed() -> None:
    channels = front(3e6).process(block(np.zeros(8000, dtype=np.complex64), 0, 3e6))
    assert [part.channel for part in channels] == list(range(100))
    centers = [part.center_frequency_hz - CENTER_HZ for part in channels]
    assert centers[:3] == [0, 3750, 7500]
    assert centers[49:52] == [183_750, -187_500, -183_750]
    # Too few samples for an output give no blocks.
    assert front(3e6).process(block(np.zeros(392, dtype=np.complex64), 0, 3e6)) == []


def test_a_short_gap_is_a_gap_in_the_band_and_zeros_in_the_channels() -> None:
    front_end = front(3e6, 5e3)
    ones = np.ones(80_000, dtype=np.complex64)
    band = front_end.decimate(block(ones, 0, 3e6))
    after = front_end.decimate(block(ones, 100_000, 3e6, lost=20_000))
    assert (band.lost_before, after.lost_before) == (0, 2500)
    assert after.sample_index == band.sample_index + band.samples.size + 2500
    (first,) = front_end.channelize(band)
    (second,) = front_end.channelize(after)
    assert second.sample_index == first.sample_index + first.samples.size
    assert second.lost_before == 0


def test_a_long_gap_is_reported_in_samples_of_the_channel() -> None:
    front_end = front(3e6, 5e3)
    ones = np.ones(80_000, dtype=np.complex64)
    (first,) = front_end.process(block(ones, 0, 3e6))
    (second,) = front_end.process(block(ones, 8_000_003, 3e6, lost=7_920_003))
    assert second.sample_index == first.sample_index + first.samples.size + second.lost_before
    assert second.lost_before == 8_000_003 // 400 - 200
    expected = second.sample_index * 400 / 3e6 * 1e9 - front_end.plan.latency_s * 1e9
    assert second.time_ns - START_NS == pytest.approx(expected, abs=2)


def test_a_source_that_starts_again_starts_the_front_end_again() -> None:
    front_end = front(3e6, 5e3)
    ones = np.ones(80_000, dtype=np.complex64)
    front_end.process(block(ones, 400_000, 3e6))
    (again,) = front_end.process(block(ones, 0, 3e6))
    assert (again.sample_index, again.lost_before) == (0, 0)
    assert np.abs(again.samples[0]) < 1e-6
