"""Energies of slots: standard in noise, nothing where nothing was heard."""

import numpy as np
import pytest

from uavrt.localization.whole_flight.energies.energy_grid import (
    SlotEnergies,
    gather,
    slot_energies,
)
from uavrt_experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    TruePulse,
    add_pulse,
    noise,
)

RATE_HZ = 3750.0


def energies(samples: np.ndarray, there: np.ndarray | None = None) -> SlotEnergies:
    return slot_energies(
        samples,
        np.ones(len(samples), bool) if there is None else there,
        tag=THESIS_TAG,
        start_ns=START_NS,
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=THESIS_TAG.frequency_hz,
        frequency_window_hz=200.0,
    )


def since_start_s(found: SlotEnergies) -> np.ndarray:
    return found.time_s + (found.start_ns - START_NS) * 1e-9


def test_noise_of_any_level_and_slope_is_standard() -> None:
    samples = noise(np.random.default_rng(1), 150_000)
    samples *= np.linspace(1.0, 4.0, len(samples)).astype(np.float32)
    found = energies(samples)
    heard = found.energy[:, found.heard]
    assert heard.mean() == pytest.approx(0.0, abs=1e-3)
    assert heard.std() == pytest.approx(1.0, abs=1e-3)
    assert found.heard.mean() > 0.98
    skewness = (heard.astype(np.float64) ** 3).mean(axis=1)
    assert np.all((skewness > 1.0) & (skewness < 1.8))


def test_missing_samples_and_loud_signals_say_nothing() -> None:
    samples = noise(np.random.default_rng(2), 150_000)
    there = np.ones(len(samples), bool)
    there[40_000:60_000] = False
    samples[~there] = 0.0
    loud = TruePulse(start_s=30.0, offset_hz=50.0, enr_db=30.0)
    add_pulse(samples, loud, sample_rate_hz=RATE_HZ, width_s=0.02, phase=0.0)
    found = energies(samples, there)
    time_s = since_start_s(found)
    inside = (time_s > 40_000 / RATE_HZ) & (time_s < 60_000 / RATE_HZ)
    assert not found.heard[inside].any()
    assert not found.heard[np.abs(time_s - 30.01) < 0.03].any()
    assert np.all(found.energy[:, ~found.heard] == 0.0)
    assert found.left_out > 0


def test_a_pulse_stands_in_the_slots_around_its_beginning() -> None:
    samples = noise(np.random.default_rng(3), 150_000)
    pulse = TruePulse(start_s=20.0, offset_hz=-100.0, enr_db=13.0)
    add_pulse(samples, pulse, sample_rate_hz=RATE_HZ, width_s=0.02, phase=1.0)
    found = energies(samples)
    row = int(np.argmin(np.abs(found.offsets_hz + 100.0)))
    near = np.abs(since_start_s(found) - 20.0) < 0.012
    assert found.energy[row, near].min() > 3.0


def test_blocks_are_put_at_their_times() -> None:
    block = np.ones(100, np.complex64)
    later_ns = START_NS + round(300 / RATE_HZ * 1e9)
    samples, there, start_ns = gather([(block, START_NS), (block, later_ns)], RATE_HZ)
    assert start_ns == START_NS
    assert len(samples) == 400
    assert np.flatnonzero(~there).tolist() == list(range(100, 300))


@pytest.mark.parametrize("off_ppm", [-100.0, -50.0, 50.0, 100.0])
def test_samples_of_a_crystal_that_is_off_stand_at_their_times(off_ppm: float) -> None:
    """Kept channels tell the time of each piece: some 3 ms wrong after a minute."""
    true_rate_hz = RATE_HZ * (1.0 + off_ppm * 1e-6)
    piece = round(60.0 * RATE_HZ)
    marks = np.arange(1, 40) * piece // 2 + 1000
    stream = np.zeros(20 * piece, np.complex64)
    stream[marks] = 1.0
    starts = np.arange(0, len(stream), piece)
    samples, there, start_ns = gather(
        [
            (stream[at : at + piece], START_NS + round(at / true_rate_hz * 1e9))
            for at in starts.tolist()
        ],
        RATE_HZ,
    )
    assert start_ns == START_NS
    placed_s = np.flatnonzero(samples) / RATE_HZ
    assert placed_s == pytest.approx(marks / true_rate_hz, abs=0.007)
    assert np.count_nonzero(~there) <= 1e-4 * len(stream)


def test_a_clock_that_is_set_is_not_followed() -> None:
    """Backwards its samples have no place, and by hours they would fill the memory."""
    block = np.ones(3750, np.complex64)
    for step_s in (-5.0, 3 * 3600.0):
        times_s = np.array([0.0, 1.0, 2.0 + step_s, 3.5 + step_s])
        blocks = [(block, START_NS + round(one * 1e9)) for one in times_s.tolist()]
        samples, there, _ = gather(blocks, RATE_HZ)
        assert len(samples) == round(4.5 * RATE_HZ)
        # The half second that is missing after it is.
        assert np.flatnonzero(~there).tolist() == list(range(11_250, 13_125))


def test_no_blocks_are_no_samples() -> None:
    samples, there, start_ns = gather([], RATE_HZ)
    assert (len(samples), len(there), start_ns) == (0, 0, 0)
