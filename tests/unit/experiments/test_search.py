"""The search tables in their short form: paired worlds, our planner, the rows."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from depth import seeds, share
from some import some

from uavrt.planning.drone_model.drone_motion import VehicleState
from uavrt_experiments.kept import KeptOutcomes
from uavrt_experiments.search import campaign
from uavrt_experiments.search.campaign import fly_all, plan, so_far
from uavrt_experiments.search.catalogue import SCENARIOS
from uavrt_experiments.search.drones import FlightOfDrones
from uavrt_experiments.search.flight import Judged, Outcome, beliefs_of, fly
from uavrt_experiments.search.page import page_section
from uavrt_experiments.search.scenario import Contender
from uavrt_experiments.search.table import Flown, honesty, results, section
from uavrt_experiments.search.world import World

pytestmark = pytest.mark.slow

OURS = Contender(planner="mi_rate")
DRONE = replace(OURS, stop="ours")
"""Our planner as the drone's own program flies it."""
NOTHING = Outcome(
    seed=1,
    time_s=9.0,
    distance_m=1.0,
    judged=(),
    lost=0,
    nearest_m=9.0,
    too_near_s=0,
    decision_s=(0.1,),
    path_m=((0.0, 0.0),),
    ends_m=((1.0, 1.0),),
)
"""A flight that found no animal."""


def test_worlds_of_one_seed_are_the_same_for_every_planner() -> None:
    here = VehicleState(time_s=0.0, east_m=200.0, north_m=200.0, height_m=20.0)
    there = replace(here, east_m=10.0, yaw_deg=90.0)
    worlds = [World(SCENARIOS["T2"], 3) for _ in range(2)]
    for second in range(1, 20):
        worlds[0].step(second, here)
        worlds[1].step(second, there)
    assert np.array_equal(worlds[0].places_m, worlds[1].places_m)


def test_the_table_of_trackerbots_in_short() -> None:
    """All ten walking animals, each seed; the error is what the stop rule makes it."""
    runs = [fly(SCENARIOS["T2"], OURS, seed, particles=1000) for seed in range(2)]
    assert all(run.complete for run in runs)
    assert np.mean([run.time_s for run in runs]) < 400.0
    assert np.mean([run.mean_error_m for run in runs]) < 18.0


def test_ours_flies_a_short_round_of_animals_that_are_all_heard() -> None:
    """Going for the next tag alone it took 204 s and .92 km on these seeds."""
    runs = [fly(SCENARIOS["T1"], OURS, 100_000 + n, particles=1000) for n in range(3)]
    assert all(run.complete for run in runs)
    assert np.mean([run.time_s for run in runs]) < 180.0
    assert np.mean([run.distance_m for run in runs]) < 800.0


@pytest.mark.parametrize("name", ["T1", "T4"])
def test_renyi_gets_on_where_it_pays_to_turn_about(name: str) -> None:
    """Its antenna looks both ways alike, and turning about takes longer than a cycle."""
    short = replace(SCENARIOS[name], limit_s=90)
    run = fly(short, Contender(planner="renyi"), 1, particles=200)
    assert run.distance_m > 40.0 * short.vehicle.speed_m_s


def test_rows_hold_every_contender_with_intervals_and_failures() -> None:
    """Also one with the authors' filter; the flights end after 20 s."""
    short = replace(SCENARIOS["T2"], limit_s=20)
    contenders = (OURS, Contender(planner="renyi", filter="TrackerBots"))
    assert set(contenders) <= {run.contender for run in plan("T2", 2, 1, 100)}
    flown = [
        Flown(
            contender=one,
            outcomes=tuple(fly(short, one, seed, particles=100) for seed in (1, 2)),
        )
        for one in contenders
    ]
    rows = results(SCENARIOS["T2"], flown)
    text = section(SCENARIOS["T2"], rows)
    assert "renyi, authors' filter" in text
    assert max(map(len, text.splitlines())) <= 120
    assert len(text.splitlines()) < 15
    barred = {row.quantity for row in rows if row.most is not None or row.least is not None}
    assert barred == {bar.quantity for bar in SCENARIOS["T2"].bars}
    assert not [row for row in rows if row.low > row.figure + 1e-9]
    assert sum(row.quantity == "complete, share" for row in rows) == 2


def test_a_table_on_the_page_has_its_command_failures_and_bars() -> None:
    failed = replace(NOTHING, lost=10)
    rows = results(SCENARIOS["T1"], [Flown(contender=OURS, outcomes=(failed, failed))])
    text = page_section(SCENARIOS["T1"], rows, "uavrt experiment", "Measured now.")
    assert text.startswith("## T1: ")
    assert "`uavrt experiment`" in text
    assert "2 of 2 |" in text
    assert "| asked | ≤ 12.5 |" in text


@pytest.mark.parametrize(
    ("name", "tags", "most_s", "most_m"),
    share(
        [
            ("T5", 6, 650.0, 30.0),
            ("T3", 5, 130.0, 25.0),
            ("T7", 1, 500.0, 40.0),
            ("T5-19", 3, 1665.0, 35.0),
        ],
        2,
    ),
)
def test_animals_of_each_table_are_found(
    name: str, tags: int, most_s: float, most_m: float
) -> None:
    short = replace(SCENARIOS[name], tags=tags)
    run = fly(short, OURS, 1, particles=600)
    assert run.complete
    assert run.time_s < most_s
    assert run.mean_error_m < most_m


