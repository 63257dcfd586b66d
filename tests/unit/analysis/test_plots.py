"""Pictures of a detection: what goes into them, and that they are drawn."""

from dataclasses import replace
from pathlib import Path

import made
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavrt.analysis.measure.waterfall import COLUMNS, MaximumHold, Waterfall
from uavrt.analysis.report.plots import DetectionPlots, draw_beat, draw_snr, draw_waterfall
from uavrt.core.errors import RecordingError
from uavrt.core.messages import ChannelBlock, Pulse

RATE_HZ = 3750.0
START_NS = 1_777_788_000_000_000_000  # 2026-05-03T06:00:00Z
TAG = made.tag(2, 148_710_000.0, 1.254, 2.0, name="Lüna $5")


def noise(count: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.standard_normal((count, 2)).view(complex).ravel().astype(np.complex64)


def block(samples: np.ndarray, first: int, *, channel: int = 0) -> ChannelBlock:
    return made.channel_block(
        samples,
        first,
        RATE_HZ,
        channel=channel,
        center_frequency_hz=148_709_000.0,
        time_ns=START_NS + round(first * 1e9 / RATE_HZ),
    )


def pulse(number: int, *, rate: int = 1, status: str = "confirmed") -> Pulse:
    start_ns = START_NS + round((0.5 + number * (1.26 if rate == 1 else 2.0)) * 1e9)
    return made.pulse(
        start_ns,
        frequency_hz=148_710_200.0 + number,
        snr_db=12.0 + number % 5,
        noise_psd=1e-9,
        detection_status=status,
        confirmed=status == "confirmed",
        rate=rate,
    )


def waterfall(offset_hz: float = 1000.0, half_width_hz: float = 600.0) -> Waterfall:
    return Waterfall(
        offset_hz=offset_hz,
        half_width_hz=half_width_hz,
        sample_rate_hz=RATE_HZ,
        pulse_width_s=0.02,
    )


@settings(deadline=None, max_examples=60)
@given(st.lists(st.integers(1, 40), min_size=1, max_size=12), st.sampled_from([4, 8, 32]))
def test_joined_columns_hold_the_maximum_of_what_they_cover(
    parts: list[int], columns: int
) -> None:
    values = np.random.default_rng(1).uniform(1, 2, (sum(parts), 3)).astype(np.float32)
    hold, first = MaximumHold(3, columns), 0
    for count in parts:
        hold.put(first, values[first : first + count])
        first += count
    step = hold.frames_per_column
    assert len(hold.values) <= columns
    assert step == 1 or len(hold.values) > columns // 2
    for column, held in enumerate(hold.values):
        covered = values[column * step : (column + 1) * step]
        np.testing.assert_array_equal(held, covered.max(axis=0))


def test_a_pulse_shows_at_its_time_and_frequency_however_long_the_recording() -> None:
    for seconds, at_s in ((5.0, 3.2), (120.0, 77.7)):
        samples = noise(int(seconds * RATE_HZ))
        n = np.arange(int(at_s * RATE_HZ), int((at_s + 0.02) * RATE_HZ))
        samples[n] += 6.0 * np.exp(2j * np.pi * 1150.0 / RATE_HZ * n)
        shown = waterfall()
        for first in range(0, samples.size, 1000):
            shown.add(block(samples[first : first + 1000], first))
        column, row = np.unravel_index(int(shown.power.argmax()), shown.power.shape)
        begin_s = column * shown.column_s
        assert begin_s - 0.03 <= at_s <= begin_s + shown.column_s + 0.02
        assert abs(shown.frequencies_hz[row] - 150.0) < 30.0
        assert COLUMNS / 3 < len(shown.power) <= COLUMNS
        assert abs(int(shown.trace.argmax()) * shown.trace_s + 0.015 - at_s - 0.01) < 0.015


def test_white_noise_has_its_density_in_every_cell() -> None:
    shown = waterfall()
    shown.add(block(noise(int(10 * RATE_HZ)) * np.float32(0.1), 0))
    # Power 0.02 over 3750 Hz. A frame's power is exponential; the columns hold single frames.
    assert abs(shown.power.mean() / (0.02 / RATE_HZ) - 1.0) < 0.05


def test_missing_samples_are_missing_cells() -> None:
    shown = waterfall()
    shown.add(block(noise(3750), 0))
    shown.add(block(noise(3750), 3 * 3750))
    gap = (shown.power == 0.0).all(axis=1)
    at_s = np.flatnonzero(gap) * shown.column_s
    assert 0.95 < at_s.min() < 1.05
    assert 2.95 < at_s.max() < 3.05


@pytest.mark.parametrize("ppm", [-50.0, 50.0])
def test_a_crystal_that_is_off_does_not_move_a_pulse(ppm: float) -> None:
    count = round(3000 * RATE_HZ)
    samples = noise(3750, 2) * np.float32(0.01)
    shown = waterfall()
    for first in range(0, count, 3750):
        one = block(samples, first)
        time_ns = one.time_ns + round(first / RATE_HZ * ppm * 1e3)
        if first == 2990 * 3750:
            tone = np.zeros(3750, np.complex64)
            tone[:75] = np.exp(2j * np.pi * 1150.0 / RATE_HZ * np.arange(75))
            one = replace(one, samples=samples + tone)
            at_s = (time_ns - block(samples, 0).time_ns) / 1e9
        shown.add(replace(one, time_ns=time_ns))
    found_s = int(shown.trace.argmax()) * shown.trace_s + shown.frame_center_s
    assert found_s == pytest.approx(at_s + 0.01, abs=0.02)


def picture_size(path: Path) -> int:
    content = path.read_bytes()
    assert content.startswith(b"\x89PNG")
    return len(content)


def test_each_tag_gets_three_pictures(tmp_path: Path) -> None:
    plots = DetectionPlots(tmp_path / "pictures", [TAG])
    for first in range(0, 40 * 3750, 3750):
        plots.add_block(block(noise(3750, first), first))
        plots.add_block(block(noise(3750, first), first, channel=7))  # a channel farther off
    plots.add_pulses([pulse(n, status="detected" if n < 3 else "confirmed") for n in range(12)])
    plots.add_pulses([pulse(n, rate=2) for n in range(10, 18)])
    written = plots.write()
    assert [path.name for path in written] == [
        "tag_2_waterfall.png",
        "tag_2_beat.png",
        "tag_2_snr.png",
    ]
    assert all(picture_size(path) > 20_000 for path in written)


def test_pictures_say_units_time_scale_and_what_was_found() -> None:
    shown = waterfall()
    shown.add(block(noise(20 * 3750), 0))
    pulses = [pulse(n, status="subthreshold" if n == 3 else "confirmed") for n in range(12)]

    def texts(figure: object) -> str:
        from matplotlib.text import Text

        return "\n".join(text.get_text() for text in figure.findobj(Text))  # type: ignore[attr-defined]

    said = texts(draw_waterfall(TAG, shown, pulses))
    assert "UTC, 2026-05-03" in said
    assert "Offset from 148.710000 MHz [Hz]" in said
    assert "Level over noise [dB]" in said
    assert "11 confirmed" in said
    assert "1 below the threshold" in said
    assert "Tag 2 Lüna 5" in said  # a dollar sign would begin an equation
    said = texts(draw_snr(TAG, shown, pulses))
    assert "[dB]" in said
    assert "UTC" in said
    said = texts(draw_beat(TAG, shown, pulses))
    assert "folded at 1260.00 ms" in said
    assert "[ms]" in said


def test_without_pulses_the_pictures_say_so(tmp_path: Path) -> None:
    plots = DetectionPlots(tmp_path, [TAG])
    plots.add_block(block(noise(3750), 0))
    assert len(plots.write()) == 3


@pytest.mark.parametrize("count", [0, 15])
def test_without_samples_or_with_less_than_a_column_there_are_no_pictures(
    tmp_path: Path, count: int
) -> None:
    plots = DetectionPlots(tmp_path, [TAG])
    if count:
        plots.add_block(block(noise(count), 0))
    assert plots.write() == []


def test_half_a_decibel_of_scatter_does_not_fill_the_picture() -> None:
    shown = waterfall()
    shown.add(block(noise(20_000), 0))
    upper, lower = draw_snr(TAG, shown, [pulse(0), pulse(5)]).axes
    assert np.diff(upper.get_ylim()) == pytest.approx(6.0)
    assert np.diff(lower.get_ylim()) == pytest.approx(20.0)


def test_a_place_that_is_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "here").write_text("")
    with pytest.raises(RecordingError, match="here"):
        DetectionPlots(tmp_path / "here", [TAG])
