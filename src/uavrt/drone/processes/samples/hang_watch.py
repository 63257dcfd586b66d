"""Abort a search that hangs, and identify its tag, which the supervisor could not do.

A timer of processor time checks which step runs (`DetectorGroup.last_searched`). If several
checks in a row find the same step, it counts as hanging. An exception then ends it, and the
process continues. Processor time excludes pauses of the process or computer. A hang within one
library call is left to the supervisor.
"""

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType

CHECK_S = 0.8
"""Processor time between two checks of the search [s]."""
CHECKS = 5
"""Number of consecutive checks in one step of the search that counts as a hang: 3.2 to 4 s. The
supervisor kills the process after 5 s of silence; a normal step takes some tenths of a second
at most."""


class SearchHangs(RuntimeError):
    """Raised when a step of the search for pulses takes too long."""


class HangWatch:
    """Context that raises `SearchHangs` if one step of the search takes too long.

    `turn` returns the present step, as a different object for each step.
    """

    def __init__(self, turn: Callable[[], object]) -> None:
        self._turn = turn
        self._last: object = None
        self._checks = 0
        self._able = threading.current_thread() is threading.main_thread()

    def __enter__(self) -> None:
        self._checks = 0
        if self._able:
            signal.signal(signal.SIGPROF, self._check)
            signal.setitimer(signal.ITIMER_PROF, CHECK_S, CHECK_S)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._able:
            signal.setitimer(signal.ITIMER_PROF, 0.0)

    def _check(self, _number: int, _frame: FrameType | None) -> None:
        turn = self._turn()
        self._checks = self._checks + 1 if turn is self._last else 1
        self._last = turn
        if self._checks >= CHECKS:
            self._checks = 0
            raise SearchHangs(
                f"the search did not finish within {CHECK_S * (CHECKS - 1):.1f} s of CPU time"
            )
