"""Bursts that are no pulses: what they leave behind in the samples and in the noise."""

import numpy as np
import pytest

from uavrt.detection import PulseDetector
from uavrt.experiments.detection.interference import impulses
from uavrt.experiments.detection.signals import START_NS, THESIS_TAG, noise
from uavrt.experiments.detection.trials import detect

RATE_HZ = 3750.0


def noise_told(seconds: float, *, per_s: float, length_s: float, level_db: float) -> float:
    """Noise that a search reports at the end, of noise of unit power and a train of bursts."""
    rng = np.random.default_rng(70)
    samples = noise(rng, round(seconds * RATE_HZ))
    if per_s:
        samples += impulses(
            rng,
            len(samples),
            per_s=per_s,
            level_db=level_db,
            length_s=length_s,
            regular=True,
        )
    detector = PulseDetector(
        THESIS_TAG, sample_rate_hz=RATE_HZ, center_frequency_hz=THESIS_TAG.frequency_hz
    )
    for first in range(0, len(samples), 653):
        time_ns = START_NS + round(first / RATE_HZ * 1e9)
        detector.process(samples[first : first + 653], time_ns)
    return detector.search_reports()[-1].noise_psd * RATE_HZ


@pytest.mark.parametrize("length_s", [1e-3, 5e-3])
@pytest.mark.parametrize("per_s", [5.0, 10.0])
def test_what_was_taken_out_does_not_lower_the_noise(per_s: float, length_s: float) -> None:
    # Three hundredths of the noise are a factor of two in the false alarms.
    without = noise_told(30.0, per_s=0.0, length_s=length_s, level_db=40.0)
    beside = noise_told(30.0, per_s=per_s, length_s=length_s, level_db=40.0)
    assert abs(beside / without - 1.0) < 0.03


def test_noise_is_told_though_every_window_has_an_impulse() -> None:
    told = noise_told(12.0, per_s=100.0, length_s=1e-3, level_db=40.0)
    assert 0.4 < told < 1.1


@pytest.mark.parametrize("seed", range(3))
def test_serial_bursts_make_no_more_groups_than_noise(seed: int) -> None:
    # 0.67 groups are expected of noise in 240 s; with its level told 7 % too low it were six.
    rng = np.random.default_rng([71, seed])
    samples = noise(rng, round(80.0 * RATE_HZ))
    samples += impulses(
        rng, len(samples), per_s=10.0, level_db=40.0, length_s=5e-3, regular=True
    )
    pulses, detector = detect(samples, THESIS_TAG, frequency_window_hz=1e6)
    assert len(pulses) <= THESIS_TAG.k
    assert detector.counters.samples_blanked > 0.05 * len(samples)
