"""Report corrections of the computer's clock during a flight; the flight keeps its own time."""

from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.drone.card import clock_fault

REPORTED_CORRECTION_S = 0.5
"""Smallest reported clock correction [s]; NTP slews at most 0.5 s in 17 minutes."""
REPEAT_AFTER_S = 15.0
"""Time after which a wrong clock is reported again [s], for stations that connect later. It is
longer than the 10 s in which repeated texts are suppressed."""


class WallClockWatch:
    """Detects corrections of the computer's clock during a flight, and an impossible date."""

    def __init__(self) -> None:
        self._noted_s = 0.0
        self._again_s: float | None = None

    def flight_started(self, now_s: float) -> str | None:
        """Begin to compare clocks; return a warning if the date is impossible, else None."""
        self._noted_s = 0.0
        text = _wrong_time()
        self._again_s = None if text is None else now_s + REPEAT_AFTER_S
        return text

    def repeated_warning(self, now_s: float) -> str | None:
        """Return the warning of a wrong date once more after `REPEAT_AFTER_S`; else None."""
        if self._again_s is None or now_s < self._again_s:
            return None
        self._again_s = None
        return _wrong_time()

    def check(self, correction_ns: int) -> str | None:
        """Compare the clocks; return a text if their difference has changed, else None."""
        correction_s = correction_ns / NANOSECONDS_PER_SECOND
        moved_s = correction_s - self._noted_s
        if abs(moved_s) < REPORTED_CORRECTION_S:
            return None
        self._noted_s = correction_s
        return (
            f"Wall clock corrected by {moved_s:+.3f} s; the flight's own time now differs by "
            f"{correction_s:+.3f} s from it"
        )


def _wrong_time() -> str | None:
    fault = clock_fault()
    return None if fault is None else f"Drone's clock: {fault}"
