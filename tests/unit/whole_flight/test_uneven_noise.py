"""In hum and noise that comes and goes, sums over pulses are judged as what they are."""

import numpy as np
import pytest
from numpy.typing import NDArray

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


def test_noise_that_comes_and_goes_makes_sums_no_less_standard() -> None:
    rng = np.random.default_rng(4)
    samples = noise(rng, COUNT)
    part = round(0.3 * RATE_HZ)
    for first in rng.integers(0, COUNT - part, 70):
        samples[first : first + part] *= 1.6
    energies, weights = searched(samples)
    spread = scores(energies, weights, 2).std(axis=0)
    assert np.abs(spread - 1.0).max() < 0.15


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
