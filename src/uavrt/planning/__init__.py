"""Decide where to fly next to find tagged animals; the package does no I/O.

`beliefs` holds the probability of each tag's position. `drone_model/drone_motion` and
`drone_model/energy` model what the drone can reach, and `area` limits where it may fly.
`search` gets the next path from one of the `planners`. `stopping` decides when a tag is found;
`division` and `shares` divide tags among drones. `detectability/detection_coverage` computes
where a tag would have been detected.
"""

from typing import TYPE_CHECKING

from uavrt.core.runtime.lazy import lazily

if TYPE_CHECKING:
    from uavrt.planning.area import Circle as Circle
    from uavrt.planning.area import Polygon as Polygon
    from uavrt.planning.area import SearchArea as SearchArea
    from uavrt.planning.beliefs import Beliefs as Beliefs
    from uavrt.planning.beliefs import TagBelief as TagBelief
    from uavrt.planning.detectability.ground_propagation import (
        GroundReflection as GroundReflection,
    )
    from uavrt.planning.detectability.link_budget import LinkBudget as LinkBudget
    from uavrt.planning.drone_model.drone_motion import FixedWing as FixedWing
    from uavrt.planning.drone_model.drone_motion import Multirotor as Multirotor
    from uavrt.planning.drone_model.drone_motion import Path as Path
    from uavrt.planning.drone_model.drone_motion import Vehicle as Vehicle
    from uavrt.planning.drone_model.drone_motion import VehicleState as VehicleState
    from uavrt.planning.drone_model.drone_motion import Wind as Wind
    from uavrt.planning.drone_model.energy import Battery as Battery
    from uavrt.planning.drone_model.energy import EnergyModel as EnergyModel
    from uavrt.planning.drone_model.planner_actions import FlyTo as FlyTo
    from uavrt.planning.drone_model.planner_actions import Hold as Hold
    from uavrt.planning.drone_model.planner_actions import Return as Return
    from uavrt.planning.drone_model.planner_actions import Rotate as Rotate
    from uavrt.planning.planners.mi_rate import MiRate as MiRate
    from uavrt.planning.planners.registry import PLANNERS as PLANNERS
    from uavrt.planning.planners.registry import planner_named as planner_named
    from uavrt.planning.search import Search as Search
    from uavrt.planning.situation import Candidate as Candidate
    from uavrt.planning.situation import Decision as Decision
    from uavrt.planning.situation import Planner as Planner
    from uavrt.planning.situation import SearchSettings as SearchSettings
    from uavrt.planning.situation import Situation as Situation
    from uavrt.planning.stopping import AccuracyStop as AccuracyStop
    from uavrt.planning.stopping import StopRule as StopRule

__all__, __getattr__ = lazily(
    __name__,
    {
        "drone_model.planner_actions": "FlyTo Hold Return Rotate",
        "area": "Circle Polygon SearchArea",
        "beliefs": "Beliefs TagBelief",
        "drone_model.energy": "Battery EnergyModel",
        "detectability.link_budget": "LinkBudget",
        "planners.mi_rate": "MiRate",
        "planners.registry": "PLANNERS planner_named",
        "detectability.ground_propagation": "GroundReflection",
        "search": "Search",
        "situation": "Candidate Decision Planner SearchSettings Situation",
        "stopping": "HonestStop StopRule",
        "drone_model.drone_motion": "FixedWing Multirotor Path Vehicle VehicleState Wind",
    },
)
