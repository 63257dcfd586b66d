"""The processes of the drone side: thin loops that connect stages to sockets."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.processes.missing_poses import REACH_NS, made_up
    from uavrt.processes.own_pose import pose_address
    from uavrt.processes.search_costs import search_cost

__all__ = [
    "REACH_NS",
    "made_up",
    "pose_address",
    "search_cost",
]
__getattr__ = lazily(
    __name__,
    {
        "REACH_NS": "missing_poses",
        "pose_address": "own_pose",
        "made_up": "missing_poses",
        "search_cost": "search_costs",
    },
)
