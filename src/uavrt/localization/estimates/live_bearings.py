"""Estimate bearings of turns in progress, from pulses and poses as they arrive.

From the third pulse of a turn on, each new pulse gives a new estimate of the bearing; its
interval is wide while little of the turn is complete. The ground station does the same with the
data that it receives. On the drone, this is the `estimator` process, if enabled.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.on_ground import GroundStates
from uavrt.core.messages import LiveBearing, Pose, PulsePose, Tag
from uavrt.localization.antenna import AntennaPattern, pattern_named
from uavrt.localization.bearing.turns import Turn
from uavrt.localization.estimates.estimate_cache import Cache
from uavrt.localization.estimates.flight_estimates import (
    EstimationOptions,
    TagBearing,
    bearings_of,
)
from uavrt.localization.estimates.heard import Heard
from uavrt.localization.results import Bearing
from uavrt.localization.tuning import ACCEPTANCE, FLIGHT


class LiveBearings:
    """Converts poses and pulses, as they arrive, to the bearings that have changed."""

    def __init__(
        self, antenna: AntennaPattern | str = "RA-23K", tags: Sequence[Tag] = ()
    ) -> None:
        self._options = EstimationOptions(antenna=pattern_named(antenna))
        self.begin(tags)

    def begin(self, tags: Sequence[Tag] = ()) -> None:
        """Begin a new flight."""
        self._tags = tuple(tags)
        self._first_ns: int | None = None
        self._poses: list[Pose] = []
        self._states = GroundStates()
        self._pulses: list[PulsePose] = []
        self._cache = Cache()
        self._given: dict[tuple[int, int], Bearing] = {}

    def add_poses(self, poses: Iterable[Pose]) -> None:
        """Add poses of the vehicle, in order of time."""
        for pose in poses:
            if self._first_ns is None:
                self._first_ns = pose.time_ns
            # Thinned as by `Heard`, so that drone and ground station find the same turns.
            slot = (pose.time_ns - self._first_ns) // FLIGHT.pose_step_ns
            if not self._poses or slot > (
                (self._poses[-1].time_ns - self._first_ns) // FLIGHT.pose_step_ns
            ):
                self._poses.append(pose)
        if (
            self._poses
            and self._poses[0].time_ns < self._poses[-1].time_ns - 2 * FLIGHT.live_turn_ns
        ):
            after_ns = self._poses[-1].time_ns - FLIGHT.live_turn_ns
            self._poses = [one for one in self._poses if one.time_ns >= after_ns]
            self._pulses = [one for one in self._pulses if one.pulse.start_time_ns >= after_ns]

    def add_state(self, time_ns: int, armed: float | None, landed: float | None) -> None:
        """Add the autopilot's arming and landing state; 0 means no and None unknown."""
        self._states.add(time_ns, armed, landed)

    def add_pulse(self, one: PulsePose) -> None:
        """Add a pulse; a pulse without a pose is ignored."""
        if one.pose is not None:
            self._pulses.append(one)

    def changed(self) -> list[LiveBearing]:
        """Return the bearings that changed since the last call; computing each takes some
        milliseconds.

        A bearing changes with new or missed pulses in its turn. All bearings change when a
        finished turn corrects the antenna's pattern.
        """
        if not self._pulses:
            return []
        heard = Heard.of_records(
            self._pulses, self._poses, self._states.spans(), tags=self._tags, goes_on=True
        )
        self._cache.begin()
        found = []
        for one in bearings_of(heard, self._options, cache=self._cache):
            assert one.turn is not None
            key = (one.tag_id, one.turn.start_time_ns)
            if self._given.get(key) is not one.bearing:
                self._given[key] = one.bearing
                found.append(_live(one, one.turn))
        return found


def _live(one: TagBearing, turn: Turn) -> LiveBearing:
    found = one.bearing
    assert found.sigma_deg is not None
    assert found.interval90_deg is not None
    return LiveBearing(
        tag_id=one.tag_id,
        start_time_ns=turn.start_time_ns,
        end_time_ns=turn.end_time_ns,
        turned_deg=turn.turned_deg,
        latitude_deg=one.latitude_deg,
        longitude_deg=one.longitude_deg,
        bearing_deg=found.bearing_deg,
        sigma_deg=found.sigma_deg,
        interval90_deg=found.interval90_deg,
        level_db=found.level_db,
        pulses=one.heard,
        accepted=found.accepted,
        ambiguous=found.ambiguous,
        multipath_suspected=found.multipath_suspected,
    )


def bearing_from_drone(one: LiveBearing) -> TagBearing:
    """Convert a bearing message from the drone; its posterior is assumed to be a von Mises
    distribution.
    """
    return TagBearing(
        tag_id=one.tag_id,
        bearing=Bearing(
            bearing_deg=one.bearing_deg,
            method="pattern_ml",
            pulses=one.pulses,
            sigma_deg=one.sigma_deg,
            interval90_deg=one.interval90_deg,
            # The message contains only whether there is another lobe.
            second_lobe_probability=1.0 if one.ambiguous else 0.0,
            evidence=ACCEPTANCE.evidence_nats if one.accepted else 0.0,
            multipath_suspected=one.multipath_suspected,
            level_db=one.level_db,
            # The message has no error of the level; it is small compared with shadowing.
            level_sigma_db=None if one.level_db is None else 0.0,
            posterior=_von_mises(one.bearing_deg, one.sigma_deg),
        ),
        latitude_deg=one.latitude_deg,
        longitude_deg=one.longitude_deg,
        altitude_amsl_m=float("nan"),
        start_time_ns=one.start_time_ns,
        middle_time_ns=(one.start_time_ns + one.end_time_ns) // 2,
        end_time_ns=one.end_time_ns,
        heard=one.pulses,
        turn=Turn(
            start_time_ns=one.start_time_ns,
            end_time_ns=one.end_time_ns,
            turned_deg=one.turned_deg,
            stops=0,
            widest_gap_deg=max(0.0, 360.0 - abs(one.turned_deg)),
            latitude_deg=one.latitude_deg,
            longitude_deg=one.longitude_deg,
        ),
        from_drone=True,
    )


def _von_mises(bearing_deg: float, sigma_deg: float) -> NDArray[np.float64]:
    off = np.radians(np.arange(360.0) - bearing_deg)
    density = np.exp((np.cos(off) - 1.0) / np.radians(max(sigma_deg, 0.5)) ** 2)
    return np.asarray(density / density.sum())
