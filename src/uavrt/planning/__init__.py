"""Where to fly next to find tagged animals: beliefs, drone, area, energy, planners; no I/O."""

from uavrt.planning.actions import Action, FlyTo, Hold, Leg, Return, Rotate
from uavrt.planning.area import Circle, Polygon, SearchArea, survey_lines
from uavrt.planning.beliefs import Beliefs, ModelCheck, TagBelief
from uavrt.planning.energy import Battery, EnergyModel
from uavrt.planning.keep_away import KeepAway
from uavrt.planning.planners import DEFAULT_PLANNER, PLANNERS, planner_named
from uavrt.planning.propagation import GroundReflection
from uavrt.planning.search import Found, Search, SearchSettings
from uavrt.planning.situation import Candidate, Decision, Planner, Situation
from uavrt.planning.stopping import DeterminantStop, HonestStop, LongestAxisStop, StopRule
from uavrt.planning.vehicle import (
    FixedWing,
    Multirotor,
    Path,
    Vehicle,
    VehicleState,
    Wind,
    flown,
)

__all__ = [
    "DEFAULT_PLANNER",
    "PLANNERS",
    "Action",
    "Battery",
    "Beliefs",
    "Candidate",
    "Circle",
    "Decision",
    "DeterminantStop",
    "EnergyModel",
    "FixedWing",
    "FlyTo",
    "Found",
    "GroundReflection",
    "Hold",
    "HonestStop",
    "KeepAway",
    "Leg",
    "LongestAxisStop",
    "ModelCheck",
    "Multirotor",
    "Path",
    "Planner",
    "Polygon",
    "Return",
    "Rotate",
    "Search",
    "SearchArea",
    "SearchSettings",
    "Situation",
    "StopRule",
    "TagBelief",
    "Vehicle",
    "VehicleState",
    "Wind",
    "flown",
    "planner_named",
    "survey_lines",
]
