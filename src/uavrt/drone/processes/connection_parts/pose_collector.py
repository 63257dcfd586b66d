"""Collect the vehicle's poses, record them, and add the antenna's pose to each pulse.

Attitude and position come from the autopilot, or from the station itself (`own_pose`).
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace

from uavrt.config.settings import PoseSettings, Settings
from uavrt.core.clock import Clock
from uavrt.core.errors import PoseUnavailable, UavrtError
from uavrt.core.log import get_logger
from uavrt.core.messages import (
    AttitudeSample,
    Pose,
    Poses,
    PositionSample,
    Pulse,
    PulsePose,
    StatusText,
)
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.drone.ipc.topics import TOPICS
from uavrt.drone.processes.connection_parts.own_pose import SILENCE_NS, WAIT_S, OwnPose
from uavrt.localization.pose.attacher import PoseAttacher
from uavrt.localization.pose.ring import PoseRing

log = get_logger()

POSE_PERIOD_NS = 50_000_000
"""Time between two recorded poses [ns]. Interpolation over 50 ms has an error below 0.1° when a
turn of 60°/s starts."""
OWN_POSE_PERIOD_NS = 250_000_000
"""Time between two recorded poses of a station without autopilot [ns]; it turns more slowly
than a drone."""
REPORT_PERIOD_NS = NANOSECONDS_PER_SECOND
"""Time between two reports of the position of a station without autopilot [ns]."""
RECORD_NS = ns_from_s(TOPICS["poses"].every_s or 0.5)
"""Time for which poses are collected before they are sent to the recorder together [ns]."""
POSES_KEPT_NS = 200 * POSE_PERIOD_NS
"""Delay of pose recording above which older poses are skipped [ns]."""
SAME_CLOCK_NS = 1_000_000
"""Largest clock change at the start of a flight that keeps the poses received before [ns]. At
30°/s of turn it is an error of 0.03°."""

_POSE_KNOWN = StatusText(severity=6, text="Position and heading known")
_STALE_CLOCK = StatusText(
    severity=4, text="Autopilot's clock: no answer for 10 s, times are extrapolated"
)


def _missing_text(missing: str) -> StatusText:
    """Text for the operator on what is missing for this station's own position and heading."""
    return StatusText(severity=4, text=missing.capitalize()[:200])


