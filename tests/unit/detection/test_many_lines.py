"""Carriers that are many, or close to each other."""

import made
import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.detection.signal.carrier_lines import LineCanceller
from uavrt_experiments.detection.signals import THESIS_TAG, add_pulse, noise
from uavrt_experiments.detection.trials import detect

RATE_HZ = 3750.0


def waves(
    rng: np.random.Generator, count: int, frequencies_hz: list[float], level_db: float
) -> NDArray[np.complex64]:
    """Make carriers of a level in a bin of 50 Hz."""
    amplitude = np.sqrt(10.0 ** (level_db / 10.0) * 50.0 / RATE_HZ)
    time_s = np.arange(count) / RATE_HZ
    total = np.zeros(count, np.complex128)
    for frequency_hz in frequencies_hz:
        total += amplitude * np.exp(2j * np.pi * (frequency_hz * time_s + rng.random()))
    return total.astype(np.complex64)


def test_two_carriers_twelve_hertz_apart_leave_nothing_behind() -> None:
    # Fitted one after the other they left 23 dB.
    rng = np.random.default_rng(80)
    count, step = 20 * 3750, 1632
    clean = noise(rng, count)
    samples = clean + waves(rng, count, [300.0, 312.0], 40.0)
    canceller = LineCanceller(RATE_HZ)
    for first in range(0, count, step):
        before = samples[max(0, first - canceller.needed) : first]
        canceller.find(before, samples[first : first + step])
        canceller.subtract(before, samples[first : first + step])
    error = (samples - clean)[4 * step :]
    cells = np.fft.fft(error[: len(error) // 75 * 75].reshape(-1, 75), axis=1)
    powers = np.abs(cells) ** 2 / 75.0
    assert powers.mean() < 0.05
    assert powers.max() < 10.0


@pytest.mark.parametrize("level_db", [15.0, 25.0])
def test_a_tag_is_heard_among_75_lines(level_db: float) -> None:
    # 48 lines were taken out: no pulse was heard, and 16 false ones were confirmed.
    rng = np.random.default_rng(81)
    samples = noise(rng, round(30.0 * RATE_HZ))
    lines_hz = [50.0 * number + 13.0 for number in range(-37, 38)]
    samples += waves(rng, len(samples), lines_hz, level_db)
    sent = made.train(rng, 28.0, 14.0, interval_s=1.26, offset_hz=40.0, jitter_s=0.003)
    for pulse in sent:
        add_pulse(samples, pulse, sample_rate_hz=RATE_HZ, width_s=0.02, phase=1.0)
    pulses, _ = detect(samples, THESIS_TAG, center_frequency_hz=THESIS_TAG.frequency_hz - 40.0)
    heard = [one for one in pulses if abs(one.frequency_hz - THESIS_TAG.frequency_hz) < 30.0]
    assert len(heard) >= 0.9 * len(sent)
    assert not any(one.confirmed for one in pulses if one not in heard)


@pytest.mark.parametrize("slots", [1, 2])
def test_a_tag_is_heard_under_an_idle_transmitter_that_repeats_a_frame(slots: int) -> None:
    # Idle digital voice has a line every 16.7 Hz. None of 22 pulses was found, and under both
    # slots of 30 ms 11 false ones were confirmed: the lines passed for noise, or were too many.
    rng = np.random.default_rng(82)
    samples = noise(rng, round(30.0 * RATE_HZ))
    frame = noise(rng, round(0.06 * RATE_HZ)) * np.sqrt(1000.0)
    frame[len(frame) * slots // 2 :] = 0.0
    turns = 37.3 / RATE_HZ * np.arange(len(samples))
    repeated = np.resize(frame, len(samples)) * np.exp(2j * np.pi * turns)
    samples += repeated.astype(np.complex64)
    sent = made.train(rng, 28.0, 14.0, interval_s=1.26, offset_hz=40.0, jitter_s=0.003)
    for pulse in sent:
        add_pulse(samples, pulse, sample_rate_hz=RATE_HZ, width_s=0.02, phase=1.0)
    pulses, _ = detect(samples, THESIS_TAG, center_frequency_hz=THESIS_TAG.frequency_hz - 40.0)
    heard = [one for one in pulses if abs(one.frequency_hz - THESIS_TAG.frequency_hz) < 30.0]
    assert len(heard) >= 0.8 * len(sent)
    assert not any(one.confirmed for one in pulses if one not in heard)
