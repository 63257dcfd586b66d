"""Tests of the check whether a tag walked during a whole flight."""

import math
from dataclasses import replace

import numpy as np
import pytest
from some import some

from uavrt.analysis.whole_flights.judged_flights import rest_in_words
from uavrt.localization.whole_flight.heard_train import HeardTrain, train_pulses
from uavrt.localization.whole_flight.train_place import PlaceBelief, place_belief
from uavrt_experiments.integrate.flights import (
    PLANE,
    Course,
    add_pulses,
    looked_at,
    silence,
    stops,
)
from uavrt_experiments.integrate.sensitivity import best_train, narrow_world

COURSE = stops(6, 20, apart_m=150.0)
TAG_M = (120.0, 90.0)


def located(east_m_s: float, seed: int) -> PlaceBelief:
    """Position of a tag that is at `TAG_M` in the middle of a flight and walks east."""
    rng = np.random.default_rng((31, seed))
    since_s = COURSE.time_s - 0.5 * COURSE.duration_s
    course = replace(COURSE, tag_at=lambda _: TAG_M)
    seen: Course = replace(course, east_m=course.east_m - east_m_s * since_s)
    world = narrow_world(course)
    samples = silence(rng, course)
    truth = world.truth(rng)
    add_pulses(rng, samples, replace(world, course=seen).pulses(rng, truth, 26.0))
    energies = world.energies(samples)
    train = best_train(world, energies)
    places, chosen = looked_at(COURSE)
    gain = places.gain[chosen[train.place]]
    pulses = train_pulses(energies, train, gain, places.time_s)
    return place_belief([HeardTrain.among(energies, pulses, places, rates=1)])


def off_m(place: PlaceBelief, east_m: float) -> float:
    east, north = PLANE.to_local(place.latitude_deg, place.longitude_deg)
    return math.hypot(float(east) - east_m, float(north) - TAG_M[1])


@pytest.mark.parametrize("seed", range(2))
def test_a_tag_at_rest_is_not_taken_for_a_walker(seed: int) -> None:
    place = located(0.0, seed)
    assert place.walk is not None
    assert not place.walked
    (text,) = rest_in_words(place)
    assert text.startswith("the position assumes that the tag was at rest")


def test_a_walk_is_recognised_and_the_position_is_that_at_its_end() -> None:
    speed_m_s = 0.5
    place = located(speed_m_s, 0)
    assert place.walked
    assert some(place.walk).velocity_m_s[0] == pytest.approx(speed_m_s, abs=0.2)
    end_m = TAG_M[0] + 0.5 * speed_m_s * COURSE.duration_s
    assert off_m(place, end_m) <= place.radius95_m
    (text,) = rest_in_words(place)
    assert "seems to have walked" in text
    assert text.endswith("the position is that at the last pulse")
