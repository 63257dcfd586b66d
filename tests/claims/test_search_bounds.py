"""Bounds of searches: against cases that can be worked out, and against what is simulated."""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from some import some

from uavrt.planning.drone_model.drone_motion import VehicleState
from uavrt.planning.stopping import AccuracyStop, StopRule
from uavrt_experiments.search.bounds import (
    LeastErrors,
    after_a_second,
    heard_share,
    least_mean_m,
    least_rms_m,
    least_time_s,
    most_informative,
    needed_information,
    pulse_information,
    tree_m,
)
from uavrt_experiments.search.campaign import fly_all, plan
from uavrt_experiments.search.catalogue import SCENARIOS
from uavrt_experiments.search.flight import start_of
from uavrt_experiments.search.stops import DeterminantStop, LongestAxisStop
from uavrt_experiments.search.table import results
from uavrt_experiments.search.world import World

_Floats = NDArray[np.float64]
EXPONENT, SIGMA_DB = 3.1, 4.22
_DRAWN = np.random.default_rng(4).normal(size=(2, 20_000))


def circle95_m(major_m: float, minor_m: float) -> float:
    """Radius that holds 95 % of a normal cloud, drawn."""
    return float(np.quantile(np.hypot(major_m * _DRAWN[0], minor_m * _DRAWN[1]), 0.95))


def test_a_pulse_tells_of_the_distance_alone_and_less_with_its_square() -> None:
    """One level gives the distance to σ ln 10 / (10 n) of itself."""
    for r in (50.0, 200.0):
        told = pulse_information(
            lambda place: -10.0 * EXPONENT * math.log10(float(np.hypot(*place))),
            np.array([r, 0.0]),
            sigma_db=SIGMA_DB,
        )
        share = SIGMA_DB * math.log(10.0) / (10.0 * EXPONENT)
        assert told[0, 0] ** -0.5 == pytest.approx(share * r, rel=1e-3)
        assert abs(told[1, 1]) < 1e-9 * told[0, 0]


def test_missed_pulses_and_levels_below_the_threshold_tell_less() -> None:
    here = np.array([100.0, 0.0])

    def level(place_m: _Floats) -> float:
        return -float(place_m[0]) / 10.0

    whole, missed, half = (
        float(pulse_information(level, here, sigma_db=2.0, **more)[0, 0])
        for more in ({}, {"missed_share": 0.25}, {"threshold_db": -10.0})
    )
    assert whole == pytest.approx(0.0025)
    assert missed == pytest.approx(0.75 * whole)
    assert 0.5 * whole < half < whole


@pytest.mark.parametrize("below", [-1.5, 0.0, 1.0])
def test_what_silence_leaves_of_a_level_is_the_variance_of_its_score(below: float) -> None:
    """Simulated: the slope of the logarithm of the likelihood over the level."""
    drawn = np.random.default_rng(1).normal(size=400_000)
    density = math.exp(-0.5 * below**2) / math.sqrt(2.0 * math.pi)
    silent = 0.5 * math.erfc(-below / math.sqrt(2.0))
    score = np.where(drawn > below, drawn, -density / silent)
    assert np.mean(score) == pytest.approx(0.0, abs=0.01)
    assert heard_share(below) == pytest.approx(np.mean(score**2), rel=0.02)


def test_a_louder_tag_never_tells_less() -> None:
    shares = [heard_share(below) for below in np.linspace(-9.0, 9.0, 400)]
    assert np.all(np.diff(shares) <= 1e-12)
    assert (shares[0], shares[-1]) == (1.0, 0.0)


def test_information_on_a_walker_settles_where_steps_take_what_pulses_bring() -> None:
    """J = 1 / (q + 1 / J) + f has the root J = f / 2 + √(f² / 4 + f / q)."""
    q, f = 4.0, 0.01
    known = np.diag([1e-6, 1e-6])
    for _ in range(2000):
        known = after_a_second(known, math.sqrt(q)) + f * np.eye(2)
    assert known[0, 0] == pytest.approx(f / 2.0 + math.sqrt(f**2 / 4.0 + f / q), rel=1e-6)
    assert after_a_second(known, 0.0) is known


