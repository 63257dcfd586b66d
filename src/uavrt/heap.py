"""Gives memory that is free inside the heap back to the system, now and then."""

import ctypes
import gc
from collections.abc import Callable

TRIM_PERIOD_S = 20.0
"""A trim takes 0.1 to 2 ms, and what is used again is got again page by page; a collection in
a process of the flight 1 to 3 ms, because what was there at its start is frozen (gc.freeze)."""


def _find_trim() -> Callable[[int], int] | None:
    """Get malloc_trim(3), which glibc has and others do not need."""
    try:
        found: Callable[[int], int] = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return None
    return found


_trim = _find_trim()


class HeapKeeper:
    """Trims the heap now and then, three times a minute unless told otherwise.

    A busy moment (a burst of blocks after a stall, a search over a long stretch) leaves holes
    that glibc keeps for ever unless they lie at the end: over half an hour the receiver and a
    detector gained 2 MB each by that.

    Python keeps holes, too: up to 2000 unused tuples of each length up to 19, which only a
    collection of everything frees. A generator made into a tuple four times a second takes
    160 kB that way within eight minutes; and of pages that were inherited by a fork each
    becomes the process's own.

    Parameters
    ----------
    now_s : float
        Monotonic time [s].
    period_s : float
        Time between two trims [s].
    """

    def __init__(self, now_s: float, *, period_s: float = TRIM_PERIOD_S) -> None:
        self._period_s = period_s
        self._next_s = now_s + period_s

    def keep(self, now_s: float) -> bool:
        """Trim if it is due; whether it was."""
        if now_s < self._next_s:
            return False
        self._next_s = now_s + self._period_s
        gc.collect()
        if _trim is not None:
            _trim(0)
        return True
