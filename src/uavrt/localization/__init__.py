"""From pulses to bearings, from bearings and powers to positions; no I/O, no clocks."""

from uavrt.localization.antenna import PATTERNS, AntennaPattern, monopole_gain_db
from uavrt.localization.bearing import estimate_bearing
from uavrt.localization.level_evidence import Propagation
from uavrt.localization.position import Stations, estimate_position
from uavrt.localization.power_evidence import PowerTrack
from uavrt.localization.records import (
    Bearing,
    BearingMethod,
    Ellipse,
    Position,
    PositionGrid,
    PositionMethod,
)
from uavrt.localization.tangent_plane import TangentPlane
from uavrt.localization.turns import Turn, find_turns

__all__ = [
    "PATTERNS",
    "AntennaPattern",
    "Bearing",
    "BearingMethod",
    "Ellipse",
    "Position",
    "PositionGrid",
    "PositionMethod",
    "PowerTrack",
    "Propagation",
    "Stations",
    "TangentPlane",
    "Turn",
    "estimate_bearing",
    "estimate_position",
    "find_turns",
    "monopole_gain_db",
]
