"""Abort a search that hangs, and name the tag it was for.

Whoever searches says whose turn it is (`DetectorGroup.in_hand`). A timer of processor time
looks at that; the same turn for several looks in a row is a search that hangs. It is broken off
by an exception, and the process lives on: the supervisor would kill it for its silence, without
knowing for which of its tags.

Processor time, so that a computer that stands still, or a process that was stopped, is nobody's
fault. What hangs in one call of a library is not broken off; the supervisor ends that.
"""

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType

LOOK_S = 0.8
"""Processor time between two looks."""
LOOKS = 5
"""Looks at the same turn, 3.2 to 4 s: the supervisor waits 5 s for a sign of life. The longest
turn of a tag takes some tenths of a second on a small computer."""


class SearchHangs(RuntimeError):
    """A search did not end."""


class HangWatch:
    """A reusable context that watches a search.

    `turn`: gives whose turn it is: another object at each turn.
    Raises `SearchHangs`: within the context: the turn does not end.
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
