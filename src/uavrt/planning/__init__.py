"""Where to fly next to find tagged animals: beliefs, drone, area, energy, planners; no I/O."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.planning.actions import Action, FlyTo, Hold, Return, Rotate
    from uavrt.planning.area import Circle, Polygon, SearchArea, survey_lines
    from uavrt.planning.beliefs import Beliefs, ModelCheck, TagBelief
    from uavrt.planning.beside import Beside, Separation, Strip
    from uavrt.planning.coverage import (
        Absence,
        Coverage,
        ListeningWay,
        absence,
        coverage_of,
        listening_way,
    )
    from uavrt.planning.division import Start
    from uavrt.planning.energy import Battery, EnergyModel
    from uavrt.planning.keep_away import KeepAway
    from uavrt.planning.level import at_100_m
    from uavrt.planning.link_budget import LinkBudget
    from uavrt.planning.planners import (
        DEFAULT_PLANNER,
        PLANNERS,
        MiRate,
        Shannon,
        planner_named,
    )
    from uavrt.planning.propagation import GroundReflection
    from uavrt.planning.search import Found, Search, SearchSettings
    from uavrt.planning.shares import shared_out
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
        headwind,
        reachable,
    )
    from uavrt.planning.whole_flight import (
        LEAST_PULSES,
        WholeFlightSum,
        whole_flight_enr_db,
    )

__all__ = [
    "DEFAULT_PLANNER",
    "LEAST_PULSES",
    "PLANNERS",
    "Absence",
    "Action",
    "Battery",
    "Beliefs",
    "Beside",
    "Candidate",
    "Circle",
    "Coverage",
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
    "LinkBudget",
    "ListeningWay",
    "LongestAxisStop",
    "MiRate",
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
    "Separation",
    "Shannon",
    "Situation",
    "Start",
    "StopRule",
    "Strip",
    "TagBelief",
    "Vehicle",
    "VehicleState",
    "WholeFlightSum",
    "Wind",
    "absence",
    "at_100_m",
    "coverage_of",
    "flown",
    "headwind",
    "listening_way",
    "planner_named",
    "reachable",
    "shared_out",
    "survey_lines",
    "whole_flight_enr_db",
]
__getattr__ = lazily(
    __name__,
    {
        "LEAST_PULSES": "whole_flight",
        "WholeFlightSum": "whole_flight",
        "whole_flight_enr_db": "whole_flight",
        "listening_way": "coverage",
        "coverage_of": "coverage",
        "absence": "coverage",
        "ListeningWay": "coverage",
        "Coverage": "coverage",
        "Absence": "coverage",
        "Action": "actions",
        "Battery": "energy",
        "Beliefs": "beliefs",
        "Candidate": "situation",
        "Circle": "area",
        "DEFAULT_PLANNER": "planners",
        "Decision": "situation",
        "DeterminantStop": "stopping",
        "EnergyModel": "energy",
        "FixedWing": "vehicle",
        "FlyTo": "actions",
        "Found": "search",
        "GroundReflection": "propagation",
        "Hold": "actions",
        "HonestStop": "stopping",
        "KeepAway": "keep_away",
        "LinkBudget": "link_budget",
        "LongestAxisStop": "stopping",
        "MiRate": "planners",
        "ModelCheck": "beliefs",
        "Multirotor": "vehicle",
        "PLANNERS": "planners",
        "Path": "vehicle",
        "Planner": "situation",
        "Polygon": "area",
        "Return": "actions",
        "Rotate": "actions",
        "Search": "search",
        "SearchArea": "area",
        "SearchSettings": "search",
        "Separation": "beside",
        "shared_out": "shares",
        "Start": "division",
        "Strip": "beside",
        "Beside": "beside",
        "Shannon": "planners",
        "Situation": "situation",
        "StopRule": "stopping",
        "TagBelief": "beliefs",
        "Vehicle": "vehicle",
        "VehicleState": "vehicle",
        "Wind": "vehicle",
        "at_100_m": "level",
        "flown": "vehicle",
        "headwind": "vehicle",
        "planner_named": "planners",
        "reachable": "vehicle",
        "survey_lines": "area",
    },
)
