"""The antenna's pose at each pulse: bounded memory, true interpolation, mounting."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.pose.attacher import PoseAttacher
    from uavrt.pose.mounting import Mounting
    from uavrt.pose.ring import MAX_EXTRAPOLATION_S, MAX_GAP_S, PoseRing

__all__ = [
    "MAX_EXTRAPOLATION_S",
    "MAX_GAP_S",
    "Mounting",
    "PoseAttacher",
    "PoseRing",
]
__getattr__ = lazily(
    __name__,
    {
        "MAX_EXTRAPOLATION_S": "ring",
        "MAX_GAP_S": "ring",
        "Mounting": "mounting",
        "PoseAttacher": "attacher",
        "PoseRing": "ring",
    },
)
