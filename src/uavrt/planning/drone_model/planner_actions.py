"""Actions that a planner can choose for the drone."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class FlyTo:
    """Action: fly straight to a position in the tracker's plane."""

    east_m: float
    north_m: float

    def __str__(self) -> str:
        return f"fly to {self.east_m:.0f} m east, {self.north_m:.0f} m north"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rotate:
    """Action: turn in place, clockwise, so that the antenna points in all directions."""

    duration_s: float = 20.0
    turn_deg: float = 360.0

    def __str__(self) -> str:
        return f"turn by {self.turn_deg:.0f}° in {self.duration_s:.0f} s"


@dataclass(frozen=True, slots=True, kw_only=True)
class Hold:
    """Action: stay in place; a fixed wing circles."""

    duration_s: float = 5.0

    def __str__(self) -> str:
        return f"hold for {self.duration_s:.0f} s"


@dataclass(frozen=True, slots=True, kw_only=True)
class Return:
    """Action: fly home and land there."""

    def __str__(self) -> str:
        return "return"


Action = FlyTo | Rotate | Hold | Return
