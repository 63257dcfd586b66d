"""Measure how late the autopilot's reports arrive, from their timestamps; no I/O.

On a slow link with queues, the report of a pilot's takeover may arrive seconds late.
"""

from uavrt.guidance.control.observed import BootTimeReport
from uavrt.guidance.safety import SAFETY


class ReportDelay:
    """Delay of the autopilot's reports.

    It is measured by TIMESYNC if available. Otherwise the fastest message since the link came
    up counts as not delayed, and others are compared with it.
    """

    def __init__(self) -> None:
        self._least: tuple[float, float] | None = None
        """Least delayed message: its arrival time, and arrival minus autopilot's time [s]."""
        self._boot_s = 0.0
        self.late_s = 0.0
        """Delay of the autopilot's last message on its way to this computer [s]."""

    def observe(self, seen: BootTimeReport) -> None:
        """Update `late_s` from a message with the autopilot's time since its start."""
        self._boot_s = max(seen.boot_s, self._boot_s)
        offset_s = seen.time_s - seen.boot_s
        expected_s = offset_s
        if self._least is not None:
            when_s, least_s = self._least
            expected_s = least_s + SAFETY.clock_drift * max(0.0, seen.time_s - when_s)
        if offset_s <= expected_s:
            self._least = seen.time_s, offset_s
        self.late_s = max(0.0, offset_s - expected_s if seen.late_s is None else seen.late_s)

    def starts_again(self, seen: BootTimeReport) -> bool:
        """True if the autopilot has restarted since the previous messages."""
        return seen.boot_s + 1.0 < self._boot_s

    @property
    def fault(self) -> str | None:
        """Text on a delay that forbids commands; None if the delay is small enough."""
        if self.late_s <= SAFETY.latest_telemetry_s:
            return None
        return f"the autopilot's messages arrive {self.late_s:.1f} s late"
