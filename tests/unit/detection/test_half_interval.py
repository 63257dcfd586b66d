"""A tag that beeps at twice the listed interval has no pulses half-way between."""

from dataclasses import replace

import made
import numpy as np
import pytest

from uavrt_experiments.detection.signals import START_NS, THESIS_TAG, make_samples
from uavrt_experiments.detection.trials import detect

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("enr_db", [12.0, 16.0, 25.0])
def test_no_pulse_is_confirmed_half_way_between_two(enr_db: float) -> None:
    tag = replace(THESIS_TAG, pulse_intervals_s=(0.9,))
    rng = np.random.default_rng(101)
    truth = made.train(rng, 45.0, enr_db, interval_s=1.8, jitter_s=0.005, offset_hz=60.0)
    pulses, _ = detect(make_samples(rng, truth, duration_s=45.0), tag)
    starts_s = np.array([pulse.start_s for pulse in truth])
    confirmed_s = [(p.start_time_ns - START_NS) * 1e-9 for p in pulses if p.confirmed]
    away_s = [float(np.abs(starts_s - one).min()) for one in confirmed_s]
    assert sum(away > 0.01 for away in away_s) == 0
    assert sum(away <= 0.01 for away in away_s) >= 0.6 * len(truth)
