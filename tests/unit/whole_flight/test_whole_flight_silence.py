"""Silence over a whole flight tells what it is said to tell: measured on flights of noise."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.localization.antenna import PATTERNS
from uavrt.planning.detectability.whole_flight_chance import WholeFlightSum
from uavrt_experiments.integrate.flights import Truth, World, add_pulses, silence, turning

FALSE_ALARM = 0.01
LEVELS_DB = (2.0, 3.5, 4.5, 5.5, 7.0)


def told(world: World, truth: Truth, enr_db: float) -> float:
    """The probability by the map's own way to find a tag."""
    course = world.course
    at_s = np.arange(truth.first_s, course.duration_s - 0.03, truth.interval_s)
    pattern = PATTERNS[course.antenna]
    gain_db = np.interp(
        at_s, course.time_s, course.gain_db(truth.east_m, truth.north_m, pattern)
    )
    judged = WholeFlightSum(world.tag, len(at_s), world.window_hz, np.zeros(1))
    energies = 10.0 ** ((enr_db + gain_db[:, np.newaxis]) / 10.0)
    for step in (judged.look, judged.add):
        for energy in energies.astype(np.float32):
            step(energy)
    return float(judged.found()[0, 0])


def flown(rng: np.random.Generator, world: World, enr_db: float) -> tuple[float, bool]:
    """What was told of a tag, and whether judging the flight found it."""
    truth = world.truth(rng)
    samples = silence(rng, world.course)
    add_pulses(rng, samples, world.pulses(rng, truth, enr_db))
    train = world.judge(world.energies(samples), FALSE_ALARM).train
    return told(world, truth, enr_db), train.false_alarm_probability <= FALSE_ALARM


def test_tags_are_found_as_often_as_the_map_tells() -> None:
    world = World(course=turning(100), slack_s=0.02, window_hz=60.0)
    rng = np.random.default_rng(31)
    flights = [flown(rng, world, LEVELS_DB[n % len(LEVELS_DB)]) for n in range(15)]
    expected = sum(probability for probability, _ in flights)
    spread = math.sqrt(sum(p * (1.0 - p) for p, _ in flights))
    found = sum(one for _, one in flights)
    assert 3 < found < 13
    # A decibel of the model's error, beside chance.
    assert abs(found - expected) < 2.0 * spread + 0.1 * len(flights)


def test_an_area_said_empty_is_empty_as_often_as_told() -> None:
    """Tags drawn from the prior; those in a polygon, of all that were not found."""
    world = World(course=turning(60), slack_s=0.02, window_hz=60.0)
    rng = np.random.default_rng(7)
    inside: NDArray[np.bool_] = np.zeros(48, bool)
    missed = np.zeros(48)
    silent = np.zeros(48, bool)
    for number in range(48):
        # Near the drone the strongest pulse has 6 dB in the mean, farther away 2 dB.
        inside[number] = number % 4 == 0
        level_db = (7.5 if inside[number] else 3.0) + 1.5 * rng.standard_normal()
        probability, found = flown(rng, world, level_db)
        missed[number], silent[number] = 1.0 - probability, not found
    told_here = missed[inside].sum() / missed.sum()
    here = silent[inside].sum() / silent.sum()
    assert told_here < 0.1
    assert here == pytest.approx(told_here, abs=0.09)
