"""Detection of pauses of this process, after which received messages may be old. Pure."""

from uavrt.guidance.safety import SAFETY

LATE_S = 0.2
"""Longest time between two turns of the process, which come every 50 ms, before it is late [s].

The autopilot's messages of a longer pause are read before a command is sent, and before
the autopilot counts as silent.
"""
LATE_TURNS = 2
"""Turns after which those messages are read: in one turn the hub and the link are served in
any order."""


class StallWatch:
    """Time since the process was last awake; it begins awake at `now_s`."""

    def __init__(self, now_s: float) -> None:
        self._awake_s = now_s
        self._late_turns = 0
        self._silence_counts_from_s = 0.0

    @property
    def late(self) -> bool:
        """Whether messages that arrived during a pause may still be unread."""
        return self._late_turns > 0

    def wake(self, now_s: float, *, turn: bool = False) -> float:
        """Note that the process is awake, in a new `turn` or within one; get its pause [s]."""
        pause_s, self._awake_s = now_s - self._awake_s, now_s
        if pause_s > LATE_S:
            if not self.late:
                self._silence_counts_from_s = now_s + SAFETY.stall_s
            self._late_turns = LATE_TURNS
        elif turn:
            self._late_turns = max(0, self._late_turns - 1)
        return pause_s

    def silence_counts(self, now_s: float) -> bool:
        """Whether the autopilot itself is silent: not for `SAFETY.stall_s` after late turns."""
        return not self.late or now_s >= self._silence_counts_from_s
