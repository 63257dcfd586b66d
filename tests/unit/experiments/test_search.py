"""The search tables in their short form: paired worlds, our planner, the rows."""

from dataclasses import replace

import numpy as np
import pytest

from uavrt.experiments.figures import table
from uavrt.experiments.search import SCENARIOS, fly_all, plan, results
from uavrt.experiments.search.flight import fly
from uavrt.experiments.search.scenario import Contender
from uavrt.experiments.search.world import World
from uavrt.planning import VehicleState

OURS = Contender(planner="mi_rate")


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


def test_rows_hold_every_contender_with_intervals_and_failures() -> None:
    planned = [run for run in plan("T2", 2, 1, 300) if run.contender.planner != "lawnmower"]
    short = [
        run
        for run in planned
        if run.contender in (OURS, Contender(planner="renyi", filter="TrackerBots"))
    ]
    rows = results(SCENARIOS["T2"], fly_all(short))
    text = table(rows)
    assert "renyi, filter TrackerBots, stop paper" in text
    barred = {row.quantity for row in rows if row.most is not None or row.least is not None}
    assert barred == {bar.quantity for bar in SCENARIOS["T2"].bars}
    for row in rows:
        assert row.low <= row.figure + 1e-9, row
    complete = [row for row in rows if row.quantity == "complete, share"]
    assert len(complete) == 2


@pytest.mark.parametrize("name", list(SCENARIOS))
def test_each_table_flies_its_first_half_minute(name: str) -> None:
    short = replace(SCENARIOS[name], limit_s=30)
    run = fly(short, OURS, 1, particles=200)
    assert run.time_s >= 30.0
    assert run.distance_m > 10.0
