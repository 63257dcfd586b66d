"""A thread for what waits on the disk, so that a disk that stalls never silences a link.

Used by the drone's connection process and by the ground station. One thread, one job after the
other: a file that is closed is not being read any more, and records are written in the order in
which they came. Results are taken in the loop.
"""

import asyncio
import threading
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, Generic, Protocol, TypeVar

from uavrt.clock import monotonic_s
from uavrt.errors import RecordingError

T = TypeVar("T")
R = TypeVar("R")

MOST_JOBS = 32
"""Jobs that may wait; a download has one or two."""
SLOW_S = 2.0
FINISH_S, FINISH_TURN_S = 0.5, 0.01


class Disk(Protocol):
    """Does `job` and then, with its result, `then`; False when it takes no more."""

    def __call__(self, job: Callable[[], T], then: Callable[[T], None]) -> bool:
        """Take a job."""


def at_once(job: Callable[[], T], then: Callable[[T], None]) -> bool:
    """Do a job where it is given, for programs that have no link to keep alive."""
    then(job())
    return True


class DiskThread:
    """Does jobs beside an asyncio loop; start it in the loop.

    The thread is a daemon: a disk that never answers does not keep the process from ending.

    `most`: jobs that may wait.
    `early`: until the thread is started, do jobs where they are given instead of keeping them.
    """

    def __init__(self, most: int = MOST_JOBS, *, early: bool = False) -> None:
        self._most, self._early = most, early
        self._loop: asyncio.AbstractEventLoop | None = None
        self._jobs: deque[tuple[Callable[[], Any], Callable[[Any], None]]] = deque()
        self._there = threading.Semaphore(0)
        self._since_s: float | None = None
        self.failure: BaseException | None = None
        """What ended the thread: a fault of ours."""

    def start(self) -> None:
        """Begin to work for the running loop, once."""
        if self._loop is not None:
            return
        self._loop = asyncio.get_running_loop()
        threading.Thread(target=self._work, name="disk", daemon=True).start()

    def __call__(self, job: Callable[[], T], then: Callable[[T], None]) -> bool:
        """Do `job` in the thread and `then` with its result in the loop.

        Returns: False, and nothing is done, when too many wait.
        """
        if self._early and self._loop is None:
            return at_once(job, then)
        if len(self._jobs) >= self._most:
            return False
        self._jobs.append((job, then))
        self._there.release()
        return True

    async def run(self, function: Callable[..., T], *given: Any) -> T:
        """Call a function in the thread; what it returns or raises comes here.

        Raises `RecordingError`: too many jobs wait for the disk.
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
            raise RecordingError("the disk does not answer", remedy="Check or replace it")
        return await result

    async def finish(self, within_s: float = FINISH_S) -> None:
        """Let it do what waits, unless the disk stalls."""
        for _ in range(round(within_s / FINISH_TURN_S)):
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


class DiskBatches(Generic[T, R]):
    """Collects items in the loop and writes them in the disk thread, one batch at a time.

    `disk`: the thread.
    `write`: writes a batch, in the thread.
    `then`: gets each batch and what `write` returned, in the loop.
    """

    def __init__(
        self,
        disk: Disk,
        write: Callable[[list[T]], R],
        then: Callable[[list[T], R], None] = lambda _batch, _result: None,
    ) -> None:
        self._disk, self._write, self._done = disk, write, then
        self.waiting: list[T] = []
        """Items that are not handed over."""
        self.handed_s: float | None = None
        """When the batch that is being written was handed over [s, monotonic]."""
        self.took_s = 0.0
        """How long the batch before took."""
        self._again = False

    def add(self, item: T) -> None:
        """Collect an item and write it as soon as the disk is free."""
        self.waiting.append(item)
        self.write()

    def write(self) -> None:
        """Hand over what waits, even nothing; after the batch that is being written, if any."""
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
