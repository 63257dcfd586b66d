"""Where the antenna was when a pulse came: bounded memory, true interpolation, mounting."""

from uavrt.pose.attacher import PoseAttacher
from uavrt.pose.mounting import Mounting
from uavrt.pose.ring import MAX_EXTRAPOLATION_S, MAX_GAP_S, PoseRing

__all__ = ["MAX_EXTRAPOLATION_S", "MAX_GAP_S", "Mounting", "PoseAttacher", "PoseRing"]
