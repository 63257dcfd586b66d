"""Reconstruct the pose of pulses for which the connection process sent none.

Normally the connection process adds the pose. If it is killed, pulses that wait there lose
theirs. The recorder has both these pulses and the recorded poses of the vehicle.
"""

from collections import OrderedDict
from collections.abc import Iterable

from uavrt.config.settings import AntennaSettings
from uavrt.core.errors import PoseUnavailable
from uavrt.core.messages import Pose, Pulse, PulsePose
from uavrt.core.units import ns_from_s
from uavrt.localization.pose.ring import MAX_EXTRAPOLATION_S, MAX_GAP_S, PoseRing

REACH_NS = ns_from_s(MAX_GAP_S + MAX_EXTRAPOLATION_S)
"""Largest time difference between a pulse and a recorded pose used for it [ns]."""
MOST_POSES = 200


class AwaitedPoses:
    """Pulses whose pose has not arrived yet.

    A pose counts as lost once a later pulse of the same tag has its pose, or after
    `patience_s`.
    """

    def __init__(self, patience_s: float) -> None:
        self._timeout_s = patience_s
        self._tags: dict[int, OrderedDict[int, tuple[Pulse, float]]] = {}

    def __len__(self) -> int:
        return sum(map(len, self._tags.values()))

    def add(self, pulse: Pulse, now_s: float) -> None:
        """Add a pulse; adding it again does not extend its deadline."""
        waiting = self._tags.setdefault(pulse.tag_id, OrderedDict())
        waiting.setdefault(pulse.start_time_ns, (pulse, now_s + self._timeout_s))

    def pose_arrived(self, pulse: Pulse) -> list[Pulse]:
        """Remove a pulse whose pose has arrived; return the tag's earlier pulses, removed too.

        Their poses count as lost.
        """
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
        """Remove and return the pulses whose deadline has passed."""
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
    """Compute the antenna's pose at a pulse from recorded poses of the vehicle.

    Without a near enough pose, the result has none.
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
