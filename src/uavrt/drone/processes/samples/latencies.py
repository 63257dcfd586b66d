"""Latency of the search: age of samples when they have been searched."""

import numpy as np

WINDOW_S = 30.0
STEP_MS = 1.0
MOST_MS = 10_000


class Latencies:
    """Histogram of latencies in steps of 1 ms, over the last 30 to 60 s."""

    def __init__(self) -> None:
        self._past = np.zeros(MOST_MS + 1, np.int32)
        self._present = np.zeros(MOST_MS + 1, np.int32)
        self._until_s = 0.0

    def add(self, latency_s: float, now_s: float) -> None:
        """Add a latency [s] that was measured at the time `now_s`, from any clock."""
        if now_s >= self._until_s:
            self._until_s = now_s + WINDOW_S
            self._past, self._present = self._present, self._past
            self._present[:] = 0
        step = int(latency_s * 1e3 / STEP_MS)
        self._present[min(max(step, 0), MOST_MS)] += 1

    def percentile_ms(self, percent: float) -> float | None:
        """Return the given percentile of the latencies [ms]; None without values."""
        up_to = np.cumsum(self._past + self._present)
        if not up_to[-1]:
            return None
        step = int(np.searchsorted(up_to, up_to[-1] * percent / 100.0))
        return min(step + 1, MOST_MS) * STEP_MS

    def counters(self) -> dict[str, float]:
        """Return median and 99th percentile of the latency, rounded up to 1 ms."""
        median_ms, slow_ms = self.percentile_ms(50.0), self.percentile_ms(99.0)
        if median_ms is None or slow_ms is None:
            return {}
        return {"latency_p50_ms": median_ms, "latency_p99_ms": slow_ms}
