"""Notice that a step has come to rest though some of it is left. Pure.

A pause of ArduCopter shows in no message: mode and target stay, the drone stands. Whatever
stops it, a step that comes nearer in nothing for 3 s is not flown any more.
"""

from collections import deque
from dataclasses import dataclass
from math import inf

ARRIVED_M, AT_HEIGHT_M, LOOKS_DEG = 3.0, 2.0, 8.0
"""What may be left of a step that is done: place, height and heading."""
STANDS_S = 3.0
"""Longest without coming nearer, also from the command to the first motion [s]."""
SLOW_S = 0.8
"""After this, no further command is sent until it comes nearer again [s]."""
NEARER_M, HIGHER_M, TURNED_DEG = 0.5, 0.3, 3.0
"""Least change in `STANDS_S` that is coming nearer; wind may slow a drone to that."""


@dataclass(frozen=True, slots=True)
class Left:
    """What is left to change of one quantity."""

    left: float
    least: float
    """Change in `STANDS_S` that counts."""
    tolerance: float = inf
    """What may be left; infinite for what only shows that something is happening."""


@dataclass(frozen=True, slots=True)
class _Sample:
    time_s: float
    parts: tuple[Left, ...]


class Progress:
    """Watches one step from its command on."""

    def __init__(self, time_s: float) -> None:
        self._seen: deque[_Sample] = deque()
        self._start_s = time_s

    def see(self, time_s: float, *parts: Left) -> None:
        """Take what is left now; the same parts, in the same order, each time."""
        if all(part.left <= part.tolerance for part in parts if part.tolerance < inf):
            self._seen.clear()
            self._start_s = time_s
            return
        self._seen.append(_Sample(time_s, parts))
        while len(self._seen) > 1 and self._seen[1].time_s <= time_s - STANDS_S:
            self._seen.popleft()

    def stands(self, time_s: float, for_s: float = STANDS_S) -> bool:
        """Whether something is left and nothing came nearer for so long."""
        if not self._seen or time_s - self._start_s < for_s:
            return False
        old = (one for one in reversed(self._seen) if one.time_s <= time_s - for_s)
        then, now = next(old, self._seen[0]), self._seen[-1]
        share = for_s / STANDS_S
        return not any(
            a.left - b.left >= share * b.least
            for a, b in zip(then.parts, now.parts, strict=True)
        )
