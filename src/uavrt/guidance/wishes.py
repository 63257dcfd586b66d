"""What the pilot wants the vehicle to do, and the command that does it."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class FlyThere:
    """Fly straight to a place and stay; also turns, where the autopilot takes the yaw."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float
    yaw_deg: float | None = None
    """None: the autopilot looks where it likes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnInPlace:
    """Turn by one command, where the autopilot has it."""

    turn_deg: float
    """Clockwise; negative: the other way. At most a whole turn."""
    rate_deg_s: float


@dataclass(frozen=True, slots=True)
class GoHome:
    """Return by the autopilot's own mode; it lands as it is set to. Ends the order."""


@dataclass(frozen=True, slots=True)
class TakeMode:
    """Change into our own mode on the ground, where a take-off is commanded in it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeOff:
    """Climb straight up from the ground; a pilot has armed."""

    height_m: float
    """Above home."""
    altitude_amsl_m: float


Wish = FlyThere | TurnInPlace | GoHome | TakeMode | TakeOff


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
