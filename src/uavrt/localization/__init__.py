"""From pulses to bearings, from bearings and powers to positions; no I/O, no clocks."""

from uavrt.localization.antenna import PATTERNS, AntennaPattern, monopole_gain_db
from uavrt.localization.bearing import estimate_bearing
from uavrt.localization.records import Bearing, BearingMethod

__all__ = [
    "PATTERNS",
    "AntennaPattern",
    "Bearing",
    "BearingMethod",
    "estimate_bearing",
    "monopole_gain_db",
]
