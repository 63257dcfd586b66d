"""Return free heap memory to the system from time to time."""

import ctypes
import gc
import os
from collections.abc import Callable

TRIM_PERIOD_S = 20.0
"""Time between two trims of the heap [s]. A trim takes 0.1 to 2 ms, and memory that is used
again must be mapped again. The garbage collection that precedes it takes 1 to 3 ms in a process
of the flight, because objects from its start are frozen (gc.freeze)."""

_POOL_BYTES, _STEP_BYTES, _LARGEST_BYTES = 16_384, 16, 512
"""Pool size, size step and largest size of Python's own allocator [bytes]. Objects of one size
share a pool; larger ones use malloc (``Objects/obmalloc.c`` of CPython 3.11 and later; with
other values less is filled)."""
_MOST_BLOCKS = 40_000
"""Maximum number of objects that fill gaps in memory pools; after the imports of a flight, 4000
are usual."""


def fill_pools() -> list[object]:
    """Fill the gaps in Python's memory pools before a process is forked, which saves memory.

    A forked process shares its parent's memory pages until it writes to them. Objects created
    in the gaps would make ten pages a minute private. The call takes 10 ms and 0.4 MB. It
    returns the filling objects; the gaps stay filled only while these are referenced.
    """
    kept: list[object] = [None] * _MOST_BLOCKS  # allocated whole: growing uses free slots
    used = 0
    # Objects below 48 bytes are numbers only; their pools have few free slots.
    for size in range(3 * _STEP_BYTES, _LARGEST_BYTES + 1, _STEP_BYTES):
        in_a_row, last = 0, 0
        # A run of this length is an empty pool: no free slots between other objects remain.
        while in_a_row < _POOL_BYTES // size - 2 and used < _MOST_BLOCKS:
            block = bytes(size - b"".__sizeof__())
            in_a_row = in_a_row + 1 if id(block) == last + size else 1
            kept[used], last = block, id(block)
            used += 1
        used -= in_a_row  # an empty pool is returned to the system
        kept[used : used + in_a_row] = [None] * in_a_row
    del kept[used:]
    return kept


def heap_as_it_grows() -> None:
    """Let a Dask worker reuse freed memory, up to 64 MB (mallopt(3)).

    Dask sets MALLOC_TRIM_THRESHOLD_, which makes a worker return freed memory at once. Each
    temporary array then maps its pages again, and the work takes 1.7 times as long.
    """
    if "MALLOC_TRIM_THRESHOLD_" in os.environ and _mallopt is not None:
        _mallopt(_M_MMAP_THRESHOLD, 32 << 20)
        _mallopt(_M_TRIM_THRESHOLD, 64 << 20)


def heap_of_short_arrays() -> None:
    """Return large arrays of any thread to the system as soon as they are freed.

    By default each thread's heap keeps the memory of its peak. One heap for all threads, and
    arrays of 256 KiB or more outside of the heap, avoid this (mallopt(3)).
    """
    if _mallopt is not None:
        _mallopt(_M_ARENA_MAX, 1)
        _mallopt(_M_MMAP_THRESHOLD, 256 << 10)
        _mallopt(_M_TRIM_THRESHOLD, 1 << 20)


def _find_trim() -> Callable[[int], int] | None:
    try:
        found: Callable[[int], int] = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return None
    return found


def _find_mallopt() -> Callable[[int, int], int] | None:
    try:
        found: Callable[[int, int], int] = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        return None
    return found


_trim = _find_trim()
_mallopt = _find_mallopt()
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8


class HeapKeeper:
    """Trims the heap periodically, by default three times a minute.

    A busy moment leaves holes in the heap that glibc keeps unless they lie at its end. Python
    also keeps up to 2000 unused tuples of each length, which only a full collection frees.
    Without trims, receiver and detector grew by 2 MB each in half an hour.
    """

    def __init__(self, now_s: float, *, period_s: float = TRIM_PERIOD_S) -> None:
        self._period_s = period_s
        self._next_s = now_s + period_s

    def keep(self, now_s: float) -> bool:
        """Trim the heap if a trim is due; returns True if trimmed."""
        if now_s < self._next_s:
            return False
        self._next_s = now_s + self._period_s
        gc.collect()
        if _trim is not None:
            _trim(0)
        return True
