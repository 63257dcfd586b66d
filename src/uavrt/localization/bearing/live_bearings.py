"""Bearings of turns in progress, from pulses and poses as they arrive.

The same estimator as afterwards, asked again when a turn has a new pulse: from the third pulse
on, with a wide interval while little of the turn is done. The ground station does the same with
what reaches it; this is the stage that the drone runs when its table has the `estimator`.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence

import numpy as np

from uavrt.errors import UsageError
from uavrt.localization.antenna import AntennaPattern, pattern_named
from uavrt.localization.flight_estimates import (
    EDGE_NS,
    POSE_STEP_NS,
    HeardInTurn,
    PoseColumns,
    PulseColumns,
    Rhythm,
    antenna_as_shown,
    bearing_of,
    heard_in,
    turns_in,
)
from uavrt.messages import LiveBearing, Pose, PulsePose, Tag
from uavrt.on_ground import ToldStates

_KEPT_NS = 900_000_000_000
"""A turn is over after a quarter of an hour at most; older poses and pulses are let go."""


class LiveBearings:
    """Takes poses and pulses, gives the bearings that have changed.

    Parameters
    ----------
    antenna : AntennaPattern or str
        The pattern, or its name; corrected by what whole turns show of it.
    tags : sequence of Tag
        Listed tags: their pulses that must have come and were not heard count too.

    Raises
    ------
    UsageError
        There is no such antenna.
    """

    def __init__(
        self, antenna: AntennaPattern | str = "RA-23K", tags: Sequence[Tag] = ()
    ) -> None:
        self._pattern = pattern_named(antenna)
        self.begin(tags)

    def begin(self, tags: Sequence[Tag] = ()) -> None:
        """Begin a new flight."""
        self._rhythms = {tag.tag_id: Rhythm.of(tag) for tag in tags}
        self._first_ns: int | None = None
        self._poses: list[Pose] = []
        self._told = ToldStates()
        self._pulses: dict[int, list[PulsePose]] = defaultdict(list)
        self._columns: dict[int, PulseColumns] = {}
        self._taught: tuple[tuple[int, int], ...] = ()
        self._shown = self._pattern
        self._lessons = 0
        self._given: dict[tuple[int, int], tuple[int, int, int]] = {}

    def add_poses(self, poses: Iterable[Pose]) -> None:
        """Add poses of the vehicle, in order of time."""
        for pose in poses:
            if self._first_ns is None:
                self._first_ns = pose.time_ns
            # As `turns_in` thins them, so that the drone finds the turns that others find.
            slot = (pose.time_ns - self._first_ns) // POSE_STEP_NS
            if not self._poses or slot > (
                (self._poses[-1].time_ns - self._first_ns) // POSE_STEP_NS
            ):
                self._poses.append(pose)
        if self._poses and self._poses[0].time_ns < self._poses[-1].time_ns - 2 * _KEPT_NS:
            after_ns = self._poses[-1].time_ns - _KEPT_NS
            self._poses = [one for one in self._poses if one.time_ns >= after_ns]
            for tag_id, pulses in self._pulses.items():
                self._pulses[tag_id] = [
                    one for one in pulses if one.pulse.start_time_ns >= after_ns
                ]
            self._columns.clear()

    def add_state(self, time_ns: int, armed: float | None, landed: float | None) -> None:
        """Add what the autopilot says of arming and landing; 0 is no, None unknown.

        What is turned on the ground is no turn, wherever the barometer has drifted to.
        """
        self._told.add(time_ns, armed, landed)

    def add_pulse(self, one: PulsePose) -> None:
        """Add a pulse; without a pose or a power it tells no direction."""
        if one.pose is not None and np.isfinite(one.pulse.snr_db):
            self._pulses[one.pulse.tag_id].append(one)
            self._columns.pop(one.pulse.tag_id, None)

    def changed(self) -> list[LiveBearing]:
        """Estimate what is new since the last call; a few milliseconds for each.

        New are pulses in a turn, also those that were missed there; and what a turn that is
        over shows of the antenna, by which all bearings are corrected.
        """
        heard = self._heard()
        self._learn(heard)
        found = []
        for one in heard:
            key = (one.tag_id, one.turn.start_time_ns)
            state = (len(one.snr_db), len(one.missed_yaw_deg), self._lessons)
            if self._given.get(key) == state:
                continue
            self._given[key] = state
            bearing = self._bearing(one)
            if bearing is not None:
                found.append(bearing)
        return found

    def _heard(self) -> list[HeardInTurn]:
        """What was heard of each tag in each turn, in order of time and tag."""
        if not self._pulses:
            return []
        poses = PoseColumns.of(self._poses, self._told.spans())
        return [
            heard
            for turn in turns_in(poses)
            for tag_id in sorted(self._pulses)
            if (
                heard := heard_in(
                    tag_id, turn, self._pulses_of(tag_id), poses, self._rhythms.get(tag_id)
                )
            )
        ]

    def _pulses_of(self, tag_id: int) -> PulseColumns:
        if tag_id not in self._columns:
            self._pulses[tag_id].sort(key=lambda one: one.pulse.start_time_ns)
            self._columns[tag_id] = PulseColumns.of(self._pulses[tag_id])
        return self._columns[tag_id]

    def _learn(self, heard: Sequence[HeardInTurn]) -> None:
        """Correct the pattern when one more turn is over; not with each of its pulses."""
        over_ns = self._poses[-1].time_ns - 2 * EDGE_NS if self._poses else 0
        over = [one for one in heard if one.turn.end_time_ns < over_ns]
        taught = tuple((one.tag_id, one.turn.start_time_ns) for one in over)
        if taught != self._taught:
            self._taught = taught
            shown = antenna_as_shown(over, self._pattern)
            self._lessons += shown is not self._shown
            self._shown = shown

    def _bearing(self, heard: HeardInTurn) -> LiveBearing | None:
        try:
            found = bearing_of(heard, antenna=self._shown)
        except UsageError:
            return None
        assert found.sigma_deg is not None
        assert found.interval90_deg is not None
        return LiveBearing(
            tag_id=heard.tag_id,
            start_time_ns=heard.turn.start_time_ns,
            end_time_ns=heard.turn.end_time_ns,
            turned_deg=heard.turn.turned_deg,
            latitude_deg=heard.latitude_deg,
            longitude_deg=heard.longitude_deg,
            bearing_deg=found.bearing_deg,
            sigma_deg=found.sigma_deg,
            interval90_deg=found.interval90_deg,
            level_db=found.level_db,
            pulses=len(heard.snr_db),
            accepted=found.accepted,
            ambiguous=found.ambiguous,
            multipath_suspected=found.multipath_suspected,
        )
