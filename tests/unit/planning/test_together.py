"""Several drones: who takes which tags, how far apart they stay, what the others will hear."""

from dataclasses import replace

import numpy as np
import pytest

from uavrt.guidance.search.neighbour_drones import SEPARATION
from uavrt.planning.area import Polygon, SearchArea
from uavrt.planning.division import Start, divided
from uavrt.planning.drone_model.drone_motion import Multirotor, VehicleState, Wind, flown
from uavrt.planning.drone_model.other_drones import OtherDrones, Separation
from uavrt.planning.drone_model.planner_actions import FlyTo
from uavrt.planning.information import information_nats
from uavrt.planning.planners.mi_rate import MiRate
from uavrt.planning.planners.ways import checked, sampled
from uavrt.planning.search import Search
from uavrt.planning.situation import SearchSettings, Situation
from uavrt_experiments.search.catalogue import SCENARIOS
from uavrt_experiments.search.drones import FlightOfDrones
from uavrt_experiments.search.flight import beliefs_of
from uavrt_experiments.search.scenario import Contender
from uavrt_experiments.search.world import World

VEHICLE = Multirotor(speed_m_s=5.0)
HERE = VehicleState(time_s=0.0, east_m=0.0, north_m=0.0, height_m=30.0)
ONE = Contender(planner="mi_rate")


def test_two_groups_of_tags_are_a_round_for_each_of_two_drones() -> None:
    east = np.array([10.0, 400.0, 30.0, 430.0, 20.0, 410.0])
    north = np.array([10.0, 10.0, 20.0, 30.0, 50.0, 50.0])
    near = [Start(east_m=0.0, north_m=0.0), Start(east_m=500.0, north_m=0.0)]
    rounds = divided(near, east, north, speed_m_s=5.0, stay_s=5.0)
    assert [set(one) for one in rounds] == [{0, 2, 4}, {1, 3, 5}]
    # Who is busy for long leaves all to the other.
    busy = [near[0], replace(near[1], after_s=1000.0)]
    rounds = divided(busy, east, north, speed_m_s=5.0, stay_s=5.0)
    assert rounds[1] == []
    assert sorted(rounds[0]) == list(range(6))


def test_a_tag_changes_hands_only_where_that_saves_enough() -> None:
    starts = [Start(east_m=0.0, north_m=0.0), Start(east_m=100.0, north_m=0.0)]
    middle, far = np.array([49.0]), np.array([10.0])
    rounds = {
        (float(east[0]), owner): divided(
            starts, east, np.zeros(1), speed_m_s=5.0, stay_s=5.0, owners=[owner]
        )
        for east in (middle, far)
        for owner in (0, 1)
    }
    assert [rounds[49.0, owner][owner] for owner in (0, 1)] == [[0], [0]]
    assert [rounds[10.0, owner][0] for owner in (0, 1)] == [[0], [0]]


@pytest.mark.parametrize("seed", range(20))
def test_no_single_tag_could_be_moved_to_end_the_longest_round_sooner(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.0, 500.0, (2, 8))
    starts = [Start(east_m=float(x), north_m=float(y)) for x, y in rng.uniform(0, 500, (3, 2))]
    rounds = divided(starts, *places, speed_m_s=5.0, stay_s=5.0)
    assert sorted(tag for tour in rounds for tag in tour) == list(range(8))

    def longest(tours: list[list[int]]) -> float:
        times = [0.0]
        for start, tour in zip(starts, tours, strict=True):
            x, y, time = start.east_m, start.north_m, 0.0
            for tag in tour:
                time += np.hypot(places[0, tag] - x, places[1, tag] - y) / 5.0 + 5.0
                x, y = places[:, tag]
            times.append(time)
        return max(times)

    for tag in range(8):
        without = [[one for one in tour if one != tag] for tour in rounds]
        for drone, tour in enumerate(without):
            for at in range(len(tour) + 1):
                moved = [*without]
                moved[drone] = [*tour[:at], tag, *tour[at:]]
                assert longest(moved) >= longest(rounds) - 1e-6


def _situation(others: OtherDrones) -> Situation:
    scenario = SCENARIOS["T2"]
    settings = SearchSettings(
        vehicle=VEHICLE,
        area=SearchArea(search=Polygon.rectangle(0.0, 500.0, 0.0, 500.0)),
        stop=scenario.paper_stop,
        threshold_db=scenario.truth.threshold_db,
    )
    beliefs = beliefs_of(scenario, ONE, 1, 500, World(scenario, 1))
    search = Search(settings, beliefs, MiRate(), np.random.default_rng(1))
    return search.situation(HERE, Wind(), others)


def test_a_way_near_that_of_another_is_refused_whenever_either_is_flown() -> None:
    crossing = ((60.0, -60.0), (60.0, 300.0))
    situation = _situation(OtherDrones(separation=Separation(), strips=(crossing,)))
    ways = checked(situation, np.array([130.0, 20.0, -80.0]), np.array([0.0, 0.0, 0.0]))
    assert ways.refused == ["the path comes within 25 m of another drone's path", None, None]


def test_what_another_drone_will_hear_counts_no_more() -> None:
    """Of two ways alike the one that another flies tells less; so both spread out."""
    along = flown(VEHICLE, HERE, FlyTo(east_m=250.0, north_m=0.0))
    alone, with_other = (
        _situation(OtherDrones(separation=Separation(), listening=paths))
        for paths in ((), (along,))
    )
    ends = np.array([250.0, 0.0]), np.array([0.0, 250.0])
    legs = sampled(alone, *ends, np.array([52.0, 52.0]), 8)
    assert alone.others is not None
    assert with_other.others is not None
    assert alone.others.legs(0.0) is None
    free, given = (
        information_nats(
            one.wanted, legs, one.listener, hypotheses=200, others=one.others.legs(0.0)
        ).sum(axis=0)
        for one in (alone, with_other)
        if one.others is not None
    )
    assert np.all(given < free)
    assert given[0] / free[0] < 0.8 * given[1] / free[1]


def test_two_find_all_sooner_than_one_and_stay_apart() -> None:
    """Short T2 with four animals, flown by the drone's own program."""
    short = replace(SCENARIOS["T2"], tags=4)
    one, two = (
        FlightOfDrones(short, replace(ONE, stop="ours", drones=count, corners=True), 2).flown()
        for count in (1, 2)
    )
    assert one.complete
    assert two.complete
    assert two.apart_m >= SEPARATION.distance_m
    assert two.time_s < 0.8 * one.time_s


def test_three_among_animals_stay_apart_and_away_from_them() -> None:
    """T5-drones in short."""
    scenario = replace(SCENARIOS["T5-drones"], tags=2)
    who = Contender(planner="mi_rate", stop="ours", drones=3)
    run = FlightOfDrones(scenario, who, 2).flown()
    assert run.complete
    assert run.apart_m >= SEPARATION.distance_m
    assert run.too_near_s == 0
