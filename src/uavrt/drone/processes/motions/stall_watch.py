"""Detect pauses of this process, after which received messages may be old."""

from uavrt.guidance.safety import SAFETY

LATE_S = 0.2
"""Time between two turns of the main loop (normally 50 ms) that counts as a pause [s].

After a pause, waiting messages of the autopilot are read before a command is sent, and before
the autopilot counts as silent."""
LATE_TURNS = 2
"""Number of turns of the main loop after a pause until all messages have been read."""


class StallWatch:
    """Measures pauses of this process, in which messages wait; `now_s`: present time."""

    def __init__(self, now_s: float) -> None:
        self._awake_s = now_s
        self._late_turns = 0
        self._silence_counts_from_s = 0.0

    @property
    def late(self) -> bool:
        """True if messages that arrived during a pause may still be unread."""
        return self._late_turns > 0

    def wake(self, now_s: float, *, turn: bool = False) -> float:
        """Register that the process runs; return the pause before [s].

        `turn`: True at the beginning of a turn of the main loop.
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
        """True if silence of the autopilot counts; false for `SAFETY.stall_s` after a pause."""
        return not self.late or now_s >= self._silence_counts_from_s
