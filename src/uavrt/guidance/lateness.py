"""Delay of the vehicle's reports, by its own clock in them. Pure.

Behind a slow link's queue the report of a pilot's return arrives seconds after its begin.
"""

from uavrt.guidance.observed import BootTimeSeen
from uavrt.guidance.safety import SAFETY


class Lateness:
    """Measures the delay by the autopilot's time since its start.

    Where TIMESYNC gives that clock's time, by that; else by the least offset since the link
    came up: the quickest message is taken to be in time.
    """

    def __init__(self) -> None:
        self._least: tuple[float, float] | None = None
        """Arrival [s] and offset [s] of the quickest message."""
        self._boot_s = 0.0
        self.late_s = 0.0
        """Of the message that came last."""

    def see(self, seen: BootTimeSeen) -> None:
        """Measure a message."""
        self._boot_s = max(seen.boot_s, self._boot_s)
        offset_s = seen.time_s - seen.boot_s
        expected_s = offset_s
        if self._least is not None:
            when_s, least_s = self._least
            expected_s = least_s + SAFETY.clock_drift * max(0.0, seen.time_s - when_s)
        if offset_s <= expected_s:
            self._least = seen.time_s, offset_s
        self.late_s = max(0.0, offset_s - expected_s if seen.late_s is None else seen.late_s)

    def starts_again(self, seen: BootTimeSeen) -> bool:
        """Whether the autopilot has started since the messages before."""
        return seen.boot_s + 1.0 < self._boot_s

    @property
    def fault(self) -> str | None:
        """Say that it is too late to command anything; None when it is not."""
        if self.late_s <= SAFETY.latest_telemetry_s:
            return None
        return f"the autopilot's messages come {self.late_s:.1f} s late"
