"""Detect that the drone has stopped before a step is complete; no I/O.

No message of ArduCopter shows a pause: mode and target stay, and the drone stops. Whatever the
cause, a step without progress for 3 s counts as stopped.
"""

from collections import deque
from dataclasses import dataclass
from itertools import islice

from uavrt.guidance.safety import SAFETY


@dataclass(frozen=True, slots=True, kw_only=True)
class Remaining:
    """Remaining distance [m] or angle [°] of a step, and how much of it counts as progress."""

    now: float
    """Remaining distance [m] or angle [°]; NaN for the bearing of a target below the drone."""
    soon: float
    """Distance or angle that would remain if the drone braked now."""
    least: float
    """Smallest decrease of `now` in `SAFETY.no_progress_s` that counts as progress."""
    tolerance: float
    """Remaining distance or angle at which the motion counts as complete."""
    needed: bool = True
    """False if the step may be complete with `now` above `tolerance`; `now` then only shows
    progress."""


@dataclass(frozen=True, slots=True)
class _Sample:
    time_s: float
    parts: tuple[Remaining, ...]
    free: bool


class Progress:
    """Monitors the progress of one step since its command."""

    def __init__(self) -> None:
        self._samples: deque[_Sample] = deque()

    def observe(self, time_s: float, *parts: Remaining, free: bool = False) -> None:
        """Add the present remaining values; each call must give them in the same order.

        `free` is True if the drone has no reason yet to brake for its target.
        """
        if all(part.now <= part.tolerance for part in parts if part.needed):
            self._samples.clear()
            return
        self._samples.append(_Sample(time_s, parts, free))
        while (
            len(self._samples) > 1 and self._samples[1].time_s <= time_s - SAFETY.no_progress_s
        ):
            self._samples.popleft()

    def stopped(self, time_s: float, for_s: float = SAFETY.no_progress_s) -> bool:
        """True if the step is incomplete and has made no progress for `for_s` [s]."""
        if not self._samples or time_s - self._samples[0].time_s < for_s:
            return False
        return not self._nearer(time_s, for_s)

    def brakes(self, time_s: float) -> bool:
        """True if the drone brakes although it is not yet near its target."""
        if not self._samples or not self._samples[-1].free:
            return False
        old = (
            one for one in reversed(self._samples) if one.time_s <= time_s - SAFETY.braking_s
        )
        now = self._samples[-1].parts[0]
        return any(now.soon > then.parts[0].soon - SAFETY.braking_m for then in islice(old, 1))

    def _nearer(self, time_s: float, within_s: float) -> bool:
        """True if a remaining distance or angle has decreased enough within `within_s` [s]."""
        share = within_s / SAFETY.no_progress_s
        now = self._samples[-1].parts
        return any(
            max(a.now - b.now, a.soon - b.soon) >= share * b.least
            for then in self._samples
            if then.time_s >= time_s - within_s - SAFETY.sample_s
            for a, b in zip(then.parts, now, strict=True)
            if a.now > a.tolerance
        )
