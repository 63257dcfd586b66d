"""Return free heap memory to the system now and then."""

import ctypes
import gc
import os
from collections.abc import Callable

TRIM_PERIOD_S = 20.0
"""A trim takes 0.1 to 2 ms, and what is used again is got again page by page; a collection in
a process of the flight 1 to 3 ms, because what was there at its start is frozen (gc.freeze)."""

_POOL_BYTES, _STEP_BYTES, _LARGEST_BYTES = 16_384, 16, 512
"""Python's own allocator: objects of one size share a pool; larger ones are malloc's
(``Objects/obmalloc.c`` of CPython 3.11 and later; with other figures less is filled)."""
_MOST_BLOCKS = 40_000
"""It takes 4000 after the imports of a flight."""


def fill_pools() -> list[object]:
    """Fill the free places between Python's objects, before a process is forked.

    A new object takes a free place between old ones first. In a forked process each such place
    makes one more inherited page its own, at ten pages a minute, for hours; with none left, new
    objects stay together. Takes 10 ms and 0.4 MB, once.

    Returns: what fills them; to be kept.
    """
    kept: list[object] = [None] * _MOST_BLOCKS  # made whole: growing it would take places
    used = 0
    # Smaller ones than 48 bytes are numbers only, and few places.
    for size in range(3 * _STEP_BYTES, _LARGEST_BYTES + 1, _STEP_BYTES):
        in_a_row, last = 0, 0
        # So many side by side are a pool that was empty: there are no places between others.
        while in_a_row < _POOL_BYTES // size - 2 and used < _MOST_BLOCKS:
            block = bytes(size - b"".__sizeof__())
            in_a_row = in_a_row + 1 if id(block) == last + size else 1
            kept[used], last = block, id(block)
            used += 1
        used -= in_a_row  # an empty pool is given back
        kept[used : used + in_a_row] = [None] * in_a_row
    del kept[used:]
    return kept


def heap_as_it_grows() -> None:
    """Undo what Dask's nanny sets for its workers: to give freed memory back at once.

    With MALLOC_TRIM_THRESHOLD_ at 64 KiB each temporary array faults its pages anew, which
    makes detection 1.7 times as dear. The figures are those that malloc itself comes to for a
    program with large arrays (mallopt(3)). Elsewhere nothing is done.
    """
    if "MALLOC_TRIM_THRESHOLD_" in os.environ and _mallopt is not None:
        _mallopt(_M_MMAP_THRESHOLD, 32 << 20)
        _mallopt(_M_TRIM_THRESHOLD, 64 << 20)


def heap_of_short_arrays() -> None:
    """Give large arrays back as soon as they are done with, of whatever thread they are.

    A search thinks in threads, each order in one more. By default each thread has a heap of its
    own, which keeps the arrays of its largest moment, of ten thousand hypotheses. With one heap
    for all, and arrays of 256 KiB or more outside it, that is not there (mallopt(3)).
    """
    if _mallopt is not None:
        _mallopt(_M_ARENA_MAX, 1)
        _mallopt(_M_MMAP_THRESHOLD, 256 << 10)
        _mallopt(_M_TRIM_THRESHOLD, 1 << 20)


def _find_trim() -> Callable[[int], int] | None:
    """Get malloc_trim(3), which glibc has and others do not need."""
    try:
        found: Callable[[int], int] = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return None
    return found


def _find_mallopt() -> Callable[[int, int], int] | None:
    """Get mallopt(3), which glibc has."""
    try:
        found: Callable[[int, int], int] = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return None
    return found


_trim = _find_trim()
_mallopt = _find_mallopt()
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8


class HeapKeeper:
    """Trims the heap now and then, three times a minute unless told otherwise.

    A busy moment (a burst of blocks after a stall, a search over a long stretch) leaves holes
    that glibc keeps for ever unless they lie at the end: over half an hour the receiver and a
    detector gained 2 MB each by that.

    Python keeps holes, too: up to 2000 unused tuples of each length up to 19, which only a
    collection of everything frees. A generator made into a tuple four times a second takes
    160 kB that way within eight minutes; and of pages that were inherited by a fork each
    becomes the process's own.

    `period_s`: time between two trims [s].
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
