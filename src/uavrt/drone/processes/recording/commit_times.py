"""Decide when the recorder commits; rarely, because each commit writes partly filled pages."""

PULSES_S = 3.0
"""Longest time until a pulse is committed to disk, and shortest between two commits [s]."""
OTHERS_S = 15.0
"""Longest time until poses, health and texts are committed to disk [s]; lost in a power cut."""
RETRY_S = 1.0


class CommitTimes:
    """Tracks how long pulses and other records have been waiting for a commit."""

    def __init__(self) -> None:
        self._pulses_at_s: float | None = None
        self._others_at_s: float | None = None

    def pulses_wait(self, now_s: float) -> None:
        """Record the time at which a pulse was written."""
        if self._pulses_at_s is None:
            self._pulses_at_s = now_s + PULSES_S

    def others_wait(self, now_s: float) -> None:
        """Record the time at which a record other than a pulse was written."""
        if self._others_at_s is None:
            self._others_at_s = now_s + OTHERS_S

    def pulses_due(self, now_s: float) -> bool:
        """True if the written pulses should be committed now."""
        return self._pulses_at_s is not None and now_s >= self._pulses_at_s

    def all_due(self, now_s: float) -> bool:
        """True if everything written should be committed now, including pulses due soon."""
        spare_s = PULSES_S if self.pulses_due(now_s) else 0.0
        return self._others_at_s is not None and now_s >= self._others_at_s - spare_s

    def committed(self, now_s: float, *, pulses_only: bool = False) -> None:
        """Reset the waiting times after a commit."""
        self._pulses_at_s = None
        if not pulses_only:
            self._others_at_s = None

    def failed(self, now_s: float) -> None:
        """Postpone the next commit after a failed one."""
        self._pulses_at_s = now_s + RETRY_S
        self._others_at_s = now_s + RETRY_S
