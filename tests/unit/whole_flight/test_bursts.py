"""Bursts of coded tags over a whole flight: all pulses of each, and no other code's."""

from dataclasses import replace

import numpy as np
import pytest
from depth import share
from numpy.typing import NDArray

from uavrt.core.messages import Tag
from uavrt.localization.whole_flight.energies.coded_bursts_over_flight import exponentials
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies, slot_energies
from uavrt.localization.whole_flight.heard_train import train_pulses
from uavrt.localization.whole_flight.train_judging import Judgement, judge
from uavrt_experiments.detection.coded import add_burst, some_codes
from uavrt_experiments.detection.signals import START_NS, noise

RATE_HZ = 3750.0
SECONDS = 75.0
FIRST_S = 1.3
INTERVAL_S = 3.001


def codes() -> tuple[Tag, Tag]:
    """Two codes with one interval on one frequency."""
    one, other = some_codes(np.random.default_rng(1), 2)
    return (replace(one, pulse_intervals_s=(3.0,)), replace(other, pulse_intervals_s=(3.0,)))


def sent(tag: Tag, enr_db: float, *, seed: int = 5) -> NDArray[np.complex64]:
    """A channel with a tag's bursts, its gaps 1 ms longer than listed."""
    rng = np.random.default_rng(seed)
    samples = noise(rng, round(SECONDS * RATE_HZ))
    for number in range(int((SECONDS - FIRST_S) / INTERVAL_S)):
        add_burst(
            *(samples, tag),
            start_s=FIRST_S + number * INTERVAL_S,
            offset_hz=40.0,
            enr_db=enr_db,
            stretch=1e-3 / sum(tag.gaps_s),
            rng=rng,
            sample_rate_hz=RATE_HZ,
        )
    return samples


def judged(tag: Tag, samples: NDArray[np.complex64]) -> tuple[SlotEnergies, Judgement]:
    """Judge a tag as heard from one place that hears all pulses alike."""
    energies = slot_energies(
        samples,
        np.ones(len(samples), bool),
        tag=tag,
        start_ns=START_NS,
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=tag.frequency_hz,
        frequency_window_hz=60.0,
    )
    return energies, judge(energies, np.ones((1, 2)), np.array([0.0, SECONDS]), tag)


def test_all_pulses_of_a_burst_count() -> None:
    tag, _ = codes()
    samples = sent(tag, 2.5)
    energies, found = judged(tag, samples)
    assert found.train.false_alarm_probability < 1e-4
    train = train_pulses(energies, found.train, np.ones(2), np.array([0.0, SECONDS]))
    begun_s = (energies.start_ns - START_NS) / 1e9 + float(train.time_s[0])
    assert begun_s == pytest.approx(FIRST_S, abs=0.003)
    assert len(train.time_s) == pytest.approx(24, abs=1)
    assert train.interval_s == pytest.approx(INTERVAL_S, abs=2e-4)
    # The mean over the pulses of a burst, in units of the noise.
    assert float(train.energy.mean()) == pytest.approx(1.0 + 10.0**0.25, rel=0.2)
    _, alone = judged(replace(tag, gaps_s=()), samples)
    assert alone.train.false_alarm_probability > 0.01


@pytest.mark.parametrize("enr_db", share([8.0, 25.0], 2))
def test_another_code_is_told_as_such_and_hides_none(enr_db: float) -> None:
    tag, other = codes()
    _, silent = judged(other, sent(tag, enr_db))
    assert silent.train.false_alarm_probability > 0.01
    assert silent.others
    assert all(one.other_code for one in silent.others)
    both = sent(tag, enr_db)
    rng = np.random.default_rng(9)
    for number in range(23):
        add_burst(
            *(both, other),
            start_s=2.6 + number * 2.9985,
            offset_hz=40.0,
            enr_db=6.0,
            stretch=0.0,
            rng=rng,
            sample_rate_hz=RATE_HZ,
        )
    energies, found = judged(other, both)
    assert found.train.false_alarm_probability < 0.01
    first_s = (energies.start_ns - START_NS) / 1e9 + found.train.phase_s
    assert (first_s - 2.6 + 0.5) % 2.9985 == pytest.approx(0.5, abs=0.004)


@pytest.mark.parametrize("pulses", [1, 3])
@pytest.mark.parametrize("bursts", [1, 4, 20])
def test_bursts_of_noise_are_counted_by_the_mean_of_their_largest(
    pulses: int, bursts: int
) -> None:
    rng = np.random.default_rng(pulses)
    means = rng.gamma(pulses, 1.0 / pulses, (20_000, bursts))
    counted = exponentials(float(means.max(axis=1).mean()), pulses)
    assert counted == pytest.approx(bursts, rel=0.05)


@pytest.mark.parametrize("enr_db", share([14.0, 30.0], 2))
def test_a_strong_tag_is_found_with_its_bursts_where_they_begin(enr_db: float) -> None:
    tag, _ = codes()
    energies, found = judged(tag, sent(tag, enr_db))
    assert found.train.false_alarm_probability < 1e-6
    assert not found.others
    first_s = (energies.start_ns - START_NS) / 1e9 + found.train.phase_s
    assert (first_s - FIRST_S + 0.5) % INTERVAL_S == pytest.approx(0.5, abs=0.004)
