"""Decide from the running system whether a new version is fit to fly.

A version is kept if the autopilot's heartbeat and fresh poses arrived for a minute without a
gap, and no process was restarted. Otherwise the previous version is restored. While the vehicle
is armed nothing is exchanged: even a faulty version runs until three minutes after disarming.
"""

from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from uavrt.config.settings import Settings
from uavrt.core.commands import SystemState
from uavrt.core.errors import UsageError
from uavrt.core.messages import Poses, SystemStatus

HOLD_S = 60.0
"""Time for which a new version must work without a gap before it is kept [s]."""
TRIAL_TIMEOUT_S = 180.0
"""Longest trial of a new version [s], from its start or the landing; then the previous version
is restored."""
GAP_S = 5.0
"""Longest gap between records that passes a trial [s]; status comes every 1 s, poses every 0.5
s."""
HEARD = ("waiting for ground station", "ready")
ARMED = "autopilot_armed"
"""Counter in the connection's health: 1 if the autopilot reports armed, 0 if disarmed."""


class Verdict(Enum):
    """Decision on a new version: keep, restore the previous one, or wait."""

    OPEN = "open"
    GOOD = "good"
    BAD = "bad"


@dataclass(frozen=True, slots=True)
class Needs:
    """Kinds of records that a new version must produce to pass its trial."""

    heartbeat: bool
    poses: bool

    @classmethod
    def of(cls, settings: Settings) -> "Needs":
        """Kinds of records that a drone or ground station with these settings must produce."""
        own = settings.pose.source != "autopilot"
        heartbeat = bool(settings.mavlink.address) and not own
        return cls(heartbeat=heartbeat, poses=heartbeat or own)


@dataclass(slots=True)
class Seen:
    """Arrival times of the newest records [s], and the state that they report."""

    status_s: float | None = None
    heartbeat_s: float | None = None
    poses_s: float | None = None
    armed: bool | None = None
    """True if the vehicle is armed; None if unknown."""
    state: SystemState | None = None
    restarts: dict[str, int] = field(default_factory=dict)
    restarted: tuple[str, ...] = ()
    """Names of the processes restarted since the previous status record."""

    def add(self, record: Any, now_s: float) -> None:
        """Add a record of the system; only poses and status records are used."""
        match record:
            case Poses():
                self.poses_s = now_s
            case SystemStatus():
                self._receive_status(record, now_s)

    def _receive_status(self, status: SystemStatus, now_s: float) -> None:
        self.status_s, self.state = now_s, status.state
        restarts = {process.process: process.restarts for process in status.processes}
        self.restarted = tuple(
            name for name, count in restarts.items() if count > self.restarts.get(name, 0)
        )
        self.restarts = restarts
        for process in status.processes:
            if process.process == "connection" and process.status in HEARD:
                self.heartbeat_s = now_s
                armed = process.counters.get(ARMED)
                self.armed = None if armed is None else bool(armed)

    def is_armed(self, now_s: float) -> bool:
        """True if the autopilot's heartbeats arrive and report that it is armed."""
        heard = self.heartbeat_s is not None and now_s - self.heartbeat_s <= GAP_S
        return heard and bool(self.armed)

    def missing(self, needs: Needs, now_s: float) -> str:
        """Return the names of required records that are overdue, as text; empty if none is."""
        wanted = [(self.status_s, "the service")]
        wanted += [(self.heartbeat_s, "the autopilot's heartbeat")] * needs.heartbeat
        wanted += [(self.poses_s, "poses")] * needs.poses
        gone = [name for seen_s, name in wanted if seen_s is None or now_s - seen_s > GAP_S]
        return ", ".join(gone)


class Trial:
    """Trial of a new version: within `patience_s` it must work for `hold_s` without a gap."""

    def __init__(
        self,
        needs: Needs,
        now_s: float,
        *,
        hold_s: float = HOLD_S,
        patience_s: float = TRIAL_TIMEOUT_S,
    ) -> None:
        self._needs, self._hold_s = needs, hold_s
        self._timeout_s = max(patience_s, hold_s)
        self._from_s = now_s
        self._good_from_s: float | None = None
        self.seen = Seen()
        self.fault = "the service sent no status"
        """Text on what was missing or restarted at the last failed check."""

    def judge(self, records: list[Any], now_s: float) -> Verdict:
        """Evaluate new records; return whether to keep or undo the update, or to wait."""
        for record in records:
            self.seen.add(record, now_s)
            if self.seen.restarted:
                self._good_from_s = None
                self.fault = f"{', '.join(self.seen.restarted)} had to be restarted"
        if missing := self.seen.missing(self._needs, now_s):
            self._good_from_s = None
            self.fault = f"missing: {missing}"
        elif self._good_from_s is None:
            self._good_from_s = now_s
        if self._good_from_s is not None and now_s - self._good_from_s >= self._hold_s:
            return Verdict.GOOD
        if self.seen.is_armed(now_s):
            self._from_s = now_s
        # A process that dies repeatedly must not extend the trial for ever:
        # only what was good when patience ended may still become so.
        end_s = self._from_s + self._timeout_s
        late = now_s > end_s and (self._good_from_s is None or self._good_from_s > end_s)
        return Verdict.BAD if late else Verdict.OPEN


def require_still(seen: Seen, needs: Needs, now_s: float, *, bench: bool) -> Needs:
    """Raise `UsageError` if the vehicle may be flying; return what a trial must observe.

    `bench`: the drone is on a bench; heartbeat and poses are required only if present now.
    """
    if seen.armed:
        raise UsageError("the vehicle is armed: nothing was changed", remedy="Disarm it first")
    if seen.state in (SystemState.DETECTING, SystemState.CAPTURING):
        remedy = "Stop it first: uavrt monitor --stop, or on the page"
        raise UsageError("a flight is being recorded: nothing was changed", remedy=remedy)
    if bench:
        now = Needs(heartbeat=True, poses=True)
        gone = seen.missing(now, now_s)
        return Needs(
            heartbeat=needs.heartbeat and "heartbeat" not in gone,
            poses=needs.poses and "poses" not in gone,
        )
    if needs.heartbeat and seen.armed is None:
        raise UsageError(
            "no autopilot answers, so the vehicle may be armed: nothing was changed",
            remedy="Switch the autopilot on, or give --bench if the drone is on a bench",
        )
    if needs.poses and seen.status_s is not None and "poses" in seen.missing(needs, now_s):
        raise UsageError(
            "no poses arrive, so the new version cannot be tested: nothing was changed",
            remedy="Take the drone outdoors, or give --bench",
        )
    return needs
