"""A tag that is at another rate for a part of a flight."""

from itertools import pairwise, product

import numpy as np
import pytest
from depth import seeds

from uavrt.localization.whole_flight.rate_of_flight import likeliest_states, other_rate_logs
from uavrt.localization.whole_flight.tuning import PLACE
from uavrt_experiments.integrate.flights import INTERVAL_S, stops
from uavrt_experiments.integrate.place import placed


def test_all_paths_of_the_rate_are_added_up() -> None:
    rng = np.random.default_rng(3)
    logs = rng.normal(0.0, 3.0, (19, 2))
    told = logs.sum(axis=0) + other_rate_logs(list(np.exp(-logs)), (2,))
    short = logs[:7]
    told_short = short.sum(axis=0) + other_rate_logs(list(np.exp(-short)), (2,))
    total = np.zeros(2)
    for path in product((True, False), repeat=len(short)):
        likely = np.full(2, 0.5)
        for before, at_rate in pairwise(path):
            likely *= 1.0 - PLACE.rate_change if before == at_rate else PLACE.rate_change
        for at_rate, ratio in zip(path, np.exp(short), strict=True):
            likely *= ratio if at_rate else 1.0 - PLACE.stray_share + PLACE.stray_share * ratio
        total += likely
    assert told_short == pytest.approx(np.log(total))
    assert np.isfinite(told).all()


def test_the_likeliest_path_follows_a_change_of_rate() -> None:
    logs = np.where(np.arange(40) < 25, 2.0, -0.5)[np.newaxis]
    assert likeliest_states(logs).tolist() == [True] * 25 + [False] * 15


def test_loud_and_silent_slots_stay_numbers() -> None:
    for log in (600.0, -30.0):
        told = other_rate_logs([np.exp(np.full(1, -log))] * 5000, (1,))
        assert np.isfinite(told).all()


def test_the_place_of_a_tag_that_changes_its_rate_is_as_sure_as_it_says() -> None:
    """Taken to have kept to one rate, regions of 90 % held half of such tags."""
    course = stops()
    flown = [
        placed(np.random.default_rng((7, seed)), course, 16.0, 0.0, 1.1 * INTERVAL_S)
        for seed in seeds(1, 4)
    ]
    found = [one for one in flown if one is not None]
    assert len(found) == len(flown)
    assert sum(one.held and one.arc_held for one in found) > 0.7 * len(found)
