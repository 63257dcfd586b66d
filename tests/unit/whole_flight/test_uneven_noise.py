"""In hum and noise that comes and goes, sums over pulses are judged as what they are."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.localization.antenna import PATTERNS
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies
from uavrt.localization.whole_flight.energies.folding import fold
from uavrt.localization.whole_flight.flight_judgement import (
    Weights,
    correlation_slots,
    low_rank_weights,
)
from uavrt_experiments.detection.interference import coloured_noise
from uavrt_experiments.detection.signals import noise
from uavrt_experiments.integrate.false_alarms import flown as judged_flight
from uavrt_experiments.integrate.false_alarms import gumbel_share, humming
from uavrt_experiments.integrate.flights import (
    INTERVAL_S,
    RATE_HZ,
    Course,
    Samples,
    World,
    looked_at,
    turning,
)

WORLD = World(course=turning(100), slack_s=0.020, window_hz=60.0)
COUNT = round(WORLD.course.duration_s * RATE_HZ)


def searched(samples: Samples) -> tuple[SlotEnergies, Weights]:
    places, chosen = looked_at(WORLD.course)
    energies = WORLD.energies(samples)
    gain = places.gain[chosen]
    return energies, low_rank_weights(gain, places.time_s, energies, INTERVAL_S)


def scores(energies: SlotEnergies, weights: Weights, row: int) -> NDArray[np.float32]:
    """Of one frequency at all phases and the intervals of one period, by place."""
    period = round(INTERVAL_S / energies.slot_s)
    sums = fold(energies.energy[row] * weights.basis, period)
    return np.asarray(sums.reshape(len(sums), -1).T @ weights.scaled(row).T)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_hum_lifts_no_place_above_the_others(seed: int) -> None:
    found = searched(coloured_noise(np.random.default_rng(seed), COUNT, hum=True))
    for row in (0, 4):  # 50 Hz beside the line: noise, whose level was taken with the line's
        of_places = scores(*found, row)
        assert np.abs(of_places.mean(axis=0)).max() < 0.2
        assert of_places.std(axis=0).max() < 1.2


def test_noise_that_rises_with_the_heading_lowers_the_pulses_expected_there() -> None:
    samples = noise(np.random.default_rng(5), COUNT)
    samples[COUNT // 2 :] *= 2.0
    noise_db = WORLD.energies(samples).noise_db
    half = len(noise_db) // 2
    rise_db = np.median(noise_db[half + 300 :]) - np.median(noise_db[: half - 300])
    assert rise_db == pytest.approx(6.0, abs=0.3)


def past_a_line(samples: Samples, course: Course, line_db: float) -> Samples:
    """Samples with the noise of a power line in the east, received through the antenna."""
    over_db = line_db + PATTERNS[course.antenna].gain_db(90.0 - course.yaw_deg)
    at_s = np.arange(len(samples)) / RATE_HZ
    over = np.interp(at_s, course.time_s, 1.0 + 10.0 ** (over_db / 10.0))
    return samples * np.sqrt(over).astype(np.float32)


@pytest.mark.parametrize("rate_deg_s", [6.0, 30.0])
def test_noise_of_a_power_line_is_followed_while_the_antenna_turns(rate_deg_s: float) -> None:
    course = turning(60, rate_deg_s=rate_deg_s)
    samples = noise(np.random.default_rng(7), round(course.duration_s * RATE_HZ))
    world = replace(WORLD, course=course)
    quiet, found = world.energies(samples), world.energies(past_a_line(samples, course, 12.0))
    true = past_a_line(np.ones_like(samples), course, 12.0).real ** 2
    true_db = 10.0 * np.log10(np.interp(found.time_s, np.arange(len(true)) / RATE_HZ, true))
    error_db = found.noise_db - true_db
    assert np.ptp(true_db) > 9.0
    assert error_db.std() < 0.5
    both = quiet.heard & found.heard
    assert both.mean() > 0.95
    ratio_db = 10.0 * np.log10(found.level[:, both] / quiet.level[:, both])
    assert ratio_db.std() < 0.3


def test_noise_that_comes_and_goes_makes_sums_no_less_standard() -> None:
    spread = []
    for seed in range(4, 9):
        rng = np.random.default_rng(seed)
        samples = noise(rng, COUNT)
        part = round(0.3 * RATE_HZ)
        for first in rng.integers(0, COUNT - part, 70):
            samples[first : first + part] *= 1.6
        energies, weights = searched(samples)
        spread.append(scores(energies, weights, 2).std(axis=0))
    assert np.abs(np.mean(spread, axis=0) - 1.0).max() < 0.15


def test_a_line_of_hum_has_few_independent_slots() -> None:
    white, _ = searched(noise(np.random.default_rng(5), COUNT))
    hum, _ = searched(coloured_noise(np.random.default_rng(5), COUNT, hum=True))
    assert correlation_slots(white) == pytest.approx(np.full(5, 2.7), abs=0.3)
    on_line, beside = correlation_slots(hum)[[2, 4]]
    assert on_line > 20.0
    assert beside == pytest.approx(2.7, abs=0.3)


def test_flights_in_hum_show_a_tag_no_more_often_than_asked_for() -> None:
    # Of 24 flights; more than 2.5 times as many as nominal is out of its interval.
    outcomes = [
        judged_flight(np.random.default_rng((6, number)), WORLD, humming)
        for number in range(24)
    ]
    _, fewest, _ = gumbel_share([one.log_expected for one in outcomes])
    assert fewest < 1.0
    assert sum(one.found for one in outcomes) <= 2
