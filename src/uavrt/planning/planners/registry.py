"""Table of planners by name, including those that other installed packages add.

An entry of the entry point group ``uavrt.planners`` is called without arguments and returns a
`Planner`.
"""

from collections.abc import Callable

from uavrt.core.errors import NotFound
from uavrt.core.plugins import Registry
from uavrt.planning.planners.mi_rate import MiRate
from uavrt.planning.situation import Planner

DEFAULT_PLANNER = "mi_rate"

_OWN: dict[str, Callable[[], Planner]] = {DEFAULT_PLANNER: MiRate}
PLANNERS: Registry[Callable[[], Planner]] = Registry("uavrt.planners", _OWN)


def planner_named(name: str) -> Planner:
    """Create the planner with the given name. Raises `NotFound` for an unknown name."""
    if name not in PLANNERS:
        raise NotFound(
            f"there is no planner {name!r}", remedy=f"Choose from {', '.join(PLANNERS)}"
        )
    return PLANNERS[name]()
