"""Tags whose frequency slides within each pulse: listed, or measured in flight."""

from dataclasses import replace

import made
import numpy as np
import pytest

from uavrt.detection.search.grid import Spectrogram, make_grid
from uavrt_experiments.detection.signals import THESIS_TAG, TruePulse, make_samples, noise
from uavrt_experiments.detection.trials import compare, detect

RATE_HZ = 3750.0
SLIDING_TAG = replace(THESIS_TAG, frequency_slide_hz=400.0)


@pytest.mark.parametrize("slide_hz", [0.0, 400.0, -250.0])
def test_the_grid_has_noise_of_one_and_the_whole_energy_of_a_sliding_pulse(
    slide_hz: float,
) -> None:
    grid = make_grid(
        sample_rate_hz=RATE_HZ,
        pulse_width_s=0.02,
        offset_hz=30.0,
        half_width_hz=500.0,
        slide_hz=slide_hz,
    )
    rng = np.random.default_rng(910)
    samples = noise(rng, 200_000)
    assert Spectrogram(grid).push(samples).mean() == pytest.approx(1.0, abs=0.03)
    pulse = TruePulse(start_s=1.0, offset_hz=80.0, enr_db=30.0, slide_hz=slide_hz)
    lead = np.zeros(grid.reach, np.complex64)
    samples = make_samples(rng, [pulse], duration_s=2.0)
    power = Spectrogram(grid).push(np.concatenate((lead, samples)))
    column, row = np.unravel_index(power.argmax(), power.shape)
    assert power.max() > 800.0
    # A cell half a column early is also a part of the slide lower.
    assert abs(grid.offsets_hz[row] - 80.0) < 15.0 + abs(slide_hz) / 16.0
    assert abs(column * grid.hop_s - 1.0) < 0.003


@pytest.mark.parametrize("slide_hz", [400.0, -200.0])
def test_weak_pulses_of_a_listed_slide_are_found_and_measured(slide_hz: float) -> None:
    rng = np.random.default_rng(911)
    truth = made.train(rng, 60.0, 10.0, offset_hz=100.0, jitter_s=0.005, slide_hz=slide_hz)
    tag = replace(THESIS_TAG, frequency_slide_hz=slide_hz)
    pulses, _ = detect(
        make_samples(rng, truth, duration_s=60.0), tag, frequency_window_hz=500.0
    )
    result = compare(pulses, truth, tag)
    assert result.matched >= 0.9 * len(truth)
    assert result.confirmed >= 0.85 * len(truth)
    assert np.median([p.snr_db for p in pulses]) == pytest.approx(10.0, abs=1.0)
    offset_hz = np.median([p.frequency_hz for p in pulses]) - tag.frequency_hz
    assert offset_hz == pytest.approx(100.0, abs=10.0)


def test_a_slide_that_strong_pulses_show_lets_weak_pulses_be_found() -> None:
    rng = np.random.default_rng(912)
    truth = made.train(
        rng,
        80.0,
        lambda time_s: 16.0 if time_s < 30.0 else 10.0,
        offset_hz=100.0,
        jitter_s=0.005,
        slide_hz=-350.0,
    )
    samples = make_samples(rng, truth, duration_s=80.0)
    detector = made.detector(THESIS_TAG, RATE_HZ)
    pulses = detector.process(samples, 0)
    assert detector.slide.hz == pytest.approx(-350.0, abs=60.0)
    late_s = [p.start_s for p in truth if 40.0 < p.start_s < 79.0]
    found_s = np.array([p.start_time_ns * 1e-9 for p in pulses])
    near = [np.abs(found_s - at_s).min() < 0.01 for at_s in late_s]
    assert np.mean(near) >= 0.9
    detector.reset()
    assert detector.slide.hz == 0.0


@pytest.mark.parametrize("enr_db", [9.0, 20.0])
def test_a_tag_of_constant_frequency_is_not_taken_to_slide(enr_db: float) -> None:
    rng = np.random.default_rng(913)
    truth = made.train(rng, 40.0, enr_db, offset_hz=-120.0, jitter_s=0.005)
    detector = made.detector(THESIS_TAG, RATE_HZ)
    assert len(detector.process(make_samples(rng, truth, duration_s=40.0), 0)) > 20
    assert detector.slide.hz == 0.0


def test_noise_makes_no_more_false_groups_with_a_slide() -> None:
    tag = replace(SLIDING_TAG, false_alarm_probability=0.05)
    groups = set()
    for seed in range(4):
        samples = noise(np.random.default_rng(914 + seed), round(300.0 * RATE_HZ))
        pulses, _ = detect(samples, tag, frequency_window_hz=500.0)
        groups |= {(seed, p.rate, p.group_sequence) for p in pulses}
    # 16.8 are expected; of 5 and 31 or more, chance makes each in one of a thousand tests.
    assert 5 < len(groups) < 31
