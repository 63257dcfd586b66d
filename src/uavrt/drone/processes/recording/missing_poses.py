"""Reconstruct poses of pulses that the connection can no longer provide.

The connection normally adds the pose. If the connection is killed or stopped, pulses waiting
there get none. The recorder has those pulses and the vehicle's recorded poses.
"""

from collections import OrderedDict
from collections.abc import Iterable

from uavrt.config.settings import AntennaSettings
from uavrt.core.errors import PoseUnavailable
from uavrt.core.messages import Pose, Pulse, PulsePose
from uavrt.core.units import ns_from_s
from uavrt.localization.pose.ring import MAX_EXTRAPOLATION_S, MAX_GAP_S, PoseRing

REACH_NS = ns_from_s(MAX_GAP_S + MAX_EXTRAPOLATION_S)
"""Longest time from a pulse to a recorded pose used for it [ns]."""
MOST_POSES = 200


class AwaitedPoses:
    """Pulses that wait for a pose, and a check for poses that will never arrive.

    A pose counts as lost once the pose of a later pulse has arrived, or after `patience_s`.
    """

    def __init__(self, patience_s: float) -> None:
        self._timeout_s = patience_s
        self._tags: dict[int, OrderedDict[int, tuple[Pulse, float]]] = {}

    def __len__(self) -> int:
        return sum(map(len, self._tags.values()))

    def add(self, pulse: Pulse, now_s: float) -> None:
        """Add a pulse; a pulse that is already waiting keeps its time."""
        waiting = self._tags.setdefault(pulse.tag_id, OrderedDict())
        waiting.setdefault(pulse.start_time_ns, (pulse, now_s + self._timeout_s))

    def pose_arrived(self, pulse: Pulse) -> list[Pulse]:
        """Remove a pulse with its pose; return the tag's earlier pulses, which get no pose."""
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
        """Remove and return the pulses that have waited too long."""
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
        """Remove and return all waiting pulses, at the end of a flight."""
        return self.overdue(float("inf"))


def pose_from_records(
    pulse: Pulse, poses: Iterable[Pose], antenna: AntennaSettings
) -> PulsePose:
    """Compute a pulse's antenna pose from recorded vehicle poses near it, if any."""
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
