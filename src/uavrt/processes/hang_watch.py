"""Abort a search that hangs, and identify its tag.

A timer of processor time checks which tag is processed (`DetectorGroup.last_searched`); one
step at several checks in a row is a hang. An exception ends it and the process continues,
whereas the supervisor would kill it without knowing the tag. Processor time excludes a stopped
process or computer. A hang inside one library call is left to the supervisor.
"""

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType

LOOK_S = 0.8
"""Processor time between two checks [s]."""
LOOKS = 5
"""Checks at the same turn that mean a hang: 3.2 to 4 s. The supervisor waits 5 s for a sign of
life; a tag's longest turn takes some tenths of a second."""


class SearchHangs(RuntimeError):
    """A search did not end."""


class HangWatch:
    """A reusable context that raises `SearchHangs` within it when a turn does not end.

    `turn`: returns the present turn, another object for each.
    """

    def __init__(self, turn: Callable[[], object]) -> None:
        self._turn = turn
        self._last: object = None
        self._looks = 0
        self._able = threading.current_thread() is threading.main_thread()

    def __enter__(self) -> None:
        self._looks = 0
        if self._able:
            signal.signal(signal.SIGPROF, self._look)
            signal.setitimer(signal.ITIMER_PROF, LOOK_S, LOOK_S)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._able:
            signal.setitimer(signal.ITIMER_PROF, 0.0)

    def _look(self, _number: int, _frame: FrameType | None) -> None:
        turn = self._turn()
        self._looks = self._looks + 1 if turn is self._last else 1
        self._last = turn
        if self._looks >= LOOKS:
            self._looks = 0
            raise SearchHangs(f"no end after {LOOK_S * (LOOKS - 1):.1f} s of computing")
