"""Assign each pulse its pose, waiting a limited time for the poses before and after it."""

from collections import deque
from dataclasses import dataclass

from uavrt.core.errors import PoseUnavailable
from uavrt.core.messages import Pose, Pulse, PulsePose
from uavrt.core.units import ns_from_s
from uavrt.localization.pose.ring import PoseRing


@dataclass(frozen=True, slots=True)
class _Waiting:
    pulse: Pulse
    deadline_ns: int


class PoseAttacher:
    """Stores pulses until their pose is known; none is lost, and each tag's order is preserved.

    A pulse is returned with its interpolated pose as soon as attitude and position after its
    centre have arrived. After `wait_s` seconds it gets an extrapolated pose, marked as such, or
    None. `wait_s` is 0 for a system without autopilot.
    """

    def __init__(self, ring: PoseRing, *, wait_s: float) -> None:
        self._ring = ring
        self._wait_ns = ns_from_s(wait_s)
        self._queues: dict[int, deque[_Waiting]] = {}
        self.attached = 0
        """Number of pulses with an interpolated pose."""
        self.extrapolated = 0
        """Number of pulses with a pose marked as extrapolated."""
        self.without_pose = 0
        """Number of pulses returned without a pose."""

    def __len__(self) -> int:
        return sum(map(len, self._queues.values()))

    def add(self, pulse: Pulse, now_ns: int) -> None:
        """Add a pulse that has just arrived."""
        queue = self._queues.setdefault(pulse.tag_id, deque())
        queue.append(_Waiting(pulse, now_ns + self._wait_ns))

    def ready(self, now_ns: int) -> list[PulsePose]:
        """Return pulses whose pose is known or whose waiting time is over."""
        return self._released(now_ns)

    def flush(self) -> list[PulsePose]:
        """Return all waiting pulses at the end of a flight, with the poses known so far."""
        return self._released(None)

    def next_deadline_ns(self) -> int | None:
        """Time by which `ready` must be called next [ns]; None if no pulse is waiting."""
        return min((q[0].deadline_ns for q in self._queues.values() if q), default=None)

    def _released(self, now_ns: int | None) -> list[PulsePose]:
        released: list[PulsePose] = []
        for queue in self._queues.values():
            while queue:
                waiting = queue[0]
                overdue = now_ns is None or now_ns >= waiting.deadline_ns
                found, pose = self._pose(waiting.pulse, overdue)
                if not found:
                    break
                queue.popleft()
                released.append(PulsePose(pulse=waiting.pulse, pose=pose))
                self._count(pose)
        return released

    def _pose(self, pulse: Pulse, overdue: bool) -> tuple[bool, Pose | None]:
        """Return whether the pulse can be returned now, and its pose; None if the pose is
        unknown.
        """
        center_ns = (pulse.start_time_ns + pulse.end_time_ns) // 2
        try:
            return True, self._ring.antenna_pose(center_ns)
        except PoseUnavailable as error:
            if error.retry_later and not overdue:
                return False, None
        try:
            return True, self._ring.antenna_pose(center_ns, extrapolate=True)
        except PoseUnavailable:
            return True, None

    def _count(self, pose: Pose | None) -> None:
        if pose is None:
            self.without_pose += 1
        elif pose.extrapolated:
            self.extrapolated += 1
        else:
            self.attached += 1
