"""Decide when the recorder commits to disk.

Commits are rare, because each writes partly filled pages.
"""

PULSES_S = 3.0
"""Longest time until a written pulse is committed to disk [s]; also the shortest time between
two commits."""
OTHERS_S = 15.0
"""Longest time until poses, health and texts are committed to disk [s]; a power cut loses those
not committed."""
RETRY_S = 1.0


class CommitTimes:
    """Times at which written pulses and other records must be committed to disk."""

    def __init__(self) -> None:
        self._pulses_at_s: float | None = None
        self._others_at_s: float | None = None

    def pulses_wait(self, now_s: float) -> None:
        """Note that a pulse was written at `now_s`."""
        if self._pulses_at_s is None:
            self._pulses_at_s = now_s + PULSES_S

    def others_wait(self, now_s: float) -> None:
        """Note that a record other than a pulse was written at `now_s`."""
        if self._others_at_s is None:
            self._others_at_s = now_s + OTHERS_S

    def pulses_due(self, now_s: float) -> bool:
        """True if the written pulses should be committed now."""
        return self._pulses_at_s is not None and now_s >= self._pulses_at_s

    def all_due(self, now_s: float) -> bool:
        """True if all written records, not only pulses, should be committed now."""
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
