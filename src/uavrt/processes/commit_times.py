"""When the recorder commits: seldom, for each commit writes pages that are partly full."""

PULSES_S = 3.0
"""A pulse is recorded at most so long after it came; also the least time between two commits
for pulses."""
OTHERS_S = 15.0
"""Poses of the vehicle, health and texts wait longer: a kill loses none of them, a power cut
these last seconds. Together they fill their pages."""
RETRY_S = 1.0
"""After a commit that failed."""


class CommitTimes:
    """What is waiting for a commit, and since when."""

    def __init__(self) -> None:
        self._pulses_at_s: float | None = None
        self._others_at_s: float | None = None

    def pulses_wait(self, now_s: float) -> None:
        """A pulse has come."""
        if self._pulses_at_s is None:
            self._pulses_at_s = now_s + PULSES_S

    def others_wait(self, now_s: float) -> None:
        """Something else has come."""
        if self._others_at_s is None:
            self._others_at_s = now_s + OTHERS_S

    def pulses_due(self, now_s: float) -> bool:
        """Whether the pulses are to be committed now."""
        return self._pulses_at_s is not None and now_s >= self._pulses_at_s

    def all_due(self, now_s: float) -> bool:
        """Whether everything is to be committed now.

        Also when there are pulses to commit and the rest would follow within `PULSES_S`.
        """
        spare_s = PULSES_S if self.pulses_due(now_s) else 0.0
        return self._others_at_s is not None and now_s >= self._others_at_s - spare_s

    def committed(self, now_s: float, *, pulses_only: bool = False) -> None:
        """What waited is recorded."""
        self._pulses_at_s = None
        if not pulses_only:
            self._others_at_s = None

    def failed(self, now_s: float) -> None:
        """Nothing was recorded: try again soon."""
        self._pulses_at_s = now_s + RETRY_S
        self._others_at_s = now_s + RETRY_S
