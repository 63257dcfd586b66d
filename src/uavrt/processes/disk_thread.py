"""A thread for what waits on the disk, so that a disk that stalls never silences the link.

Belongs to the connection process. One thread, one job after the other: a file that is closed
is not being read any more. What it gives is taken in the loop.
"""

import asyncio
import threading
from collections import deque
from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")

MOST_JOBS = 32
"""Jobs that may wait; a download has one or two."""
SLOW_S = 2.0
FINISH_TURNS, FINISH_TURN_S = 50, 0.01


class DiskThread:
    """Does jobs beside an asyncio loop; start it in the loop.

    The thread is a daemon: a disk that never answers does not keep the process from ending.
    """

    def __init__(self) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        self._jobs: deque[tuple[Callable[[], Any], Callable[[Any], None]]] = deque()
        self._there = threading.Semaphore(0)
        self._since_s: float | None = None
        self.failure: BaseException | None = None
        """What ended the thread: a fault of ours."""

    def start(self) -> None:
        """Begin to work for the running loop."""
        self._loop = asyncio.get_running_loop()
        threading.Thread(target=self._work, name="disk", daemon=True).start()

    def __call__(self, job: Callable[[], T], then: Callable[[T], None]) -> bool:
        """Do `job` in the thread and `then` with its result in the loop.

        Returns
        -------
        bool
            False, and nothing is done, when too many wait.
        """
        if len(self._jobs) >= MOST_JOBS:
            return False
        self._jobs.append((job, then))
        self._there.release()
        return True

    async def finish(self) -> None:
        """Let it do what waits, unless the disk stalls."""
        for _ in range(FINISH_TURNS):
            if not self._jobs and self._since_s is None:
                return
            await asyncio.sleep(FINISH_TURN_S)

    @property
    def waiting(self) -> int:
        """Jobs that have not begun."""
        return len(self._jobs)

    def stalled_s(self, now_s: float) -> float:
        """How long the present job has taken [s, monotonic]; 0 when it is quick."""
        since_s = self._since_s
        return 0.0 if since_s is None or now_s - since_s < SLOW_S else now_s - since_s

    def _work(self) -> None:
        assert self._loop is not None
        while True:
            self._there.acquire()
            self._since_s = self._loop.time()  # before: `finish` looks at both
            job, then = self._jobs.popleft()
            try:
                result = job()
            except BaseException as error:  # noqa: BLE001 - raised where `failure` is read
                self.failure = error
                return
            self._since_s = None
            try:
                self._loop.call_soon_threadsafe(then, result)
            except RuntimeError:
                return  # the loop is closed: the process ends
