"""Notice that an unfinished step has come to rest. Pure.

A pause of ArduCopter shows in no message: mode and target stay, the drone stands. Whatever
stops it, a step without progress for 3 s is no longer flown.
"""

from collections import deque
from dataclasses import dataclass
from itertools import islice

from uavrt.guidance.safety import SAFETY


@dataclass(frozen=True, slots=True, kw_only=True)
class Left:
    """Remaining change of one quantity."""

    now: float
    soon: float
    """Remaining change from the stopping point: it falls first when the drone must turn
    back."""
    least: float
    """Change within `SAFETY.no_progress_s` that counts as progress."""
    tolerance: float
    """Tolerance at the end."""
    needed: bool = True
    """False: the quantity need not end within the tolerance; its change only shows progress."""


@dataclass(frozen=True, slots=True)
class _Sample:
    time_s: float
    parts: tuple[Left, ...]
    free: bool


class Progress:
    """Monitors one step from its command on."""

    def __init__(self) -> None:
        self._samples: deque[_Sample] = deque()

    def see(self, time_s: float, *parts: Left, free: bool = False) -> None:
        """Add the remaining changes: the same parts in the same order each time.

        `free`: it need not brake or stop before the first part has decreased.
        """
        if all(part.now <= part.tolerance for part in parts if part.needed):
            self._samples.clear()
            return
        self._samples.append(_Sample(time_s, parts, free))
        while (
            len(self._samples) > 1 and self._samples[1].time_s <= time_s - SAFETY.no_progress_s
        ):
            self._samples.popleft()

    def stands(self, time_s: float, for_s: float = SAFETY.no_progress_s) -> bool:
        """True if something remains and nothing has decreased for so long."""
        if not self._samples or time_s - self._samples[0].time_s < for_s:
            return False
        return not self._nearer(time_s, for_s)

    def brakes(self, time_s: float) -> bool:
        """True if it slows down without a reason: its stopping point comes no nearer."""
        if not self._samples or not self._samples[-1].free:
            return False
        old = (
            one for one in reversed(self._samples) if one.time_s <= time_s - SAFETY.braking_s
        )
        now = self._samples[-1].parts[0]
        return any(now.soon > then.parts[0].soon - SAFETY.braking_m for then in islice(old, 1))

    def _nearer(self, time_s: float, within_s: float) -> bool:
        """True if any remaining part has decreased, relative to its least change."""
        share = within_s / SAFETY.no_progress_s
        now = self._samples[-1].parts
        return any(
            max(a.now - b.now, a.soon - b.soon) >= share * b.least
            for then in self._samples
            if then.time_s >= time_s - within_s - SAFETY.sample_s
            for a, b in zip(then.parts, now, strict=True)
            if a.now > a.tolerance
        )
