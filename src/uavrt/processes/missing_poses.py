"""Pulses whose pose has not come and may never come: the recorder fills them in.

The connection gives each pulse its pose. When it is killed or stopped, the pulses that wait
there are gone with it; the recorder has them all the same, and its recorded poses of the
vehicle. Belongs to the recorder process.
"""

from collections import OrderedDict
from collections.abc import Iterable

from uavrt.config.settings import AntennaSettings
from uavrt.errors import PoseUnavailable
from uavrt.messages import Pose, Pulse, PulsePose
from uavrt.pose.ring import MAX_EXTRAPOLATION_S, MAX_GAP_S, PoseRing
from uavrt.units import ns_from_s

REACH_NS = ns_from_s(MAX_GAP_S + MAX_EXTRAPOLATION_S)
"""Poses farther from a pulse say nothing of it."""
MOST_POSES = 200


class AwaitedPoses:
    """Pulses still waiting for their pose, and those that wait in vain.

    The poses of a tag's pulses come in the order of the pulses. So a pulse waits in vain when
    the pose of a later one of its tag has come, or when it has waited too long.

    `patience_s`: longest time that a pose may take.
    """

    def __init__(self, patience_s: float) -> None:
        self._patience_s = patience_s
        self._tags: dict[int, OrderedDict[int, tuple[Pulse, float]]] = {}

    def __len__(self) -> int:
        return sum(map(len, self._tags.values()))

    def add(self, pulse: Pulse, now_s: float) -> None:
        """Add a pulse; one that waits already goes on waiting."""
        waiting = self._tags.setdefault(pulse.tag_id, OrderedDict())
        waiting.setdefault(pulse.start_time_ns, (pulse, now_s + self._patience_s))

    def came(self, pulse: Pulse) -> list[Pulse]:
        """Note a pulse's pose; get those before it, which wait in vain."""
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
        """Get all of them, at the end of a flight."""
        return self.overdue(float("inf"))


def made_up(pulse: Pulse, poses: Iterable[Pose], antenna: AntennaSettings) -> PulsePose:
    """Give a pulse the antenna's pose by recorded poses of the vehicle.

    `poses`: of the vehicle, around the pulse's centre, in the order of time.
    `antenna`: how the antenna sits on the vehicle.
    Returns: without a pose when those recorded are too far from the pulse (`PoseRing`).
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
