"""Bearings of turns that still go on, from pulses and poses as they come.

The same estimator as afterwards, asked again when a turn has a new pulse: from the third pulse
on, with a wide interval while little of the turn is done. The ground station does the same with
what reaches it; this is the stage that the drone runs when its table has the `estimator`.
"""

from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from uavrt.errors import UsageError
from uavrt.localization.antenna import AntennaPattern, pattern_named
from uavrt.localization.attitude import Headings
from uavrt.localization.bearing import estimate_bearing
from uavrt.localization.flight_estimates import (
    EDGE_NS,
    LEAST_PULSES,
    LEAST_TURN_DEG,
    OWN_HEADING_SIGMA_DEG,
)
from uavrt.localization.turns import Turn, find_turns
from uavrt.messages import LiveBearing, Pose, PulsePose

_POSE_STEP_NS = 180_000_000
"""Poses closer than this tell nothing new of a turn."""
_KEPT_NS = 900_000_000_000
"""A turn is over after a quarter of an hour at most; older poses and pulses are let go."""


class LiveBearings:
    """Takes poses and pulses, gives the bearings that have changed.

    Parameters
    ----------
    antenna : AntennaPattern or str
        The pattern, or its name.

    Raises
    ------
    UsageError
        There is no such antenna.
    """

    def __init__(self, antenna: AntennaPattern | str = "RA-23K") -> None:
        self._pattern = pattern_named(antenna)
        self.forget()

    def forget(self) -> None:
        """Begin a new flight."""
        self._poses: list[Pose] = []
        self._pulses: dict[int, list[PulsePose]] = defaultdict(list)
        self._given: dict[tuple[int, int], int] = {}

    def add_poses(self, poses: Iterable[Pose]) -> None:
        """Take poses of the vehicle, in order of time."""
        for pose in poses:
            if not self._poses or pose.time_ns - self._poses[-1].time_ns >= _POSE_STEP_NS:
                self._poses.append(pose)
        if self._poses and self._poses[0].time_ns < self._poses[-1].time_ns - 2 * _KEPT_NS:
            after_ns = self._poses[-1].time_ns - _KEPT_NS
            self._poses = [one for one in self._poses if one.time_ns >= after_ns]
            for tag_id, pulses in self._pulses.items():
                self._pulses[tag_id] = [
                    one for one in pulses if one.pulse.start_time_ns >= after_ns
                ]

    def add_pulse(self, one: PulsePose) -> None:
        """Take a pulse; without a pose or a power it tells no direction."""
        if one.pose is not None and np.isfinite(one.pulse.snr_db):
            self._pulses[one.pulse.tag_id].append(one)

    def changed(self) -> list[LiveBearing]:
        """Estimate what has new pulses since the last call; a few milliseconds for each."""
        found = []
        for turn in self._turns():
            for tag_id, pulses in self._pulses.items():
                inside = [one for one in pulses if _during(one, turn)]
                key = (tag_id, turn.start_time_ns)
                if len(inside) < LEAST_PULSES or self._given.get(key) == len(inside):
                    continue
                self._given[key] = len(inside)
                bearing = self._bearing(tag_id, turn, inside)
                if bearing is not None:
                    found.append(bearing)
        return found

    def _turns(self) -> list[Turn]:
        if not any(len(pulses) >= LEAST_PULSES for pulses in self._pulses.values()):
            return []
        attitudes = [pose.quaternion_wxyz for pose in self._poses]
        if len(attitudes) < 4:
            return []
        return find_turns(
            np.array([pose.time_ns for pose in self._poses], np.int64),
            Headings.from_quaternions(attitudes).yaw_deg,
            np.array([pose.latitude_deg for pose in self._poses]),
            np.array([pose.longitude_deg for pose in self._poses]),
            height_m=np.array([pose.altitude_relative_m for pose in self._poses]),
            least_turn_deg=LEAST_TURN_DEG,
        )

    def _bearing(self, tag_id: int, turn: Turn, inside: list[PulsePose]) -> LiveBearing | None:
        try:
            found = estimate_bearing(
                None,
                [one.pulse.snr_db for one in inside],
                quaternion_wxyz=[one.pose.quaternion_wxyz for one in inside if one.pose],
                antenna=self._pattern,
                heading_sigma_deg=OWN_HEADING_SIGMA_DEG,
            )
        except UsageError:
            return None
        assert found.sigma_deg is not None
        assert found.interval90_deg is not None
        return LiveBearing(
            tag_id=tag_id,
            start_time_ns=turn.start_time_ns,
            end_time_ns=turn.end_time_ns,
            turned_deg=turn.turned_deg,
            latitude_deg=turn.latitude_deg,
            longitude_deg=turn.longitude_deg,
            bearing_deg=found.bearing_deg,
            sigma_deg=found.sigma_deg,
            interval90_deg=found.interval90_deg,
            level_db=found.level_db,
            pulses=len(inside),
            accepted=found.accepted,
            ambiguous=found.ambiguous,
            multipath_suspected=found.multipath_suspected,
        )


def _during(one: PulsePose, turn: Turn) -> bool:
    start_ns = one.pulse.start_time_ns
    return turn.start_time_ns - EDGE_NS <= start_ns <= turn.end_time_ns + EDGE_NS