def test_normal_errors_have_the_length_that_is_drawn() -> None:
    information = np.array([[[0.04, 0.01], [0.01, 0.01]]])
    cloud = np.random.default_rng(2).multivariate_normal(
        [0.0, 0.0], np.linalg.inv(information[0]), 400_000
    )
    lengths = np.hypot(*cloud.T)
    assert least_mean_m(information) == pytest.approx(lengths.mean(), rel=0.01)
    assert least_rms_m(information) == pytest.approx(np.sqrt((lengths**2).mean()), rel=0.01)


def test_no_estimate_of_simulated_levels_beats_the_bound_and_the_best_comes_near() -> None:
    """A tag that rests anywhere, levels along a way with a bend, the best estimate of each."""
    rng = np.random.default_rng(3)
    way = np.array([(4.0 * n, 0.0) for n in range(50)] + [(200.0, 4.0 * n) for n in range(50)])
    side = 300.0
    axis = np.linspace(0.0, side, 121)
    cells = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    slant = np.sqrt(((cells[:, None] - way[None]) ** 2).sum(axis=2) + 20.0**2)
    expected = -10.0 * EXPONENT * np.log10(slant)
    errors, informations = [], []
    for _ in range(250):
        tag = rng.uniform(0.0, side, 2)
        known = np.diag([12.0 / side**2, 12.0 / side**2])
        levels = []
        for x, y in way:

            def level(place_m: _Floats, x: float = x, y: float = y) -> float:
                away = math.sqrt((place_m[0] - x) ** 2 + (place_m[1] - y) ** 2 + 400.0)
                return -10.0 * EXPONENT * math.log10(away)

            levels.append(level(tag) + rng.normal(0.0, SIGMA_DB))
            known = known + pulse_information(level, tag, sigma_db=SIGMA_DB)
        weight = -0.5 * ((np.array(levels) - expected) ** 2).sum(axis=1) / SIGMA_DB**2
        weight = np.exp(weight - weight.max())
        best = (weight[:, None] * cells).sum(axis=0) / weight.sum()
        errors.append(float(np.hypot(*(best - tag))))
        informations.append(known)
    reached = math.sqrt(float(np.mean(np.square(errors))))
    bound = least_rms_m(np.array(informations))
    assert bound < reached < 3.0 * bound


@pytest.mark.parametrize(
    ("stop", "holds"),
    [
        (DeterminantStop(limit_m4=1e4), lambda major, minor: (major * minor) ** 2 <= 1e4),
        (LongestAxisStop(limit_m=15.0), lambda major, minor: major <= 15.0),
        (AccuracyStop(radius95_m=24.5), lambda major, minor: circle95_m(major, minor) <= 24.5),
    ],
)
def test_no_cloud_that_a_rule_takes_has_less_information(
    stop: StopRule, holds: Callable[[float, float], bool]
) -> None:
    needed = some(needed_information(stop))
    least = math.inf
    for major in np.linspace(2.0, 40.0, 60):
        for minor in major * np.linspace(0.1, 1.0, 12):
            if holds(major, minor):
                least = min(least, major**-2 + minor**-2)
    assert 0.97 * needed <= least < 1.25 * needed


def test_no_way_past_circles_is_shorter_than_their_tree() -> None:
    """Against every order, with the best of many touching points."""
    rng = np.random.default_rng(5)
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for _ in range(6):
        start = rng.uniform(0.0, 100.0, 2)
        middles, radii = rng.uniform(0.0, 100.0, (4, 2)), rng.uniform(0.0, 15.0, 4)
        shortest = math.inf
        for order in itertools.permutations(range(4)):
            to = np.zeros(1)
            here = start[None]
            for one in order:
                points = middles[one] + radii[one] * ring
                step = np.linalg.norm(points[:, None] - here[None], axis=2)
                to, here = (step + to).min(axis=1), points
            shortest = min(shortest, float(to.min()))
        assert tree_m(start[None], middles, radii) <= shortest + 1e-9
    line = np.array([(30.0, 0.0), (60.0, 0.0), (90.0, 0.0)])
    assert tree_m(np.zeros((1, 2)), line, np.full(3, 5.0)) == pytest.approx(25.0 + 20.0 + 20.0)
    ends = np.array([(0.0, 0.0), (90.0, 0.0)])
    assert tree_m(ends, line, np.zeros(3)) == pytest.approx(60.0)


