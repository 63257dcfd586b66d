"""Estimate the drone's clock offset from the delays of its pulses. No I/O."""

from uavrt.core.units import NANOSECONDS_PER_SECOND

SKEW_PULSES = 5
"""Number of pulses compared before a clock offset is reported. The first pulses may be old,
because the drone repeats lost pulses after a gap."""
LATE_NS = 10 * NANOSECONDS_PER_SECOND
AHEAD_NS = 3 * NANOSECONDS_PER_SECOND
"""Largest time by which a pulse's time stamp may be ahead of our clock [ns]; `LATE_NS` is the
largest delay. Usual delays are 0.5 to 2 s. If all delays are outside these limits, the drone's
clock is wrong."""


class ClockSkew:
    """Estimates by how much the drone's clock is behind ours, from the least delayed pulses."""

    def __init__(self) -> None:
        self.skew_ns: int | None = None
        self._delays = 0
        self._least_delay_ns: int | None = None

    def learn(self, delay_ns: int) -> str | None:
        """Add a pulse's delay [ns]; return a message when an offset is first
        found, else None.
        """
        self._delays += 1
        least_ns = self._least_delay_ns
        self._least_delay_ns = delay_ns if least_ns is None else min(delay_ns, least_ns)
        if self._delays < SKEW_PULSES:
            return None
        least_ns = self._least_delay_ns
        skew_ns = least_ns if not -AHEAD_NS <= least_ns <= LATE_NS else 0
        first = self.skew_ns is None
        if self.skew_ns is None or skew_ns < self.skew_ns:
            self.skew_ns = skew_ns
            if first and skew_ns != 0:
                return f"the drone's clock differs by {-skew_ns / NANOSECONDS_PER_SECOND:.0f} s"
        return None
