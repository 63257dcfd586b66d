"""Where the antenna was when a pulse came: bounded memory, true interpolation, mounting."""

from uavrt.pose.attacher import PoseAttacher
from uavrt.pose.mounting import Mounting
from uavrt.pose.ring import MAX_EXTRAPOLATION_S, MAX_GAP_S, PoseRing
from uavrt.pose.rotation import (
    Quaternion,
    from_euler_deg,
    normalised,
    product,
    rotated,
    slerp,
    yaw_deg,
)

__all__ = [
    "MAX_EXTRAPOLATION_S",
    "MAX_GAP_S",
    "Mounting",
    "PoseAttacher",
    "PoseRing",
    "Quaternion",
    "from_euler_deg",
    "normalised",
    "product",
    "rotated",
    "slerp",
    "yaw_deg",
]
