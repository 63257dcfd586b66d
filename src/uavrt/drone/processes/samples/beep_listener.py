"""Search for unlisted beeping senders in a thread, so that reading the radio continues.

A batch of the search takes up to 0.2 s on a slow computer; a radio's pipe buffers 40 ms.
"""

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from uavrt.core.log import get_logger
from uavrt.core.messages import Beep, IQBlock
from uavrt.detection.beeps.beep_search import BeepSearch

log = get_logger()

MOST_WAITING: Final = 6
"""Most sample blocks queued for the search; 12 MB at 3 MS/s."""
_CLOSE_S: Final = 2.0


_Item = tuple[BeepSearch, IQBlock | None, IQBlock | None]
"""Queued work: the search object, a block of the radio's band and one of the tags' band (None
if not needed)."""


class BeepListener:
    """Runs the search for beeping senders in a thread. `make` creates a search object."""

    def __init__(self, make: Callable[[], BeepSearch]) -> None:
        self._make = make
        self._search = make()
        self._waiting: deque[_Item | None] = deque()
        self._there = threading.Semaphore(0)
        self._found: deque[tuple[BeepSearch, Beep]] = deque()
        self.failed = False
        """True if the thread has ended with an error; no more senders are found then."""
        self.dropped_s = 0.0
        """Duration of samples dropped because the search was too slow [s]."""
        self._thread = threading.Thread(target=self._work, name="beeps", daemon=True)
        self._thread.start()

    def add(self, block: IQBlock, band: IQBlock) -> None:
        """Queue a block of the radio's band and the simultaneous block of the tags' band."""
        wanted = self._search.due(block, band)
        if wanted == (None, None):
            return
        if len(self._waiting) >= MOST_WAITING or not self._thread.is_alive():
            self.dropped_s += len(block.samples) / block.sample_rate_hz
            return
        # The source reads its next block into the same memory.
        radio, tags = (
            None if one is None else replace(one, samples=one.samples.copy()) for one in wanted
        )
        self._put((self._search, radio, tags))

    def take_found(self) -> list[Beep]:
        """Return the beeping senders found since the last call."""
        found = [self._found.popleft() for _ in range(len(self._found))]
        return [beep for search, beep in found if search is self._search]

    def begin_again(self) -> None:
        """Start a new search without old samples, because the radio's settings have changed."""
        self._search = self._make()

    @property
    def cells_dropped(self) -> int:
        """Number of spectrum cells skipped because too many exceeded the threshold."""
        return self._search.dropped

    def close(self) -> None:
        """Search the queued samples, then end the thread; wait for it a limited time."""
        self._put(None)
        self._thread.join(_CLOSE_S)

    def _put(self, item: _Item | None) -> None:
        self._waiting.append(item)
        self._there.release()

    def _work(self) -> None:
        try:
            while True:
                self._there.acquire()
                item = self._waiting.popleft()
                if item is None:
                    return
                search, *blocks = item
                if search is not self._search:
                    continue
                search.take(*blocks)
                time_ns = next(one.time_ns for one in blocks if one is not None)
                self._found.extend((search, beep) for beep in search.news(time_ns))
        except Exception:  # the flight goes on without it
            self.failed = True
            log.exception("search for unlisted senders failed")
