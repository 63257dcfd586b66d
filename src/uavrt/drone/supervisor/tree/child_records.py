"""Schedule reads of the processes' records: at once when idle, in batches under load.

A hundred tags cause forty messages a second. Each wake-up of the supervisor costs 0.1 to 0.2
ms, more than the records themselves, so reads are at least `PERIOD_S` apart. After a pause,
records are read at once, so that an operator's command is not delayed.
"""

import asyncio
import select
from collections.abc import Callable

PERIOD_S = 0.05
"""Shortest time between two reads of processes' records under load [s]. A pulse passes the
supervisor three times, so its delay is at most 0.15 s. A block of radio samples lasts 87 ms."""


class Intake:
    """Calls the read functions of processes whose sockets have data, at limited rate."""

    def __init__(self, period_s: float = PERIOD_S) -> None:
        self._period_s = period_s
        self._epoll = select.epoll()
        self._readers: dict[int, Callable[[], object]] = {}
        self._listening = False
        self._timer: asyncio.TimerHandle | None = None

    def add(self, fd: int, read: Callable[[], object]) -> None:
        """From now on, call `read` when the descriptor is readable."""
        self._readers[fd] = read
        self._epoll.register(fd, select.EPOLLIN)
        if self._timer is None:
            self._listen(True)

    def remove(self, fd: int) -> None:
        """Stop watching a descriptor, before it is closed; an unknown one is ignored."""
        if self._readers.pop(fd, None) is not None:
            self._epoll.unregister(fd)
        if not self._readers:
            self._unregister()

    def _unregister(self) -> None:
        self._listen(False)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _listen(self, wanted: bool) -> None:
        if wanted == self._listening:
            return
        loop = asyncio.get_running_loop()
        if wanted:
            loop.add_reader(self._epoll.fileno(), self._take)
        else:
            loop.remove_reader(self._epoll.fileno())
        self._listening = wanted

    def _take(self) -> None:
        """Read all records that have arrived, then pause or, if there were none, wait for
        input.
        """
        self._timer = None
        ready = self._epoll.poll(0)
        try:
            for fd, _ in ready:
                read = self._readers.get(fd)  # an earlier one may have ended this one
                if read is not None:
                    read()
        finally:
            if self._readers:
                self._listen(not ready)
                if ready:
                    loop = asyncio.get_running_loop()
                    self._timer = loop.call_later(self._period_s, self._take)
