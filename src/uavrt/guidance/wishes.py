"""The command to the autopilot that does what a pilot wishes."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleCommand:
    """COMMAND_INT to the autopilot."""

    name: Literal[
        "DO_REPOSITION", "CONDITION_YAW", "NAV_RETURN_TO_LAUNCH", "DO_SET_MODE", "NAV_TAKEOFF"
    ]
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    param5: float = 0.0
    param6: float = 0.0
    x: int = 0
    y: int = 0
    z_m: float = 0.0
