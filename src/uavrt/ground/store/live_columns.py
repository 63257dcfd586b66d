"""Pulses and poses of the flight in progress, in memory as columns for the estimates."""

import math
from array import array
from collections.abc import Iterable

import numpy as np

from uavrt.core.earth.on_ground import GroundStates
from uavrt.core.messages import BurstInside, Pose, PulsePose
from uavrt.ground.store.stored_flights import PULSE_COLUMNS, Columns, pulse_cells

POSE_STEP_NS = 190_000_000
"""Shortest interval between kept poses [ns]: 36 000 poses in two hours."""
PULSE_WIDTH = len(PULSE_COLUMNS)
POSE_WIDTH = 8


class LiveColumns:
    """Pulses and poses of one flight in progress."""

    def __init__(self) -> None:
        self.keys: set[tuple[int, int]] = set()
        """Tag id and start time [ns] of each pulse, to recognise repeated ones."""
        self._pulses = array("d")
        self._poses = array("d")
        self._states = GroundStates()
        self._last_pose_ns = 0
        self._takeoff: tuple[float, float] = math.inf, math.nan
        """Time of the first pose [ns], and height above sea level of the take-off point [m]."""

    def resume(self, keys: Iterable[tuple[int, int]], states: GroundStates) -> None:
        """Continue with the pulses and vehicle states of a database."""
        self.keys.update(keys)
        self._states = states

    def load(self, columns: Columns) -> None:
        """Load the pulses and poses of a resumed flight."""
        self._pulses = array("d", columns.pulses.T.ravel().tolist())
        self._poses = array("d", columns.poses.T.ravel().tolist())
        first_ns = min(columns.poses[0].tolist(), default=math.inf)
        self._takeoff = first_ns, columns.takeoff_amsl_m

    def add_pulse(self, item: PulsePose) -> None:
        """Append a pulse to the columns."""
        self.keys.add(item.pulse.key)
        self._pulses.extend(pulse_cells(item))

    def doubt(self, burst: BurstInside) -> None:
        """Mark a burst as possibly sent by another tag, which the estimates then consider."""
        cells = np.frombuffer(self._pulses, np.float64).reshape(-1, PULSE_WIDTH)
        named = {name: cells[:, place] for place, name in enumerate(PULSE_COLUMNS)}
        same = named["start_time_ns"] == float(burst.start_time_ns)
        same &= named["tag_id"] == burst.tag_id
        named["also_possible_tag_id"][same] = burst.also_possible_tag_ids[0]

    def add_pose(self, pose: Pose) -> bool:
        """Add a pose; False if it is less than `POSE_STEP_NS` after the last one."""
        if 0 <= pose.time_ns - self._last_pose_ns < POSE_STEP_NS:
            return False
        self._last_pose_ns = pose.time_ns
        if pose.time_ns < self._takeoff[0]:
            self._takeoff = pose.time_ns, pose.altitude_amsl_m - pose.altitude_relative_m
        self._poses.extend(
            (
                pose.time_ns,
                pose.latitude_deg,
                pose.longitude_deg,
                pose.altitude_relative_m,
                *pose.quaternion_wxyz,
            )
        )
        return True

    def add_state(self, time_ns: int, armed: bool | None, landed: bool | None) -> bool:
        """Add whether the vehicle is armed and has landed; False if nothing changed."""
        return self._states.add(time_ns, armed, landed)

    def columns(self, *, goes_on: bool) -> Columns:
        """Copy all pulses and poses; `goes_on`: the flight is still in progress."""
        pulses = np.frombuffer(self._pulses, np.float64) if self._pulses else np.empty(0)
        poses = np.frombuffer(self._poses, np.float64) if self._poses else np.empty(0)
        return Columns(
            pulses=pulses.reshape(-1, PULSE_WIDTH).T.copy(),
            poses=poses.reshape(-1, POSE_WIDTH).T.copy(),
            on_ground_ns=self._states.spans(),
            takeoff_amsl_m=self._takeoff[1],
            goes_on=goes_on,
        )
