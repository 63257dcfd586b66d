"""Strong tags, other trains, two rates, drift and losses: each says itself in the judgement."""

from dataclasses import replace

import numpy as np
import pytest

from uavrt.core.messages import Tag
from uavrt.localization.whole_flight.train_judging import Judgement, judge
from uavrt_experiments.integrate.flights import (
    INTERVAL_S,
    RATE_HZ,
    Samples,
    Truth,
    World,
    add_pulses,
    looked_at,
    silence,
    turning,
)

WORLD = World(course=turning(150), slack_s=0.02, window_hz=60.0)


def flight(
    seed: int,
    enr_db: float,
    *,
    interval_s: float = INTERVAL_S + 0.005,
    drift: float = 0.0,
    world: World = WORLD,
) -> Samples:
    rng = np.random.default_rng(seed)
    samples = silence(rng, world.course)
    truth = Truth(
        east_m=1500.0, north_m=800.0, interval_s=interval_s, offset_hz=20.0, first_s=0.4
    )
    add_pulses(rng, samples, world.pulses(rng, truth, enr_db, drift=drift))
    return samples


def judged(
    samples: Samples,
    *,
    tag: Tag | None = None,
    there: np.ndarray | None = None,
    drift: float = 0.0,
    world: World = WORLD,
) -> Judgement:
    places, chosen = looked_at(world.course)
    gain = places.gain[chosen]
    energies = world.energies(samples, there)
    return judge(energies, gain, places.time_s, tag or world.tag, most_drift=drift)


@pytest.mark.parametrize("enr_db", [6.0, 12.0, 16.0, 20.0, 30.0, 45.0])
def test_a_tag_of_any_strength_is_found(enr_db: float) -> None:
    train = judged(flight(1, enr_db)).train
    assert train.false_alarm_probability < 0.01
    assert train.interval_s == pytest.approx(INTERVAL_S + 0.005, abs=3e-4)


@pytest.mark.parametrize(
    ("interval_s", "ratio"),
    [(2.0 * INTERVAL_S, (2, 1)), (0.5 * INTERVAL_S, (1, 2)), (1.5 * INTERVAL_S, (3, 2))],
)
@pytest.mark.parametrize("enr_db", [9.0, 30.0])
def test_another_tag_at_a_small_ratio_is_named_as_ambiguous(
    interval_s: float, ratio: tuple[int, int], enr_db: float
) -> None:
    found = judged(flight(2, enr_db, interval_s=interval_s))
    assert found.train.false_alarm_probability > 0.01
    assert found.ambiguous is not None
    assert found.ambiguous.ratio == ratio
    assert found.ambiguous.interval_s == pytest.approx(interval_s, rel=1e-3)


def test_a_tag_is_found_behind_another_on_its_frequency() -> None:
    rng = np.random.default_rng(3)
    samples = flight(3, 8.0)
    other = Truth(
        east_m=-900.0, north_m=1500.0, interval_s=1.2 * INTERVAL_S, offset_hz=20.0, first_s=0.9
    )
    add_pulses(rng, samples, WORLD.pulses(rng, other, 10.0))
    found = judged(samples)
    assert found.train.false_alarm_probability < 0.01
    assert found.train.interval_s == pytest.approx(INTERVAL_S + 0.005, abs=3e-4)


def test_an_electric_fence_is_no_tag() -> None:
    samples = flight(4, -30.0)
    at = np.rint(np.arange(0.3, WORLD.course.duration_s, INTERVAL_S) * RATE_HZ).astype(int)
    samples[at] += 300.0
    found = judged(samples)
    assert found.energies.left_out > 100
    assert found.train.false_alarm_probability > 0.01


def test_both_rates_are_searched_and_the_right_one_is_told() -> None:
    tag = replace(WORLD.tag, pulse_intervals_s=(INTERVAL_S, 0.9))
    resting = judged(flight(5, 7.0), tag=tag)
    walking = judged(flight(6, 7.0, interval_s=0.905), tag=tag)
    for found, rate, interval_s in ((resting, 1, INTERVAL_S + 0.005), (walking, 2, 0.905)):
        assert found.train.false_alarm_probability < 0.01
        assert found.train.rate == rate
        assert found.train.interval_s == pytest.approx(interval_s, abs=3e-4)


def test_a_drifting_interval_is_followed_when_asked_for() -> None:
    samples = flight(10, 5.5, drift=0.008)
    steady = judged(samples).train
    followed = judged(samples, drift=0.01).train
    assert steady.false_alarm_probability > 0.01
    assert followed.false_alarm_probability < 0.01
    assert followed.drift == pytest.approx(0.008, abs=0.001)


def test_a_gap_and_lost_samples_cost_only_what_they_hold() -> None:
    samples = flight(8, 8.0)
    rng = np.random.default_rng(8)
    there = np.ones(len(samples), bool)
    there[200_000:280_000] = False
    # 5 % of the rest, in losses of a tenth of a second.
    for first in rng.integers(0, len(samples) - 375, len(samples) // 7500):
        there[first : first + 375] = False
    assert 0.83 < there.mean() < 0.87
    found = judged(np.where(there, samples, np.complex64(0.0)), there=there)
    assert found.train.false_alarm_probability < 0.01
    assert found.train.interval_s == pytest.approx(INTERVAL_S + 0.005, abs=3e-4)
