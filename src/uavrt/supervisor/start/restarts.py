"""When to restart a process that ended: at once, then with growing delays, then "degraded"."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class RestartPolicy:
    """The rule for one row of the table of processes."""

    delays_s: tuple[float, ...] = (0.0, 0.5, 1.0, 2.0, 5.0)
    """Wait before the first, second, … restart in a row [s]; the last repeats."""
    settled_s: float = 10.0
    """Time alive after which restarts in a row are counted from the beginning [s]."""
    degraded_after: int = 4
    """Ends in a row after which it is reported degraded; restarts continue."""

    def words(self) -> str:
        """Describe it: ``after 0, 0.5 s …; degraded after 4``."""
        delays = ", ".join(f"{delay_s:g}" for delay_s in self.delays_s)
        return f"after {delays} s …; degraded after {self.degraded_after}"


SOON = RestartPolicy()
"""Restart at once, for processes that a flight needs."""


@dataclass(slots=True)
class Restarts:
    """The history of one process's exits."""

    policy: RestartPolicy = SOON
    total: int = 0
    in_a_row: int = 0
    not_before_s: float = 0.0
    """Monotonic time before which it is not started again."""
    last_reason: str = ""
    _started_s: float = 0.0

    def started(self, now_s: float) -> None:
        """Note a start."""
        self._started_s = now_s

    def forgive(self) -> None:
        """Reset the count, because the operator ended the process's task."""
        self.in_a_row, self.not_before_s = 0, 0.0

    def ended(self, now_s: float, reason: str) -> float:
        """Note an unexpected end; get the wait before the restart [s]."""
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
        """Whether it ends repeatedly."""
        often = self.in_a_row >= self.policy.degraded_after
        return often and now_s - self._started_s <= self.policy.settled_s