def test_nobody_knows_more_of_a_distant_pulse_than_was_looked_up() -> None:
    """Headings and distances between those that were looked at."""
    scenario = SCENARIOS["T2"]
    world = World(scenario, 8)
    most = most_informative(scenario, world.exponent, scenario.truth.level_1m_db)
    rng = np.random.default_rng(6)
    for _ in range(60):
        distance, yaw = float(rng.uniform(0.0, 600.0)), float(rng.uniform(0.0, 360.0))
        state = VehicleState(
            time_s=0.0, east_m=0.0, north_m=0.0, height_m=scenario.height_m, yaw_deg=yaw
        )

        def level(place_m: _Floats, state: VehicleState = state) -> float:
            return world.level_db(state, place_m, scenario.truth.level_1m_db)

        told = pulse_information(
            level,
            np.array([distance, 0.0]),
            sigma_db=scenario.truth.sigma_db,
            threshold_db=scenario.truth.threshold_db,
        )
        assert np.trace(told) <= 1.02 * most.at(np.array([distance]))[0]


def test_no_way_at_the_vehicles_speed_brings_what_is_needed_before_the_bound() -> None:
    """Straight ways to the animals in every order, with every pulse at its best."""
    scenario = replace(SCENARIOS["T2"], tags=3)
    needed = some(needed_information(scenario.paper_stop))
    for seed in (1, 2):
        bound = some(least_time_s(scenario, scenario.paper_stop, seed, [start_of(scenario)]))
        first = World(scenario, seed).places_m.copy()
        for order in itertools.permutations(range(3)):
            world = World(scenario, seed)
            most = most_informative(scenario, world.exponent, float(world.levels_1m_db.max()))
            here, to, told, second = np.zeros(2), list(order), np.zeros(3), 0
            while told.min() < needed - 24.0 / 500.0**2:
                second += 1
                world.advance(second)
                left = first[to[0]] - here
                here = here + left * min(1.0, scenario.vehicle.speed_m_s / np.hypot(*left))
                if len(to) > 1 and np.hypot(*(first[to[0]] - here)) < 1.0:
                    to.pop(0)
                told += most.at(np.hypot(*(world.places_m - here).T))
            assert second >= bound


def test_a_search_of_tags_that_are_heard_from_afar_ends_no_sooner_for_a_shorter_way() -> None:
    """More drones halve it at most, and an easier rule never takes longer."""
    scenario = SCENARIOS["T2"]
    start = start_of(scenario)
    alone = least_time_s(scenario, scenario.paper_stop, 3, [start])
    both = least_time_s(scenario, scenario.paper_stop, 3, [start, start])
    easy = least_time_s(scenario, DeterminantStop(limit_m4=1e6), 3, [start])
    assert alone is not None
    assert 0.5 * alone <= some(both) <= alone
    assert some(easy) < alone < scenario.limit_s


def test_over_hills_nothing_is_bounded() -> None:
    scenario = SCENARIOS["T6"]
    start = start_of(scenario)
    assert least_time_s(scenario, scenario.paper_stop, 1, [start]) is None
    least = LeastErrors(scenario, World(scenario, 1))
    least.hear([start])
    assert least.of(1) is None


def test_bounds_stand_beside_the_figures_and_below_them() -> None:
    planned = [
        run for run in plan("T2", 2, 5, 600, baselines=False) if run.contender.filter == "ours"
    ]
    rows = results(SCENARIOS["T2"], fly_all(planned))
    bounded = {one.quantity: one for one in rows if one.bound is not None}
    assert {"time, mean, s", "time, p90, s", "error, mean, m", "error, RMS, m"} <= set(bounded)
    assert all(0.2 * one.figure < one.bound < one.high for one in bounded.values() if one.bound)
