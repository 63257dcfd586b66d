"""Check a process's CPU time and memory against the budget in the table of processes."""

from collections import deque

WINDOW_S = 20.0
"""Time over which CPU time is averaged [s]; imports or a slow disk then cause no alarm."""
CPU_ALLOWANCE = 4.0
"""Factor by which a process may exceed its CPU budget. Budgets are for the reference machine
with 100 tags; a core of a Raspberry Pi 5 is slower."""
REPEAT_S = 300.0


class BudgetWatch:
    """Checks one process against its budget. Warnings contain its `name`."""

    def __init__(self, name: str, *, cpu_percent: float, memory_mb: float) -> None:
        self._name = name
        self._cpu_percent = cpu_percent * CPU_ALLOWANCE
        self._memory_mb = memory_mb
        self._past: deque[tuple[float, float]] = deque()
        self._quiet_until_s = 0.0

    def check(self, now_s: float, cpu_s: float, memory_mb: float) -> str | None:
        """Add a measurement; return a warning if it exceeds the budget, at most every 5 min."""
        self._past.append((now_s, cpu_s))
        while len(self._past) > 2 and self._past[1][0] <= now_s - WINDOW_S:
            self._past.popleft()
        faults = []
        span_s = now_s - self._past[0][0]
        if span_s >= WINDOW_S:
            percent = 100.0 * (cpu_s - self._past[0][1]) / span_s
            if percent > self._cpu_percent:
                faults.append(
                    f"uses {percent:.0f} % of a core (budget {self._cpu_percent:.0f} %)"
                )
        if memory_mb > self._memory_mb:
            faults.append(f"uses {memory_mb:.0f} MB (budget {self._memory_mb:.0f} MB)")
        if not faults or now_s < self._quiet_until_s:
            return None
        self._quiet_until_s = now_s + REPEAT_S
        return f"{self._name} {' and '.join(faults)}"
