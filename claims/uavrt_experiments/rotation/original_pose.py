"""Poses as the original's uavrt_connection attached them, defects and all.

Used only by this experiment, to reproduce the logs that the original wrote. The four defects:

1. Times go through text as seconds, a point and nanoseconds without leading zeros. 2. The
sample before a pulse is sought with the comparison the wrong way round in a rising list, which
finds the first sample ever, or the end of the list. 3. The fraction of the way between two
samples is the constant one half. 4. Positions and attitudes come every 500 ms.

Their joint effect is a pose half-way between the first one since the program's start and the
one before the pulse.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace

from uavrt.core.earth.attitude import slerp
from uavrt.core.messages import Pose, Pulse, PulsePose
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s

REPORT_DELAY_S = 5.0
"""Time from a pulse's end to the search for its pose: the original's detector reports the
thesis's tag up to 5.0 s after a group's first pulse."""


def original_poses(pulses: Sequence[Pulse], samples: Sequence[Pose]) -> list[PulsePose]:
    """Give pulses the poses that the original would have logged.

    `pulses`: the pulses, times right.
    `samples`: the pose every 500 ms since the program's start, in order of time.
    """
    found = []
    for pulse in pulses:
        known_ns = pulse.end_time_ns + ns_from_s(REPORT_DELAY_S)
        history = [pose for pose in samples if pose.time_ns <= known_ns]
        found.append(PulsePose(pulse=pulse, pose=_pose(pulse, history)))
    return found


def text_time_s(time_ns: int) -> float:
    """Time [s] after conversion through text without padding: .019 s becomes .19 s.

    >>> text_time_s(1_019_828_320)
    1.1982832
    """
    seconds, nanoseconds = divmod(time_ns, NANOSECONDS_PER_SECOND)
    return float(f"{seconds}.{nanoseconds}")


def wrong_upper_bound(times_s: Sequence[float], time_s: float) -> int:
    """C++'s upper_bound with "greater" in a list that rises.

    >>> wrong_upper_bound([1, 2, 3, 4], 3.5), wrong_upper_bound([1, 2, 3, 4], 1.5)
    (0, 4)
    """
    first, count = 0, len(times_s)
    while count > 0:
        step = count // 2
        if time_s > times_s[first + step]:
            count = step
        else:
            first += step + 1
            count -= step + 1
    return first


def _pose(pulse: Pulse, history: Sequence[Pose]) -> Pose | None:
    if not history:
        return None
    start_s, end_s = text_time_s(pulse.start_time_ns), text_time_s(pulse.end_time_ns)
    query_s = (start_s + end_s) / 2.0
    times_s = [text_time_s(pose.time_ns) for pose in history]
    place = wrong_upper_bound(times_s, query_s)
    after = bisect_right(sorted(times_s), query_s)
    last = len(history) - 1
    if place == 0:
        before, after = history[0], max(0, after - 1)
    else:
        before = history[last]
    later = history[min(after, last)]
    return replace(
        later,
        time_ns=(pulse.start_time_ns + pulse.end_time_ns) // 2,
        latitude_deg=(before.latitude_deg + later.latitude_deg) / 2.0,
        longitude_deg=(before.longitude_deg + later.longitude_deg) / 2.0,
        altitude_amsl_m=(before.altitude_amsl_m + later.altitude_amsl_m) / 2.0,
        quaternion_wxyz=slerp(before.quaternion_wxyz, later.quaternion_wxyz, 0.5),
    )
