"""Check the settings in ``[guidance]`` that depend on each other, such as the height limits,
and the name of the planner.
"""

import json
from collections.abc import Iterator
from typing import Any

from uavrt.config.settings import GuidanceSettings
from uavrt.core.plugins import Registry

PLANNER_GROUP = "uavrt.planners"
PLANNER_NAMES = ("mi_rate",)
"""Names of the planners in `uavrt.planning`; installed packages may add others."""


def guidance_faults(document: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the key and an error text for each inconsistent guidance setting."""
    table = document.get("guidance")
    if not isinstance(table, dict):
        return
    yield from _planner_fault(table)
    lowest, highest = _number(table, "lowest_m"), _number(table, "highest_m")
    if lowest is not None and highest is not None and lowest >= highest:
        yield (
            "lowest_m" if "lowest_m" in table else "highest_m",
            f"[guidance] lowest_m is {lowest:g} and highest_m {highest:g}, but the least "
            "height must be below the greatest",
        )
    wind, air, speed = (_number(table, f"{name}_m_s") for name in ("wind", "airspeed", "speed"))
    if wind is not None and air is not None and speed is not None and wind >= max(air, speed):
        yield (
            "wind_m_s" if "wind_m_s" in table else "airspeed_m_s",
            f"[guidance] wind_m_s is {wind:g} and airspeed_m_s {air:g}, but then "
            "the drone cannot return: wind_m_s must be below the airspeed",
        )


def _planner_fault(table: dict[str, Any]) -> Iterator[tuple[str, str]]:
    name = table.get("planner", PLANNER_NAMES[0])
    known = Registry[object](PLANNER_GROUP, dict.fromkeys(PLANNER_NAMES))
    if not isinstance(name, str) or name in known:
        return
    given = json.dumps(name, ensure_ascii=False)[:60]
    names = " or ".join(repr(one) for one in known)
    yield "planner", f"[guidance] planner is {given}, but must be {names}"


def _number(table: dict[str, Any], key: str) -> float | None:
    value: Any = table.get(key, getattr(GuidanceSettings(), key))
    return float(value) if type(value) in (int, float) else None
