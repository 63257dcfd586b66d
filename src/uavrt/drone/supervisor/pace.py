"""Check that a process produces records as often as the table of topics specifies.

A process that falls behind is alive and within its budget; only its record rate shows it. The
longest gap is ignored: silent processes are killed elsewhere, and processes that wait for a
radio or autopilot report that themselves.
"""

from collections import deque
from itertools import pairwise

from uavrt.drone.ipc.topics import TOPICS

RATE_RECORDS = 20
"""Number of consecutive records of a topic or tag over which the rate is measured."""
SLOW_RATIO = 2.0
"""Ratio of measured to specified record period above which a process is too slow."""
REPEAT_S = 300.0


class PaceWatch:
    """Checks the record rate of one process. Warnings contain its `name`."""

    def __init__(self, name: str, topics: tuple[str, ...]) -> None:
        self._name = name
        self._came_s: dict[str, deque[float]] = {
            topic: deque() for topic in topics if TOPICS[topic].every_s is not None
        }
        self._tags = 1
        self._quiet_until_s = 0.0
        self.slow: dict[str, float] = {}
        """Topics with too low a rate, each with its measured period [s]."""

    def started(self, tags: int) -> None:
        """Reset after the process has started; it serves the given number of tags."""
        self._tags = max(1, tags)
        self.slow = {}
        for came_s in self._came_s.values():
            came_s.clear()

    def record_arrived(self, topic: str, now_s: float) -> None:
        """Count a record that has arrived from the process."""
        came_s = self._came_s.get(topic)
        if came_s is not None:
            came_s.append(now_s)
            if len(came_s) > self._judged(topic):
                came_s.popleft()

    def check(self, now_s: float) -> str | None:
        """Measure the rates; return a warning if one is too low, at most every five minutes."""
        self.slow = {}
        for topic, came_s in self._came_s.items():
            every_s = TOPICS[topic].every_s
            if every_s is None or len(came_s) < self._judged(topic):
                continue
            gaps_s = [after - before for before, after in pairwise(came_s)]
            # A tag's records come in groups: there are no gaps within one.
            mean_s = (sum(gaps_s) - max(gaps_s)) / (RATE_RECORDS - 2)
            if mean_s > SLOW_RATIO * every_s:
                self.slow[topic] = mean_s
        if not self.slow or now_s < self._quiet_until_s:
            return None
        self._quiet_until_s = now_s + REPEAT_S
        slow = " and ".join(
            f"{topic} every {mean_s:.1f} s ({TOPICS[topic].every_s:g} s)"
            for topic, mean_s in self.slow.items()
        )
        return f"{self._name} is too slow: {slow}"

    def _judged(self, topic: str) -> int:
        return RATE_RECORDS * (self._tags if TOPICS[topic].each_tag else 1)
