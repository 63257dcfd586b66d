"""When the recorder commits: rarely, because each commit writes partly filled pages."""

PULSES_S = 3.0
"""Longest time until a pulse is committed, and shortest time between such commits [s]."""
OTHERS_S = 15.0
"""Longest time until vehicle poses, health and texts are committed [s]; a power cut loses
them."""
RETRY_S = 1.0
"""Wait after a failed commit [s]."""


class CommitTimes:
    """Tracks what is waiting for a commit, and since when."""

    def __init__(self) -> None:
        self._pulses_at_s: float | None = None
        self._others_at_s: float | None = None

    def pulses_wait(self, now_s: float) -> None:
        """Note that a pulse is waiting."""
        if self._pulses_at_s is None:
            self._pulses_at_s = now_s + PULSES_S

    def others_wait(self, now_s: float) -> None:
        """Note that another record is waiting."""
        if self._others_at_s is None:
            self._others_at_s = now_s + OTHERS_S

    def pulses_due(self, now_s: float) -> bool:
        """Whether to commit the pulses now."""
        return self._pulses_at_s is not None and now_s >= self._pulses_at_s

    def all_due(self, now_s: float) -> bool:
        """Whether to commit everything now, also with pulses shortly before the rest is due."""
        spare_s = PULSES_S if self.pulses_due(now_s) else 0.0
        return self._others_at_s is not None and now_s >= self._others_at_s - spare_s

    def committed(self, now_s: float, *, pulses_only: bool = False) -> None:
        """Note that everything waiting was committed."""
        self._pulses_at_s = None
        if not pulses_only:
            self._others_at_s = None

    def failed(self, now_s: float) -> None:
        """Note a failed commit; the next attempt is soon."""
        self._pulses_at_s = now_s + RETRY_S
        self._others_at_s = now_s + RETRY_S
