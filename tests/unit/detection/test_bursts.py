"""Bursts on air: how often they lie on a tag's lattice, and what is made of it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from depth import share
from streams import sent

from uavrt.detection.modes import OperatingMode
from uavrt.detection.search.thresholds import decision_interval_s
from uavrt.detection.track.chance import (
    QUIET,
    BurstRates,
    log_begin,
    log_doubt,
    log_empty,
    log_odds,
)
from uavrt_experiments.detection.false_alarms import detected_groups
from uavrt_experiments.detection.on_air import Hopper, Slots
from uavrt_experiments.detection.signals import THESIS_TAG, noise
from uavrt_experiments.detection.trials import RATE_HZ, compare, detect

pytestmark = pytest.mark.slow

FITS = {"width_s": 0.02, "late_s": 0.0, "spread_s": 0.006, "beside_hz": 0.0, "above_db": 0.0}


def on_air(per_s: float) -> BurstRates:
    return BurstRates(alike_per_s=per_s, hiding_per_s=0.0, begin_per_s=per_s)


def test_the_more_bursts_there_are_the_less_a_pulse_says() -> None:
    said = [log_odds(on_air(rate), **FITS) for rate in (0.0, 0.1, 1.0, 10.0, 100.0)]
    assert said == sorted(said, reverse=True)
    assert log_odds(QUIET, **FITS) > 11.0
    assert said[-1] < 0.0


@pytest.mark.parametrize(
    "off", [{"late_s": 0.02}, {"beside_hz": 20.0}, {"above_db": 20.0}], ids=str
)
def test_a_pulse_that_fits_badly_says_less(off: dict[str, float]) -> None:
    said = log_odds(on_air(1.0), **(FITS | off))
    assert said < log_odds(on_air(1.0), **FITS) - 2.0
    assert said >= log_empty(on_air(1.0), width_s=0.02)


def test_in_mean_a_burst_says_nothing_for_a_tag() -> None:
    # The mean of a likelihood ratio over what bursts alone make is one: no more than that may
    # come of places that a burst lies in at random, else the bound of the odds does not hold.
    rng = np.random.default_rng(3)
    rate, half_s = 2.0, 0.03
    ratios = []
    for _ in range(4000):
        if rng.uniform() > rate * 2.0 * half_s:
            ratios.append(math.exp(log_empty(on_air(rate), width_s=0.02)))
            continue
        late_s, beside_hz = rng.uniform(-half_s, half_s), rng.uniform(-20.0, 20.0)
        found = FITS | {"late_s": late_s, "beside_hz": beside_hz}
        ratios.append(math.exp(log_odds(on_air(rate), **found)))
    assert np.mean(ratios) < 1.05


def test_two_fitting_pulses_outweigh_a_quiet_channel_and_not_a_busy_one() -> None:
    quiet = log_begin(0.0) + 2.0 * log_odds(QUIET, **FITS)
    busy = log_begin(5.0) + 2.0 * log_odds(on_air(1.0), **FITS)
    assert quiet > 0.0
    assert busy < 0.0
    assert log_doubt(0.05, 3.567) < log_doubt(0.01, 3.567) < 0.0


def hopping(seed: int, *, seconds: float, per_s: float = 6.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    count = round(seconds * RATE_HZ)
    return noise(rng, count) + Hopper(per_s)(rng, count)


def test_a_hopper_confirms_no_tag_that_is_not_there() -> None:
    confirmed = 0
    for seed, interval_s in enumerate((1.05, 1.254)):
        tag = replace(THESIS_TAG, pulse_intervals_s=(interval_s,))
        pulses, _ = detect(hopping(seed, seconds=50.0), tag, frequency_window_hz=500.0)
        confirmed += sum(pulse.confirmed for pulse in pulses)
    assert confirmed == 0


@pytest.mark.parametrize(
    "on_air", share([Hopper(6.0), Slots(0.060, slot_s=0.015, busy=0.05)], 2)
)
def test_bursts_confirm_no_tag_of_long_groups(on_air: Hopper | Slots) -> None:
    rng = np.random.default_rng([7, 0])
    samples = noise(rng, round(28.0 * RATE_HZ))
    samples += on_air(rng, len(samples))
    pulses, _ = detect(samples, replace(THESIS_TAG, k=10), frequency_window_hz=500.0)
    assert sum(pulse.confirmed for pulse in pulses) <= 1


def test_peaks_of_noise_are_no_bursts_that_keep_single_pulses_back() -> None:
    tag = replace(THESIS_TAG, k=1, false_alarm_probability=0.3)
    seconds = 150.0
    quiet = noise(np.random.default_rng(9), round(seconds * RATE_HZ))
    groups, _ = detected_groups(detect(quiet, tag, frequency_window_hz=math.inf)[0])
    asked_for = 0.3 * seconds / decision_interval_s(tag)
    assert 0.7 * asked_for < groups < 1.4 * asked_for


def test_bursts_keep_single_pulses_back() -> None:
    tag = replace(THESIS_TAG, k=1, false_alarm_probability=0.05)
    pulses, _ = detect(hopping(4, seconds=60.0, per_s=3.0), tag, frequency_window_hz=500.0)
    assert len(pulses) <= 3


def test_without_a_lock_a_hopper_confirms_no_more() -> None:
    pulses, _ = detect(
        hopping(4, seconds=20.0), THESIS_TAG, operating_mode=OperatingMode.ALL_NEVER_LOCK
    )
    assert not any(pulse.confirmed for pulse in pulses)


def test_a_tag_among_the_slots_of_a_frame_is_confirmed_and_they_are_not() -> None:
    truth, samples = sent(6, 80.0, 14.0, interval_s=1.27, offset_hz=100.0, jitter_s=0.005)
    slots = Slots(0.060, slot_s=0.015, busy=0.05)
    samples += slots(np.random.default_rng(16), len(samples))
    pulses, _ = detect(samples, THESIS_TAG, frequency_window_hz=500.0)
    result = compare(pulses, truth, THESIS_TAG)
    assert result.confirmed >= 0.85 * result.true
    assert result.false_confirmed <= 1


def test_a_tag_that_was_there_before_the_bursts_goes_on_being_confirmed() -> None:
    truth, samples = sent(7, 80.0, 14.0, interval_s=1.23, offset_hz=100.0, jitter_s=0.005)
    half = len(samples) // 2
    samples[half:] += Hopper(6.0)(np.random.default_rng(17), len(samples) - half)
    pulses, _ = detect(samples, THESIS_TAG, frequency_window_hz=500.0)
    result = compare(pulses, truth, THESIS_TAG)
    assert result.confirmed >= 0.85 * result.true
    assert result.false_confirmed <= 1