def test_the_searchers_map_of_the_hills_is_as_wrong_as_maps_are() -> None:
    scenario = SCENARIOS["T6"]
    world = World(scenario, 1)
    beliefs = beliefs_of(scenario, OURS, 1, 100, world)
    hills = some(beliefs[1].prior.hills)
    rng = np.random.default_rng(2)
    places = rng.uniform(100.0, 1900.0, (200, 2))
    ground = some(scenario.truth.ground)
    off = hills.rise_m(*places.T) - ground(*places.T) + ground(*np.array(scenario.start_m))
    assert abs(np.mean(off)) < 4.0
    assert 0.5 < np.std(off) < 5.0


def test_animals_behind_hills_are_found_where_they_are() -> None:
    """The map says half of what hills take here: one of them was called found 700 m off."""
    short = replace(SCENARIOS["T6"], tags=2, limit_s=1200)
    run = FlightOfDrones(short, DRONE, 900_003).flown()
    assert run.complete
    errors = [one.error_m for one in run.judged if one.error_m is not None]
    assert max(errors) < 120.0
    assert np.sqrt(np.mean(np.square(errors))) < 45.0


@pytest.mark.parametrize("name", ["T8", "T10"])
def test_a_hard_table_is_flown_beside_its_easier_case(name: str) -> None:
    short = replace(SCENARIOS[name], tags=2)
    (easier,) = (one for one in short.contenders if one.easier and one.stop == "ours")
    assert replace(DRONE, easier=True) == easier
    cases = (short, DRONE), (replace(some(short.easier), tags=2), easier)
    flown = [
        Flown(
            contender=who,
            outcomes=tuple(FlightOfDrones(case, who, seed).flown() for seed in seeds(1, 2)),
        )
        for case, who in cases
    ]
    rows = results(short, flown)
    (ratio,) = (one for one in rows if "easier" in one.quantity)
    assert ratio.most == 1.5
    assert 0.3 < ratio.figure < 5.0
    assert all(run.complete for one in flown for run in one.outcomes)


def test_strengths_are_told_as_the_world_has_them() -> None:
    easier = some(SCENARIOS["T8"].easier)
    world = World(easier, 4)
    told = beliefs_of(easier, OURS, 4, 100, world)
    levels = [belief.prior.level_db for belief in told.values()]
    assert np.ptp(levels) > 5.0
    assert np.allclose(levels, world.levels_1m_db - 20.0 * world.exponent)


def test_hills_have_their_relief_and_hide_animals_behind_them() -> None:
    scenario = SCENARIOS["T6"]
    ground = some(scenario.truth.ground)
    x, y = np.meshgrid(np.arange(0.0, 2000.0, 50.0), np.arange(0.0, 2000.0, 50.0))
    heights = ground(x, y)
    assert 130.0 < np.ptp(heights) < 270.0
    above, flat = (
        World(replace(scenario, truth=replace(scenario.truth, ground=one)), 1)
        for one in (ground, None)
    )
    here = VehicleState(time_s=0.0, east_m=993.0, north_m=504.0, height_m=60.0)
    lost = [
        flat.level_db(here, np.array([east, 1500.0]), 40.0)
        - above.level_db(here, np.array([east, 1500.0]), 40.0)
        for east in np.arange(100.0, 2000.0, 100.0)
    ]
    assert max(lost) > 15.0


def test_declared_circles_of_all_tables_are_judged_together() -> None:
    def judged(error_m: float | None) -> Judged:
        return Judged(tag_id=1, time_s=9.0, error_m=error_m, radius95_m=20.0)

    run = replace(NOTHING, judged=tuple(judged(one) for one in (3.0, 10.0, 25.0, None)))
    paper = Flown(contender=OURS, outcomes=(run,))
    ours = Flown(contender=replace(OURS, stop="ours"), outcomes=(run,))
    held, false = honesty([paper, ours, ours])
    assert held.n == 6
    assert held.figure == pytest.approx(2.0 / 3.0)
    assert (false.n, false.figure) == (8, 0.25)


@pytest.mark.parametrize("name", share([*SCENARIOS], 2))
def test_each_table_flies_its_first_half_minute(name: str) -> None:
    short = replace(SCENARIOS[name], limit_s=30)
    for run in (fly(short, OURS, 1, particles=200), FlightOfDrones(short, DRONE, 1).flown()):
        assert run.complete or run.time_s >= 30.0
        assert run.distance_m > 10.0


def test_who_finds_nothing_misses_every_bar_of_the_error() -> None:
    scenario = SCENARIOS["T1"]
    nothing = replace(NOTHING, time_s=scenario.limit_s, lost=10)
    rows = results(scenario, [Flown(contender=OURS, outcomes=(nothing, nothing))])
    errors = [one for one in rows if one.barred and one.quantity.startswith("error")]
    assert errors
    assert all(one.contradicted and one.n == 0 and math.isnan(one.figure) for one in errors)


def test_runs_that_are_kept_are_not_flown_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    planned = plan("T7", 2, 1, 100, baselines=False)
    with KeptOutcomes(tmp_path / "kept.jsonl", made_with="this") as kept:
        first = fly_all(planned[:3], kept=kept)
        assert so_far(planned, kept) == first
    monkeypatch.setattr(campaign, "flown", lambda run: pytest.fail(f"{run} is flown again"))
    with KeptOutcomes(tmp_path / "kept.jsonl", made_with="this") as kept:
        done: list[int] = []
        assert fly_all(planned[:3], kept=kept, on_progress=done.append) == first
        assert done == [3]
    assert [len(one.outcomes) for one in first] == [2, 1]
