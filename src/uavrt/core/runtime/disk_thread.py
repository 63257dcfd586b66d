"""A thread for disk work, so that a stalled disk does not block the radio link.

The drone's connection process and the ground station use it. Jobs run one after the other, so
records are written in order, and no file is closed while it is read. Results are delivered in
the event loop.
"""

import asyncio
import threading
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, Generic, Protocol, TypeVar

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import RecordingError

T = TypeVar("T")
R = TypeVar("R")

MOST_JOBS = 32
"""Maximum number of jobs that wait for the disk thread; a download needs one or two."""
SLOW_S = 2.0
FINISH_S, FINISH_TURN_S = 0.5, 0.01


class Disk(Protocol):
    """Interface to run disk jobs, with or without a thread."""

    def __call__(self, job: Callable[[], T], then: Callable[[T], None]) -> bool:
        """Run `job`, then call `then` with its result; False if too many jobs wait."""


def at_once(job: Callable[[], T], then: Callable[[T], None]) -> bool:
    """Run a job at once in the calling thread and return True; for programs without a link."""
    then(job())
    return True


class DiskThread:
    """Runs disk jobs for an asyncio loop in a daemon thread; must be started in the loop.

    The thread is a daemon, so that a stalled disk does not prevent the process from ending.
    `most` limits the waiting jobs. With `early`, jobs run in the caller until the thread is
    started.
    """

    def __init__(self, most: int = MOST_JOBS, *, early: bool = False) -> None:
        self._most, self._early = most, early
        self._loop: asyncio.AbstractEventLoop | None = None
        self._jobs: deque[tuple[Callable[[], Any], Callable[[Any], None]]] = deque()
        self._there = threading.Semaphore(0)
        self._since_s: float | None = None
        self.failure: BaseException | None = None
        """Internal error that ended the thread; None if there is none."""

    def start(self) -> None:
        """Start the thread for the running loop; later calls have no effect."""
        if self._loop is not None:
            return
        self._loop = asyncio.get_running_loop()
        threading.Thread(target=self._work, name="disk", daemon=True).start()

    def __call__(self, job: Callable[[], T], then: Callable[[T], None]) -> bool:
        """Run `job` in the thread, then `then` with its result in the loop.

        Returns False, without running the job, if too many jobs wait.
        """
        if self._early and self._loop is None:
            return at_once(job, then)
        if len(self._jobs) >= self._most:
            return False
        self._jobs.append((job, then))
        self._there.release()
        return True

    async def run(self, function: Callable[..., T], *given: Any) -> T:
        """Run a function in the thread and wait for its result.

        Raises `RecordingError` if too many jobs wait.
        """
        result: asyncio.Future[T] = asyncio.get_running_loop().create_future()

        def job() -> Callable[[], None]:
            try:
                return partial(result.set_result, function(*given))
            except Exception as error:  # noqa: BLE001 - raised where the result is awaited
                return partial(result.set_exception, error)

        def then(settle: Callable[[], None]) -> None:
            if not result.done():
                settle()

        if not self(job, then):
            raise RecordingError("the disk does not answer", remedy="Check or replace the disk")
        return await result

    async def finish(self, within_s: float = FINISH_S) -> None:
        """Wait until the queued jobs are done, for at most `within_s` [s]."""
        for _ in range(round(within_s / FINISH_TURN_S)):
            if not self._jobs and self._since_s is None:
                return
            await asyncio.sleep(FINISH_TURN_S)

    @property
    def waiting(self) -> int:
        """Number of jobs that have not begun."""
        return len(self._jobs)

    def stalled_s(self, now_s: float) -> float:
        """Duration of the present job so far [s]; 0 below `SLOW_S`, or without a job."""
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


class DiskBatches(Generic[T, R]):
    """Collects items, and writes them in batches in the disk thread, one batch at a time."""

    def __init__(
        self,
        disk: Disk,
        write: Callable[[list[T]], R],
        then: Callable[[list[T], R], None] = lambda _batch, _result: None,
    ) -> None:
        self._disk, self._write, self._done = disk, write, then
        self.waiting: list[T] = []
        """Items to be written that are not yet in a batch."""
        self.handed_s: float | None = None
        """Time when the batch being written was submitted [s, monotonic]; None without one."""
        self.took_s = 0.0
        """Time that writing the previous batch took [s]."""
        self._again = False

    def add(self, item: T) -> None:
        """Add an item, and write it as soon as the disk is free."""
        self.waiting.append(item)
        self.write()

    def write(self) -> None:
        """Write the waiting items as a batch, after the present batch; there may be none."""
        self._again = self.handed_s is not None
        if self._again:
            return
        batch, self.waiting = self.waiting, []
        self.handed_s = monotonic_s()
        if not self._disk(partial(self._write, batch), partial(self._written, batch)):
            self.handed_s, self.waiting = None, batch + self.waiting

    def _written(self, batch: list[T], result: R) -> None:
        assert self.handed_s is not None
        self.took_s, self.handed_s = monotonic_s() - self.handed_s, None
        self._done(batch, result)
        if self._again:
            self.write()