class PoseCollector:
    """Collects attitudes and positions, and computes the antenna's pose at each pulse."""

    def __init__(
        self,
        settings: Settings,
        clock: Clock,
        *,
        record: Callable[[Poses], None],
        say: Callable[[StatusText], None],
    ) -> None:
        self._clock, self._record, self._say = clock, record, say
        self.shift_ns = 0
        """Clock of the flight minus the clock of this process [ns]."""
        self._clock_is_stale = False
        """True while the autopilot's clock is extrapolated; poses are then marked."""
        self._ring = PoseRing(settings.antenna)
        self._own: OwnPose | None = None
        self._period_ns = POSE_PERIOD_NS
        wait_s = settings.antenna.pose_wait_s if settings.mavlink.address else 0.0
        if settings.pose.source != "autopilot":
            self._own = OwnPose(
                settings.pose, clock.now_ns, attitude=self.attitude, position=self.position
            )
            self._period_ns = OWN_POSE_PERIOD_NS
            wait_s = max(settings.antenna.pose_wait_s, WAIT_S)
        self._attacher = PoseAttacher(self._ring, wait_s=wait_s)
        self._poses: list[Pose] = []
        self._next_pose_ns = 0
        self._next_report_ns = 0
        self._missing: str | None = None
        self._on_stale_clock = 0

    @property
    def is_own(self) -> bool:
        """True if the pose comes from settings or a GPS receiver and not from an autopilot."""
        return self._own is not None

    async def run(self) -> None:
        """Read the station's own pose, if it has one, until cancelled."""
        if self._own is not None:
            await self._own.run()

    def use(self, settings: PoseSettings) -> None:
        """Apply changed settings, such as a newly typed heading."""
        if self._own is not None:
            self._own.use(settings)

    def use_clock(self, offset_ns: int) -> None:
        """Set the clock of a new flight. `offset_ns` is UTC minus CLOCK_MONOTONIC [ns]."""
        before_ns, self.shift_ns = self.shift_ns, offset_ns - self._clock.offset_ns
        if abs(self.shift_ns - before_ns) > SAME_CLOCK_NS:
            self._ring.clear()

    def watch_clock(self, stale: bool, counters: Callable[[], Mapping[str, float]]) -> None:
        """Report to the operator when the autopilot's clock becomes unknown or known again."""
        if stale == self._clock_is_stale:
            return
        self._clock_is_stale = stale
        if stale:
            log.warning(
                "clock of the autopilot is not synchronized; its time is extrapolated",
                **counters(),
            )
            self._say(_STALE_CLOCK)
        else:
            log.info("clock of the autopilot is synchronized", **counters())

    def attitude(self, sample: AttitudeSample) -> None:
        """Add an attitude, whose time is in the clock of this process."""
        self._ring.add_attitude(replace(sample, time_ns=sample.time_ns + self.shift_ns))

    def position(self, sample: PositionSample) -> None:
        """Add a position, whose time is in the clock of this process.

        Record the poses that can now be interpolated.
        """
        self._ring.add_position(replace(sample, time_ns=sample.time_ns + self.shift_ns))
        newest_ns = self._ring.newest_ns
        if newest_ns is None:
            return
        if not 0 <= newest_ns - self._next_pose_ns <= POSES_KEPT_NS:
            self._next_pose_ns = newest_ns
        while self._next_pose_ns <= newest_ns:
            with suppress(UavrtError):
                pose = self._ring.vehicle_pose(self._next_pose_ns)
                self._poses.append(self._mark_extrapolated(pose))
            self._next_pose_ns += self._period_ns
        if len(self._poses) * self._period_ns >= RECORD_NS:
            self._record(Poses(poses=tuple(self._poses)))
            self._poses.clear()

    @property
    def pulses_waiting(self) -> int:
        """Number of pulses that wait for their pose."""
        return len(self._attacher)

    def add(self, pulse: Pulse) -> None:
        """Add a pulse that needs its pose."""
        self._attacher.add(pulse, self._clock.now_ns() + self.shift_ns)

    def ready(self) -> list[PulsePose]:
        """Remove and return the pulses whose pose is known or will never be known."""
        return self._marked(self._attacher.ready(self._clock.now_ns() + self.shift_ns))

    def flush(self) -> list[PulsePose]:
        """Remove and return all waiting pulses, with a pose where it is known."""
        return self._marked(self._attacher.flush())

    def _marked(self, pulse_poses: list[PulsePose]) -> list[PulsePose]:
        return [
            replace(
                item, pose=None if item.pose is None else self._mark_extrapolated(item.pose)
            )
            for item in pulse_poses
        ]

    def _mark_extrapolated(self, pose: Pose) -> Pose:
        """Mark a pose as extrapolated if the autopilot's clock is extrapolated."""
        if not self._clock_is_stale or pose.extrapolated:
            return pose
        self._on_stale_clock += 1
        return replace(pose, extrapolated=True)

    def missing(self) -> str | None:
        """Return what the station's own pose lacks, or None; report a change
        to the operator.
        """
        assert self._own is not None
        missing = self._own.status
        if missing != self._missing:
            self._missing = missing
            log.info(
                "availability of this station's pose changed", missing=missing or "nothing"
            )
            self._say(_POSE_KNOWN if missing is None else _missing_text(missing))
        return missing

    def faults(self) -> list[StatusText]:
        """Return texts on lasting faults of pose and clock, to be sent repeatedly."""
        faults = [_STALE_CLOCK] if self._clock_is_stale else []
        return faults if self._missing is None else [*faults, _missing_text(self._missing)]

    def due(self, now_ns: int) -> Pose | None:
        """Return the position of a station without autopilot if a report is due; else None."""
        if self._own is None or now_ns < self._next_report_ns:
            return None
        self._next_report_ns = now_ns + REPORT_PERIOD_NS
        newest_ns = self._ring.newest_ns
        if newest_ns is None or now_ns + self.shift_ns - newest_ns > SILENCE_NS:
            return None
        with suppress(PoseUnavailable):  # the receiver has just come back
            return self._ring.vehicle_pose(newest_ns, extrapolate=True)
        return None

    def counters(self) -> dict[str, float]:
        """Counts of poses and waiting pulses, for the health report."""
        return {
            "pulses_waiting_for_pose": len(self._attacher),
            "poses_attached": self._attacher.attached,
            "poses_extrapolated": self._attacher.extrapolated,
            "pulses_without_pose": self._attacher.without_pose,
            "pose_resets": self._ring.resets,
            **({} if self._own is None else self._own.health()),
            "poses_on_stale_clock": self._on_stale_clock,
        }
