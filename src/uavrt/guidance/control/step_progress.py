"""Detect that an unfinished step has come to rest; no I/O.

A pause of ArduCopter shows in no message: mode and target stay, the drone stops. Whatever the
cause, a step without progress for 3 s counts as stopped.
"""

from collections import deque
from dataclasses import dataclass
from itertools import islice

from uavrt.guidance.safety import SAFETY


@dataclass(frozen=True, slots=True, kw_only=True)
class Remaining:
    """Remaining distance [m] or angle [°] of a motion."""

    now: float
    """Present remaining distance or angle; NaN: the bearing to a place below is undefined."""
    soon: float
    """Remaining distance or angle where the drone would stop if it braked now."""
    least: float
    """Smallest decrease of `now` in `SAFETY.no_progress_s` that counts as progress."""
    tolerance: float
    """Remaining distance or angle up to which the motion counts as done."""
    needed: bool = True
    """False if the motion may end above `tolerance`; the value then only shows progress."""


@dataclass(frozen=True, slots=True)
class _Sample:
    time_s: float
    parts: tuple[Remaining, ...]
    free: bool


class Progress:
    """Monitors the progress of one step, beginning with its command."""

    def __init__(self) -> None:
        self._samples: deque[_Sample] = deque()

    def observe(self, time_s: float, *parts: Remaining, free: bool = False) -> None:
        """Add the present remaining values, in the same order at each call.

        `free`: True if the drone has no reason to brake before the first value has decreased.
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
        """True if the step is unfinished and no remaining value decreased for `for_s` [s]."""
        if not self._samples or time_s - self._samples[0].time_s < for_s:
            return False
        return not self._nearer(time_s, for_s)

    def brakes(self, time_s: float) -> bool:
        """True if the drone slows down without a reason: the stopping point comes no nearer."""
        if not self._samples or not self._samples[-1].free:
            return False
        old = (
            one for one in reversed(self._samples) if one.time_s <= time_s - SAFETY.braking_s
        )
        now = self._samples[-1].parts[0]
        return any(now.soon > then.parts[0].soon - SAFETY.braking_m for then in islice(old, 1))

    def _nearer(self, time_s: float, within_s: float) -> bool:
        """True if a remaining distance or angle fell enough for progress in `within_s` [s]."""
        share = within_s / SAFETY.no_progress_s
        now = self._samples[-1].parts
        return any(
            max(a.now - b.now, a.soon - b.soon) >= share * b.least
            for then in self._samples
            if then.time_s >= time_s - within_s - SAFETY.sample_s
            for a, b in zip(then.parts, now, strict=True)
            if a.now > a.tolerance
        )
