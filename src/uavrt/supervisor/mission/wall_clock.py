"""Note wall clock corrections during a flight; the flight keeps its own time."""

from uavrt.card import clock_fault
from uavrt.units import NANOSECONDS_PER_SECOND

NOTED_S = 0.5
"""Smallest correction that is noted [s]; NTP slews half a second in 17 minutes at most."""
AGAIN_S = 15.0
"""Time after which a wrong time is reported again [s], for a station that connects later.
Longer than the ten seconds in which the connection suppresses repeated texts."""


class WallClockWatch:
    """Compares the wall clock with a flight's."""

    def __init__(self) -> None:
        self._noted_s = 0.0
        self._again_s: float | None = None

    def flight_started(self, now_s: float) -> str | None:
        """Start with both equal; return a text if the time is wrong."""
        self._noted_s = 0.0
        text = _wrong_time()
        self._again_s = None if text is None else now_s + AGAIN_S
        return text

    def wrong_time_again(self, now_s: float) -> str | None:
        """Return the text of a flight's start once more, some seconds later."""
        if self._again_s is None or now_s < self._again_s:
            return None
        self._again_s = None
        return _wrong_time()

    def check(self, correction_ns: int) -> str | None:
        """Compare the wall clock with the flight's; return a text if a change is new."""
        correction_s = correction_ns / NANOSECONDS_PER_SECOND
        moved_s = correction_s - self._noted_s
        if abs(moved_s) < NOTED_S:
            return None
        self._noted_s = correction_s
        return (
            f"Wall clock corrected by {moved_s:+.3f} s; the flight keeps its time, "
            f"{correction_s:+.3f} s from it"
        )


def _wrong_time() -> str | None:
    fault = clock_fault()
    return None if fault is None else f"Drone's clock: {fault}"
