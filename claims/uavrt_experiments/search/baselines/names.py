"""The baselines by name; drones can also fly them, by the entry points of `uavrt.planners`."""

from collections.abc import Callable

from uavrt.planning.planners.registry import planner_named
from uavrt.planning.situation import Planner
from uavrt_experiments.search.baselines.closest import Closest
from uavrt_experiments.search.baselines.joint import ConservationBots
from uavrt_experiments.search.baselines.lavapilot import LavaPilot
from uavrt_experiments.search.baselines.published import Renyi, Shannon
from uavrt_experiments.search.baselines.surveys import Lawnmower, RotationPoints

BASELINES: dict[str, Callable[[], Planner]] = {
    "rotation_points": RotationPoints,
    "lawnmower": Lawnmower,
    "closest": Closest,
    "shannon": Shannon,
    "renyi": Renyi,
    "lavapilot": LavaPilot,
    "conservationbots": ConservationBots,
}


def any_planner(name: str) -> Planner:
    """Make a planner by name: a baseline, ours, or one of another package."""
    return BASELINES[name]() if name in BASELINES else planner_named(name)
