"""The processes of the drone side: thin loops that connect stages to sockets."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.processes.missing_poses import REACH_NS, made_up
    from uavrt.processes.own_pose import pose_address

__all__ = [
    "REACH_NS",
    "made_up",
    "pose_address",
]
__getattr__ = lazily(
    __name__,
    {
        "REACH_NS": "missing_poses",
        "pose_address": "own_pose",
        "made_up": "missing_poses",
    },
)
