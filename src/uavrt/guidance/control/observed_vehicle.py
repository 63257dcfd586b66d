"""The vehicle's state from its last reports, and reasons that forbid a command; no I/O."""

from math import inf

from uavrt.core.units import wrap_degrees_180
from uavrt.guidance.autopilot_behaviour import Behaviour
from uavrt.guidance.control.lateness import ReportDelay
from uavrt.guidance.control.observed import (
    AutopilotStarted,
    BootTimeReport,
    FailsafeReport,
    HomeReport,
    LandedReport,
    ModeReport,
    Observation,
    PositionLost,
    PositionReport,
    SticksReport,
    TargetReport,
)
from uavrt.guidance.control.rc_watch import RcWatch
from uavrt.guidance.safety import SAFETY


class ObservedVehicle:
    """Newest report of each kind from one vehicle, and the state that follows from them."""

    def __init__(self, behaviour: Behaviour, failsafe: FailsafeReport | None = None) -> None:
        self.behaviour = behaviour
        self.mode: ModeReport | None = None
        self.heartbeat: ModeReport | None = None
        """Newest report of the flight mode that includes the arming state."""
        self.position: PositionReport | None = None
        self.target: TargetReport | None = None
        self.turning_deg_s = self.target_turning_deg_s = 0.0
        """Last rates of change of the heading and of the reported target heading [°/s]."""
        self._rest: PositionReport | None = None
        """First position report since which the heading stayed within `SAFETY.rest_deg`."""
        self.landed: LandedReport | None = None
        self.sticks: SticksReport | None = None
        self.home: HomeReport | None = None
        self.failsafe = failsafe
        """Last reported failsafe; valid until too old, even if the autopilot restarts."""
        self._lateness = ReportDelay()

    def store(self, seen: Observation) -> bool:
        """Store a report; False if it is older than a stored one of the same kind."""
        match seen:
            case PositionReport():
                if self.position is not None and seen.boot_s < self.position.boot_s:
                    return False
                self.turning_deg_s = _turning(self.position, seen, self.turning_deg_s)
                if self._rest is None or _apart_deg(self._rest, seen) > SAFETY.rest_deg:
                    self._rest = seen
                self.position = seen
            case TargetReport():
                if self.target is not None and seen.boot_s < self.target.boot_s:
                    return False
                # Two reports are too uneven in time for the rate: 32°/s for 41°/s on PX4 1.17.
                self.target_turning_deg_s = seen.yaw_rate_deg_s or _turning(
                    self.target, seen, self.target_turning_deg_s
                )
                self.target = seen
            case ModeReport():
                self.mode = seen
                self.heartbeat = self.heartbeat if seen.armed is None else seen
                if seen.failsafe:
                    self.failsafe = FailsafeReport(seen.time_s, "critical state")
            case SticksReport():
                self.sticks = seen
            case HomeReport():
                self.home = seen
            case LandedReport():
                self.landed = seen
            case FailsafeReport():
                self.failsafe = seen
            case PositionLost():
                self.position = None
            case BootTimeReport():
                self._lateness.observe(seen)
        return True

    def restarted(self, seen: Observation) -> str | None:
        """Return a text if a report shows a new or restarted autopilot; else None."""
        if isinstance(seen, AutopilotStarted):
            return "another autopilot"
        restarted = isinstance(seen, BootTimeReport) and self._lateness.starts_again(seen)
        return "the autopilot has restarted" if restarted else None

    @property
    def known(self) -> tuple[ModeReport, PositionReport, HomeReport]:
        """Mode, position and home. All three are known if `fault` returns None."""
        assert self.mode is not None
        assert self.position is not None
        assert self.home is not None
        return self.mode, self.position, self.home

    @property
    def heading_rests(self) -> bool:
        """True if the heading is steady, so that a turn must come from a command or a pilot."""
        position = self.position
        if position is None or self._rest is None:
            return False
        follows = self.behaviour.follows_course and position.speed_m_s > SAFETY.course_m_s
        return not follows and position.boot_s - self._rest.boot_s >= SAFETY.rest_s

    @property
    def mode_name(self) -> str:
        """Name of the present mode; empty before any report."""
        return "" if self.mode is None else self.behaviour.mode_name(self.mode.mode)

    @property
    def in_own_mode(self) -> bool:
        """True if the vehicle is in the mode in which commands are flown."""
        return self.mode is not None and self.mode.mode == self.behaviour.own_mode

    @property
    def late(self) -> str | None:
        """Text on a delay of reports that forbids commands; None if it is small enough."""
        return self._lateness.fault

    def fault(self, now_s: float, *, takeoff: bool = False) -> tuple[str, str] | None:
        """Return why no order can be confirmed now, and the remedy; None if one can."""
        if self.mode is None or now_s - self.mode.time_s > SAFETY.mode_age_s:
            return "the autopilot's mode is unknown", "Check the link to the autopilot"
        if self.heartbeat is None or now_s - self.heartbeat.time_s > SAFETY.heartbeat_lost_s:
            return "no heartbeat of the autopilot", "Check the link to the autopilot"
        if self.position is None or now_s - self.position.time_s > SAFETY.position_age_s:
            return "the vehicle has no position", "Wait for its GPS"
        if self.home is None:
            return "the vehicle has no home", "Wait for its position, or set home in the GCS"
        if self.late is not None:
            return self.late, "Lower its stream rates, or use a faster link"
        if not self.heartbeat.armed:
            what = (
                "Let the pilot arm it, then request the motion again"
                if takeoff
                else "Take off by hand"
            )
            return "the vehicle is not armed", f"{what}; uavrt never arms"
        if self.on_ground(now_s) and not takeoff:
            return "the vehicle is on the ground", "Take off by hand first"
        if takeoff and not self.on_ground(now_s):
            return "the vehicle is already in the air", "Request another motion"
        climbs = self.mode.mode == self.behaviour.takeoff_mode and not self.in_own_mode
        if climbs and not takeoff:
            return "the vehicle is still taking off", "Request the motion again once it hovers"
        if self.failsafe is not None and now_s - self.failsafe.time_s <= SAFETY.mode_lost_s:
            what = self.failsafe.cause
            return f"the autopilot reports a failsafe: {what}", "Land, and find its cause"
        return None

    def lost(self, now_s: float) -> str | None:
        """Return which report has been missing long enough to end an order, or None."""
        if self.mode is None or now_s - self.mode.time_s > SAFETY.mode_lost_s:
            return "the mode is no longer reported"
        if self.heartbeat is None or now_s - self.heartbeat.time_s > SAFETY.heartbeat_lost_s:
            return "no heartbeat of the autopilot"
        if self.position is None or now_s - self.position.time_s > SAFETY.position_lost_s:
            return "the position is lost"
        return None

    def on_ground(self, now_s: float) -> bool:
        """True if the vehicle is on the ground.

        Without a recent report, its height above home decides.
        """
        landed, position = self.landed, self.position
        fresh = landed is not None and now_s - landed.time_s <= SAFETY.landed_age_s
        if fresh and landed is not None and landed.on_ground is not None:
            return landed.on_ground
        return position is not None and position.altitude_relative_m < SAFETY.flying_height_m

    def target_age_s(self, now_s: float) -> float:
        """Time since the autopilot last reported its target [s]."""
        return inf if self.target is None else now_s - self.target.time_s

    def sticks_reported(self, now_s: float, within_s: float) -> bool:
        """True if the RC sticks were reported in the last `within_s` [s]."""
        seen = self.sticks
        return seen is not None and bool(seen.channels_us) and now_s - seen.time_s <= within_s

    def rc(self, now_s: float, unwatched: frozenset[int]) -> RcWatch | None:
        """Return a new monitor of the remote control; None if no remote control is received."""
        if self.sticks is None or not self.sticks_reported(now_s, SAFETY.sticks_lost_s):
            return None
        return RcWatch(self.sticks, unwatched)


