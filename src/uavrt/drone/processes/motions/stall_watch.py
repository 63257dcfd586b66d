"""Detect pauses of this process, because messages read after a pause may be old."""

from uavrt.guidance.safety import SAFETY

LATE_S = 0.2
"""Time between two passes of the main loop from which it counts as a pause [s]; 50 ms is
normal. After a pause, messages of the autopilot that waited are read before a command is sent,
and before the autopilot counts as silent."""
LATE_TURNS = 2
"""Number of main loop passes after a pause in which all waiting messages are read."""


class StallWatch:
    """Measures pauses of this process; messages wait unread during a pause."""

    def __init__(self, now_s: float) -> None:
        self._awake_s = now_s
        self._late_turns = 0
        self._silence_counts_from_s = 0.0

    @property
    def late(self) -> bool:
        """True if messages from a pause may still be unread."""
        return self._late_turns > 0

    def wake(self, now_s: float, *, turn: bool = False) -> float:
        """Note that the process runs; return the time since the previous call [s].

        `turn` is True once in each pass of the main loop.
        """
        pause_s, self._awake_s = now_s - self._awake_s, now_s
        if pause_s > LATE_S:
            if not self.late:
                self._silence_counts_from_s = now_s + SAFETY.stall_s
            self._late_turns = LATE_TURNS
        elif turn:
            self._late_turns = max(0, self._late_turns - 1)
        return pause_s

    def silence_counts(self, now_s: float) -> bool:
        """True if silence of the autopilot is real.

        After a pause this is False for `SAFETY.stall_s`, or until all messages are read.
        """
        return not self.late or now_s >= self._silence_counts_from_s
