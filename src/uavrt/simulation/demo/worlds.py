"""Worlds of the demo: the built-in world, or the world of a scenario file."""

import math
from dataclasses import replace
from pathlib import Path

from uavrt.core.errors import UsageError
from uavrt.simulation.demo.demo_search import RADIUS_M
from uavrt.simulation.scene.demo_world import demo_scenario, search_scenario, searched_scenario
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.scene.scenario_file import load_scenario

FLIGHT_S = 120.0
"""Default duration of a flight in the built-in world [s]."""
SHORTEST_S = 20.0
"""Shortest flight with a scenario file [s]; detection needs some seconds to begin."""
AFTER_S = 120.0
"""Time that is simulated after the end of a search, for the return flight [s]."""


def flight_world(
    file: Path | None, *, duration_s: float | None, seed: int | None, coded: bool
) -> Scenario:
    """World in which the drone flies planned legs; without a `file`, the built-in world."""
    if file is None:
        return demo_scenario(duration_s or FLIGHT_S, 1 if seed is None else seed, coded=coded)
    scenario = _of_file(file, seed, coded)
    scenario = replace(scenario, duration_s=duration_s or scenario.duration_s)
    if scenario.duration_s < SHORTEST_S:
        raise UsageError(
            f"a flight of {scenario.duration_s:g} s ends before detection begins",
            remedy=f"Give --duration, at least {SHORTEST_S:g} s",
        )
    return scenario


def search_world(
    file: Path | None, *, limit_s: float, seed: int | None, coded: bool
) -> Scenario:
    """World for a search of at most `limit_s`; other parameters are as in `flight_world`."""
    if file is None:
        return search_scenario(1 if seed is None else seed, coded=coded)
    scenario = _of_file(file, seed, coded)
    for tag in scenario.tag:
        away_m = math.hypot(tag.north_m, tag.east_m)
        if tag.listed and away_m > RADIUS_M:
            raise UsageError(
                f"tag {tag.tag_id} is {away_m:.0f} m from home, but the demo's search "
                f"covers only {RADIUS_M:.0f} m",
                remedy="Put it nearer in the scenario, or set listed = false",
            )
    return searched_scenario(scenario, limit_s + AFTER_S)


def _of_file(file: Path, seed: int | None, coded: bool) -> Scenario:
    if coded:
        raise UsageError(
            "--coded works only with the built-in world, not with --scenario",
            remedy="Leave --coded out, and set gaps_s for tags of the scenario",
        )
    scenario = load_scenario(file)
    if not scenario.tags:
        raise UsageError(
            f"{file} has no tag to search for",
            remedy="Add a [[tag]], or remove listed = false from a tag",
        )
    return scenario if seed is None else replace(scenario, seed=seed)
