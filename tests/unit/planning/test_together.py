"""Several drones: who takes which tags, how far apart they stay, what the others will hear."""

from dataclasses import replace

import numpy as np
import pytest

from uavrt.errors import PlanError
from uavrt.planning import (
    Decision,
    FlyTo,
    Hold,
    Multirotor,
    Polygon,
    Search,
    SearchArea,
    SearchSettings,
    SearchTogether,
    Separation,
    Situation,
    VehicleState,
    Wind,
    flown,
)
from uavrt.planning.beside import Beside
from uavrt.planning.division import Start, divided
from uavrt.planning.information import information_nats
from uavrt.planning.planners.ways import checked, sampled
from uavrt_experiments.search import SCENARIOS
from uavrt_experiments.search.flight import beliefs_of
from uavrt_experiments.search.scenario import Contender
from uavrt_experiments.search.several import SEPARATION, FlightOfSeveral
from uavrt_experiments.search.world import World

VEHICLE = Multirotor(speed_m_s=5.0)
HERE = VehicleState(time_s=0.0, east_m=0.0, north_m=0.0, height_m=30.0)
TWO = Contender(planner="mi_rate", drones=2, corners=True)


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


def _search(starts: dict[int, VehicleState], particles: int = 200) -> SearchTogether:
    scenario = SCENARIOS["T2"]
    return SearchTogether(
        SearchSettings(
            vehicle=VEHICLE,
            area=SearchArea(search=Polygon.rectangle(0.0, 500.0, 0.0, 500.0)),
            stop=scenario.paper_stop,
            threshold_db=scenario.truth.threshold_db,
        ),
        beliefs_of(scenario, TWO, 1, particles, World(scenario, 1)),
        starts,
        lambda: _Straight(),
        {number: np.random.default_rng(number) for number in starts},
    )


class _Straight:
    """Flies 200 m east, whatever may be there."""

    def decide(self, situation: Situation) -> Decision:
        state = situation.state
        return Decision(
            action=FlyTo(east_m=state.east_m + 200.0, north_m=state.north_m), reason="east"
        )


@pytest.mark.parametrize(
    ("there", "named"),
    [
        (replace(HERE, east_m=20.0, height_m=40.0), "start 20 m from each other"),
        (replace(HERE, east_m=60.0, height_m=35.0), "would fly at 35 m and 30 m"),
    ],
)
def test_drones_that_start_too_near_each_other_are_refused(
    there: VehicleState, named: str
) -> None:
    with pytest.raises(PlanError, match=named):
        _search({1: HERE, 2: there})


def test_a_way_towards_another_drone_is_not_flown_and_that_away_is() -> None:
    """The one behind stays where it announced; that in front flies on."""
    search = _search({1: HERE, 2: replace(HERE, east_m=60.0, height_m=40.0)})
    stays = search.decide(1, HERE)
    assert isinstance(stays.action, Hold)
    assert "another drone would be" in stays.reason
    goes = search.decide(2, replace(HERE, east_m=60.0, height_m=40.0))
    assert goes.action == FlyTo(east_m=260.0, north_m=0.0)
    # It will be gone when the first arrives.
    assert isinstance(search.decide(1, HERE).action, FlyTo)


def _situation(beside: Beside) -> Situation:
    settings = _search({1: HERE}).settings
    scenario = SCENARIOS["T2"]
    beliefs = beliefs_of(scenario, TWO, 1, 500, World(scenario, 1))
    search = Search(settings, beliefs, _Straight(), np.random.default_rng(1))
    return search.situation(HERE, Wind(), beside)


def test_ways_that_cross_at_other_times_are_allowed() -> None:
    begun = replace(HERE, east_m=60.0, north_m=-60.0)
    crossing = flown(VEHICLE, begun, FlyTo(east_m=60.0, north_m=300.0))
    situation = _situation(Beside(separation=Separation(), announced=(crossing,)))
    ways = checked(situation, np.array([130.0, 60.0, -80.0]), np.array([0.0, 300.0, 0.0]))
    assert ways.refused[0] == "within 25 m of another drone's way"
    assert ways.refused[1:] == [None, None]
    later = replace(situation, state=replace(HERE, time_s=60.0))
    assert checked(later, np.array([130.0]), np.array([0.0])).refused == [None]


def test_what_another_drone_will_hear_counts_no_more() -> None:
    """Of two ways alike the one that another flies tells less; so both spread out."""
    along = flown(VEHICLE, HERE, FlyTo(east_m=250.0, north_m=0.0))
    alone, with_other = (
        _situation(Beside(separation=Separation(), listening=paths)) for paths in ((), (along,))
    )
    ends = np.array([250.0, 0.0]), np.array([0.0, 250.0])
    legs = sampled(alone, *ends, np.array([52.0, 52.0]), 8)
    assert alone.beside is not None
    assert with_other.beside is not None
    assert alone.beside.legs(0.0) is None
    free, given = (
        information_nats(
            one.wanted, legs, one.listener, hypotheses=200, others=one.beside.legs(0.0)
        ).sum(axis=0)
        for one in (alone, with_other)
        if one.beside is not None
    )
    assert np.all(given < free)
    assert given[0] / free[0] < 0.8 * given[1] / free[1]


def test_a_drone_that_is_not_heard_of_gives_its_tags_back() -> None:
    scenario = SCENARIOS["T2"]
    flight = FlightOfSeveral(scenario, TWO, 3, 300, vanishes=(1, 30.0))
    outcome = flight.flown()
    assert outcome.complete
    assert outcome.apart_m >= SEPARATION.distance_m
    assert flight.search.missing(float(flight.second)) == {1}
    assert flight.search.beside(0, float(flight.second)).left == frozenset()


@pytest.mark.parametrize("corners", [False, True])
def test_several_find_all_sooner_and_stay_apart(corners: bool) -> None:
    """T2 in short; with one drone these take 185 s in the mean."""
    who = Contender(planner="mi_rate", drones=3, corners=corners)
    runs = [FlightOfSeveral(SCENARIOS["T2"], who, seed, 300).flown() for seed in (1, 2)]
    assert all(run.complete for run in runs)
    assert all(run.apart_m >= SEPARATION.distance_m for run in runs)
    assert np.mean([run.time_s for run in runs]) < 150.0


def test_several_among_animals_stay_apart_and_away_from_them() -> None:
    """T5-drones in short."""
    scenario = SCENARIOS["T5-drones"]
    for seed, who in enumerate(scenario.contenders, 2):
        run = FlightOfSeveral(scenario, who, seed, 800).flown()
        assert run.complete
        assert run.apart_m >= SEPARATION.distance_m
        assert run.too_near_s == 0