def ended_by(seen: Observation) -> str | None:
    """Return why a report ends any order: failsafe, disarming, or lost position.

    None if it does not.
    """
    match seen:
        case FailsafeReport():
            return f"failsafe: {seen.cause}"
        case PositionLost():
            return "the position is lost"
        case ModeReport(armed=False):
            return "the vehicle is disarmed"
        case ModeReport(failsafe=True):
            return "the autopilot is in a failsafe"
    return None


def _apart_deg(one: PositionReport, other: PositionReport) -> float:
    """Return the angle between the headings of two reports [°]; 0 if one has no heading."""
    if one.yaw_deg is None or other.yaw_deg is None:
        return 0.0
    return abs(wrap_degrees_180(one.yaw_deg - other.yaw_deg))


def _turning(
    before: PositionReport | TargetReport | None,
    seen: PositionReport | TargetReport,
    known: float,
) -> float:
    """Return the turn rate between two reports [°/s]; `known` if they have the same time."""
    gap_s = 0.0 if before is None else seen.boot_s - before.boot_s
    if before is None or gap_s <= 0.0:
        return known
    if before.yaw_deg is None or seen.yaw_deg is None or gap_s > SAFETY.position_age_s:
        return 0.0
    return wrap_degrees_180(seen.yaw_deg - before.yaw_deg) / gap_s
