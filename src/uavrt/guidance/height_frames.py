"""Convert heights above home to altitudes above mean sea level.

PX4 reads every commanded height as such an altitude, whatever its frame.
"""

from uavrt.core.errors import PlanError
from uavrt.guidance.safety import SAFETY


def target_amsl_m(amsl_now_m: float, relative_now_m: float, wanted_m: float) -> float:
    """Convert a height above home to the altitude above sea level for a command [m].

    Barometer drift, and the autopilot's sea level error of up to tens of metres, change
    altitude and height in a message equally. Therefore they cancel in the difference.
    """
    return amsl_now_m - relative_now_m + wanted_m


def check_height(
    wanted_m: float,
    *,
    lowest_m: float = SAFETY.lowest_height_m,
    highest_m: float = 120.0,
    ground_above_home_m: float = 0.0,
) -> None:
    """Raise `PlanError` if a height is too low or too high above the ground."""
    above = wanted_m - ground_above_home_m
    if above != above or above < lowest_m:
        raise PlanError(
            f"{wanted_m:.0f} m above home is {above:.0f} m above ground; the least "
            f"permitted is {lowest_m:.0f} m",
            remedy="Choose a greater height",
        )
    if above > highest_m:
        raise PlanError(
            f"{wanted_m:.0f} m above home is {above:.0f} m above ground; the most "
            f"permitted is {highest_m:.0f} m",
            remedy="Choose a smaller height",
        )
