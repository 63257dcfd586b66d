"""When a process that ended is started again: at once, then ever later, then "degraded"."""

from dataclasses import dataclass

DELAYS_S = (0.0, 0.5, 1.0, 2.0, 5.0)
"""Wait before the first, second, … restart in a row; the last repeats."""
SETTLED_S = 10.0
"""Alive for this long: restarts in a row are counted from the beginning."""
DEGRADED_AFTER = 4
"""So many ends in a row, and the process is given up for the operator's eye, though it is
still tried: a radio may be plugged in again, a disk may get room."""


@dataclass(slots=True)
class Restarts:
    """What one process's ends have been."""

    total: int = 0
    in_a_row: int = 0
    not_before_s: float = 0.0
    """Monotonic time before which it is not started again."""
    last_reason: str = ""
    _started_s: float = 0.0

    def started(self, now_s: float) -> None:
        """Take note of a start."""
        self._started_s = now_s

    def ended(self, now_s: float, reason: str) -> float:
        """Take note of an end that was not asked for; get the wait before the restart [s]."""
        if now_s - self._started_s > SETTLED_S:
            self.in_a_row = 0
        delay_s = DELAYS_S[min(self.in_a_row, len(DELAYS_S) - 1)]
        self.in_a_row += 1
        self.total += 1
        self.last_reason = reason
        self.not_before_s = now_s + delay_s
        return delay_s

    def degraded(self, now_s: float) -> bool:
        """Whether it keeps ending."""
        return self.in_a_row >= DEGRADED_AFTER and now_s - self._started_s <= SETTLED_S
