"""Decide where to fly next to find tagged animals; no I/O.

`beliefs` hold the probability of each tag's position, `vehicle` and `energy` model what the
drone can reach, `area` limits where it may fly. `search` gets the next path from one of the
`planners`; `stopping` decides when a tag is found, `division` and `shares` divide tags among
drones, `coverage` computes where a tag would have been detected.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.planning.actions import FlyTo as FlyTo
    from uavrt.planning.actions import Hold as Hold
    from uavrt.planning.actions import Return as Return
    from uavrt.planning.actions import Rotate as Rotate
    from uavrt.planning.area import Circle as Circle
    from uavrt.planning.area import Polygon as Polygon
    from uavrt.planning.area import SearchArea as SearchArea
    from uavrt.planning.beliefs import Beliefs as Beliefs
    from uavrt.planning.beliefs import TagBelief as TagBelief
    from uavrt.planning.energy import Battery as Battery
    from uavrt.planning.energy import EnergyModel as EnergyModel
    from uavrt.planning.link_budget import LinkBudget as LinkBudget
    from uavrt.planning.planners.mi_rate import MiRate as MiRate
    from uavrt.planning.planners.registry import PLANNERS as PLANNERS
    from uavrt.planning.planners.registry import planner_named as planner_named
    from uavrt.planning.propagation import GroundReflection as GroundReflection
    from uavrt.planning.search import Search as Search
    from uavrt.planning.situation import Candidate as Candidate
    from uavrt.planning.situation import Decision as Decision
    from uavrt.planning.situation import Planner as Planner
    from uavrt.planning.situation import SearchSettings as SearchSettings
    from uavrt.planning.situation import Situation as Situation
    from uavrt.planning.stopping import HonestStop as HonestStop
    from uavrt.planning.stopping import StopRule as StopRule
    from uavrt.planning.vehicle import FixedWing as FixedWing
    from uavrt.planning.vehicle import Multirotor as Multirotor
    from uavrt.planning.vehicle import Path as Path
    from uavrt.planning.vehicle import Vehicle as Vehicle
    from uavrt.planning.vehicle import VehicleState as VehicleState
    from uavrt.planning.vehicle import Wind as Wind

__all__, __getattr__ = lazily(
    __name__,
    {
        "actions": "FlyTo Hold Return Rotate",
        "area": "Circle Polygon SearchArea",
        "beliefs": "Beliefs TagBelief",
        "energy": "Battery EnergyModel",
        "link_budget": "LinkBudget",
        "planners.mi_rate": "MiRate",
        "planners.registry": "PLANNERS planner_named",
        "propagation": "GroundReflection",
        "search": "Search",
        "situation": "Candidate Decision Planner SearchSettings Situation",
        "stopping": "HonestStop StopRule",
        "vehicle": "FixedWing Multirotor Path Vehicle VehicleState Wind",
    },
)
