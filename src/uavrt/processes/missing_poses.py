"""Fills in poses of pulses that the connection can no longer provide.

The connection gives each pulse its pose. If it is killed or stopped, the pulses waiting there
lose theirs; the recorder has those pulses, and the vehicle's recorded poses.
"""

from collections import OrderedDict
from collections.abc import Iterable

from uavrt.config.settings import AntennaSettings
from uavrt.errors import PoseUnavailable
from uavrt.messages import Pose, Pulse, PulsePose
from uavrt.pose.ring import MAX_EXTRAPOLATION_S, MAX_GAP_S, PoseRing
from uavrt.units import ns_from_s

REACH_NS = ns_from_s(MAX_GAP_S + MAX_EXTRAPOLATION_S)
"""Largest time between a pulse and a pose that is used for it [ns]."""
MOST_POSES = 200


class AwaitedPoses:
    """Pulses still waiting for their pose, and those whose pose will not come.

    The poses of a tag's pulses come in the order of the pulses. So a pose is lost when that of
    a later pulse has come, or after `patience_s`.
    """

    def __init__(self, patience_s: float) -> None:
        self._patience_s = patience_s
        self._tags: dict[int, OrderedDict[int, tuple[Pulse, float]]] = {}

    def __len__(self) -> int:
        return sum(map(len, self._tags.values()))

    def add(self, pulse: Pulse, now_s: float) -> None:
        """Add a pulse; one that is waiting already keeps its time."""
        waiting = self._tags.setdefault(pulse.tag_id, OrderedDict())
        waiting.setdefault(pulse.start_time_ns, (pulse, now_s + self._patience_s))

    def came(self, pulse: Pulse) -> list[Pulse]:
        """Record a pulse's pose; return the earlier pulses of its tag, whose poses are lost."""
        waiting = self._tags.get(pulse.tag_id)
        if waiting is None or pulse.start_time_ns not in waiting:
            return []
        vain: list[Pulse] = []
        while True:
            start_time_ns, (first, _) = waiting.popitem(last=False)
            if start_time_ns == pulse.start_time_ns:
                return vain
            vain.append(first)

    def overdue(self, now_s: float) -> list[Pulse]:
        """Get the pulses that have waited too long."""
        vain: list[Pulse] = []
        for waiting in self._tags.values():
            while waiting:
                start_time_ns, (pulse, deadline_s) = next(iter(waiting.items()))
                if deadline_s > now_s:
                    break
                del waiting[start_time_ns]
                vain.append(pulse)
        return vain

    def all(self) -> list[Pulse]:
        """Get all waiting pulses, at the end of a flight."""
        return self.overdue(float("inf"))


def made_up(pulse: Pulse, poses: Iterable[Pose], antenna: AntennaSettings) -> PulsePose:
    """Give a pulse the antenna's pose from recorded vehicle poses, if they are near enough.

    `poses`: around the pulse's centre, in the order of time. `antenna`: its mounting.
    """
    ring = PoseRing(antenna, capacity=MOST_POSES)
    for pose in poses:
        ring.add_pose(pose)
    center_ns = (pulse.start_time_ns + pulse.end_time_ns) // 2
    for extrapolate in (False, True):
        try:
            found = ring.antenna_pose(center_ns, extrapolate=extrapolate)
        except PoseUnavailable:
            continue
        return PulsePose(pulse=pulse, pose=found)
    return PulsePose(pulse=pulse, pose=None)
