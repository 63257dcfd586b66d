"""Drones that search together, over a radio that loses and delays, in virtual time.

``UAVRT_TOGETHER=100`` flies more than a build does.
"""

import os
from dataclasses import dataclass

import numpy as np
import pytest
from searched import Animal
from together import Together

from uavrt.guidance.search.neighbour_drones import SEPARATION
from uavrt.simulation.vehicle.airframe import Frame
from uavrt.simulation.vehicle.simulated_flying import MODES

FLIGHTS = int(os.environ.get("UAVRT_TOGETHER", "2"))


@dataclass(frozen=True, slots=True)
class Flight:
    """What came of one."""

    seed: int
    drones: int
    apart_m: float
    heights_apart_m: float
    all_found: bool
    """By those whose radio works."""
    returned: bool
    silent_moved_m: float
    """From the end of the way that it owned when its radio fell silent."""


def flown(seed: int) -> Flight:
    """Two to four drones, wind, losses to 40 %, words late by a second; one may fall silent."""
    rng = np.random.default_rng((seed, 11))
    count = int(rng.integers(2, 5))
    animals = [
        Animal(float(north), float(east), level_db=float(rng.uniform(36.0, 44.0)))
        for north, east in rng.uniform(-220.0, 220.0, (4, 2))
    ]
    wind = rng.uniform(-4.0, 4.0, 2)
    search = Together(
        "px4" if seed % 2 else "ardupilot",
        animals,
        [(0.0, 30.0 * number) for number in range(count)],
        seed=seed,
        loss=float(rng.uniform(0.0, 0.4)),
        late_s=float(rng.uniform(0.0, 1.0)),
        frame=Frame(
            battery_wh=160.0, wind_m_s=(float(wind[0]), float(wind[1])), return_height_m=60.0
        ),
    )
    search.begin()
    search.run(float(rng.uniform(15.0, 40.0)))
    silent, moved = None, 0.0
    if seed % 2 == 0:
        silent = search.drones[int(rng.integers(count))]
        search.silent.add(silent.number)
        search.run(30.0)
        place = silent.flown.vehicle.body.place_m
        search.run(20.0)
        moved = float(np.hypot(*np.subtract(silent.flown.vehicle.body.place_m, place)))
    heard = [one for one in search.drones if one is not silent]
    search.run(500.0, until=lambda: all(one.out for one in heard))
    return Flight(
        seed=seed,
        drones=count,
        apart_m=search.apart_m,
        heights_apart_m=search.heights_apart_m,
        all_found=all(len(one.errors_m) == len(animals) for one in heard),
        returned=all(one.flown.vehicle.mode == MODES[one.flavour]["return"] for one in heard),
        silent_moved_m=moved if silent is not None and silent.searching else 0.0,
    )


@pytest.fixture(scope="module")
def flights() -> list[Flight]:
    all_flown = [flown(seed) for seed in range(1, 1 + FLIGHTS)]
    assert all_flown
    return all_flown


@pytest.mark.timeout(7200)
def test_they_stay_apart_whatever_is_lost_or_late(flights: list[Flight]) -> None:
    assert min(one.apart_m for one in flights) >= SEPARATION.distance_m, flights


@pytest.mark.timeout(7200)
def test_on_the_way_home_they_keep_their_heights(flights: list[Flight]) -> None:
    assert min(one.heights_apart_m for one in flights) >= SEPARATION.height_m - 2.0, flights


@pytest.mark.timeout(7200)
def test_they_find_all_also_without_one_that_falls_silent(flights: list[Flight]) -> None:
    assert all(one.all_found and one.returned for one in flights), flights


@pytest.mark.timeout(7200)
def test_who_hears_nobody_flies_no_new_way(flights: list[Flight]) -> None:
    assert max(one.silent_moved_m for one in flights) < 2.0, flights


def test_a_takeover_of_one_ends_its_search_alone_and_at_once() -> None:
    search = Together("px4", [Animal(180.0, -90.0)], [(0.0, 0.0), (0.0, 40.0)], seed=5)
    search.begin()
    search.run(12.0)
    one, other = search.drones
    one.flown.vehicle.set_mode(MODES["px4"]["position"])
    search.run(1.0)
    assert one.out
    assert not other.out
    commands = len(one.flown.commands)
    search.run(400.0, until=lambda: other.out)
    assert len(one.flown.commands) == commands
    assert len(other.errors_m) == 1
