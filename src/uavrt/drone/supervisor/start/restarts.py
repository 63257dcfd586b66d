"""Decide when to restart a process: at first at once, later after increasing delays."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class RestartPolicy:
    """Delays before the restarts of a process, and when it counts as degraded."""

    delays_s: tuple[float, ...] = (0.0, 0.5, 1.0, 2.0, 5.0)
    """Delays before the first, second, … restart in a row [s]; the last one repeats."""
    settled_s: float = 10.0
    """Running time after which the count of restarts in a row begins again [s]."""
    degraded_after: int = 4
    """Number of unexpected ends in a row from which a process is reported as degraded."""

    def words(self) -> str:
        """Return the policy as text: ``after 0, 0.5 s …; degraded after 4``."""
        delays = ", ".join(f"{delay_s:g}" for delay_s in self.delays_s)
        return f"after {delays} s …; degraded after {self.degraded_after}"


FLIGHT_RESTARTS = RestartPolicy()
"""Policy for processes that a flight needs: first restart at once."""


@dataclass(slots=True)
class Restarts:
    """Counts unexpected ends of one process, and computes when to start it again."""

    policy: RestartPolicy = FLIGHT_RESTARTS
    total: int = 0
    in_a_row: int = 0
    not_before_s: float = 0.0
    """Earliest time of the process's next start [s, monotonic]."""
    last_reason: str = ""
    _started_s: float = 0.0

    def started(self, now_s: float) -> None:
        """Note that the process has started."""
        self._started_s = now_s

    def reset_count(self) -> None:
        """Reset the count of ends in a row, because the operator has ended the flight."""
        self.in_a_row, self.not_before_s = 0, 0.0

    def ended(self, now_s: float, reason: str) -> float:
        """Count an unexpected end; return the delay before the restart [s]."""
        delays_s = self.policy.delays_s
        if now_s - self._started_s > self.policy.settled_s:
            self.in_a_row = 0
        delay_s = delays_s[min(self.in_a_row, len(delays_s) - 1)]
        self.in_a_row += 1
        self.total += 1
        self.last_reason = reason
        self.not_before_s = now_s + delay_s
        return delay_s

    def degraded(self, now_s: float) -> bool:
        """True if the process has repeatedly ended soon after its start."""
        often = self.in_a_row >= self.policy.degraded_after
        return often and now_s - self._started_s <= self.policy.settled_s
