"""Noise whose level changes is divided out of the cells, whatever else is in them."""

import made
import numpy as np
import pytest
from numpy.typing import NDArray
from streams import add_pulses, fed

from uavrt.detection.search.grid import Spectrogram, make_grid
from uavrt.detection.search.levelling import Leveller
from uavrt.detection.search.refine import Measured, Refiner
from uavrt.detection.signal.sample_buffer import SampleBuffer
from uavrt_experiments.detection.rising import Rise, rising_noise
from uavrt_experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    TruePulse,
    noise,
)

RATE_HZ = 3750.0
GRID = make_grid(sample_rate_hz=RATE_HZ, pulse_width_s=0.02, offset_hz=0.0, half_width_hz=500.0)
STEP = 176
"""Columns of a step of a detector."""


def levelled(samples: NDArray[np.complex64]) -> tuple[NDArray[np.float32], Leveller]:
    """Cells of a stream after a leveller, and the leveller itself."""
    power = np.ascontiguousarray(Spectrogram(GRID).push(samples).T)
    leveller = Leveller(rows=GRID.rows, keep=20 * STEP, steepness=9.0)
    unit = np.ones(GRID.rows, np.float32)
    for first in range(0, power.shape[1] - STEP, STEP):
        leveller.level(power[:, first : first + STEP], unit, first)
    return power[:, : power.shape[1] // STEP * STEP - STEP], leveller


def columns(begin_s: float, end_s: float) -> slice:
    return slice(round(begin_s / GRID.hop_s), round(end_s / GRID.hop_s))


@pytest.mark.parametrize("depth_db", [1.5, 6.0, 20.0])
@pytest.mark.parametrize("up_s", [0.01, 1.0])
def test_a_rise_and_a_fall_leave_steady_noise(depth_db: float, up_s: float) -> None:
    rng = np.random.default_rng(3)
    rise = Rise(depth_db=depth_db, up_s=up_s, down_s=up_s, high_s=3.0, low_s=9.0, first_s=4.0)
    means = []
    for _ in range(4):
        cells, _ = levelled(rising_noise(rng, round(12 * RATE_HZ), rise))
        means.append(
            [
                cells[:, columns(a, b)].mean()
                for a, b in ((2.0, 3.9), (4.1, 4.5), (4.5, 4.0 + up_s + 3.0), (8.6, 11.0))
            ]
        )
    # A little more than the noise is taken for it, most where it changes.
    mean = np.mean(means, axis=0)
    assert (mean < 1.12).all()
    assert (mean > 0.7).all()


def test_rows_that_rise_beside_others_are_levelled_by_themselves() -> None:
    rng = np.random.default_rng(4)
    rise = Rise(depth_db=10.0, up_s=0.05, down_s=0.05, high_s=4.0, low_s=9.0, first_s=4.0)
    means = []
    for _ in range(4):
        samples = rising_noise(rng, round(9 * RATE_HZ), rise, above_hz=0.0)
        cells, leveller = levelled(samples)
        high = cells[:, columns(4.4, 7.9)].mean(axis=1)
        means.append([high[:32].mean(), high[50:].mean()])
        assert 7.0 < leveller.record.at(70, columns(5.0, 6.0).start) < 13.0
        assert 0.7 < leveller.record.at(8, columns(5.0, 6.0).start) < 1.5
    quiet, loud = np.mean(means, axis=0)
    assert 0.85 < quiet < 1.1
    assert 0.85 < loud < 1.1


@pytest.mark.parametrize("enr_db", [20.0, 40.0, 60.0])
def test_a_strong_pulse_is_no_rise_of_the_noise(enr_db: float) -> None:
    rng = np.random.default_rng(5)
    samples = noise(rng, round(10 * RATE_HZ))
    starts_s = np.arange(1.0, 9.0, 0.7)
    add_pulses(
        samples,
        [TruePulse(start_s=at_s, offset_hz=40.0, enr_db=enr_db) for at_s in starts_s.tolist()],
    )
    _, leveller = levelled(samples)
    levels = [leveller.record.at(44, round(start_s / GRID.hop_s)) for start_s in starts_s[:-2]]
    assert max(abs(10.0 * np.log10(levels))) < 1.0


def test_after_a_fall_no_moment_is_told_as_loud_as_before() -> None:
    # The newest slots of each step once were, for 0.8 s: a tag's pulses there were lost.
    rng = np.random.default_rng(8)
    rise = Rise(depth_db=20.0, up_s=0.01, down_s=0.01, high_s=1.0, low_s=1.0, first_s=2.0)
    power = np.ascontiguousarray(
        Spectrogram(GRID).push(rising_noise(rng, round(8 * RATE_HZ), rise)).T
    )
    leveller = Leveller(rows=GRID.rows, keep=20 * STEP, steepness=9.0)
    unit = np.ones(GRID.rows, np.float32)
    told = []
    for first in range(0, power.shape[1] - STEP, STEP):
        leveller.level(power[:, first : first + STEP], unit, first)
        # As a track asks that has waited for these columns.
        told += [(c, leveller.record.at(40, c)) for c in range(first + STEP - 60, first + STEP)]
    quiet = [
        level
        for column, level in told
        if rise.level_db(np.arange(-0.1, 0.1, 0.01) + column * GRID.hop_s).max() == 0.0
    ]
    assert len(quiet) > 200
    assert max(quiet) < 4.0


def test_loud_noise_is_no_impulse_though_most_of_a_step_is_quiet() -> None:
    rng = np.random.default_rng(10)
    samples = noise(rng, 1000)
    samples[:620] *= np.float32(10.0)
    pulse = TruePulse(start_s=500 / RATE_HZ, offset_hz=40.0, enr_db=34.0)
    add_pulses(samples, [pulse])
    buffer = SampleBuffer(sample_rate_hz=RATE_HZ, keep=len(samples), tolerance_s=0.02)
    buffer.append(samples, START_NS)
    refiner = Refiner(GRID, buffer)
    refiner.upto = buffer.end
    measured = Measured(start=500.0, offset_hz=40.0, power=25.0, noise=100.0, contrast=1.0)
    assert not refiner.is_impulse(measured, floor=1.0)


def test_silence_and_what_follows_it_are_survived() -> None:
    rng = np.random.default_rng(6)
    samples = noise(rng, round(12 * RATE_HZ))
    samples[round(4 * RATE_HZ) : round(6 * RATE_HZ)] = 0.0
    cells, _ = levelled(samples)
    assert np.isfinite(cells).all()
    assert 0.8 < cells[:, columns(7.0, 11.0)].mean() < 1.2


def test_the_noise_that_is_told_follows_a_step() -> None:
    samples = noise(np.random.default_rng(7), round(24 * RATE_HZ))
    samples[round(12 * RATE_HZ) :] *= np.float32(10.0)
    detector = made.detector(THESIS_TAG, RATE_HZ)
    fed(detector, samples)
    told = [(r.time_ns - START_NS, r.noise_psd * RATE_HZ) for r in detector.search_reports()]
    before = [psd for at, psd in told if 3e9 < at < 12e9]
    after = [psd for at, psd in told if at > 12.6e9]
    assert before == pytest.approx([1.0] * len(before), rel=0.15)
    assert after == pytest.approx([100.0] * len(after), rel=0.15)
