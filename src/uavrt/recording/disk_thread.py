"""A thread for disk work, so that a stalled disk does not block a link.

Used by the drone's connection process and by the ground station. One thread runs one job after
the other, so records are written in order and no file is closed while it is read. Results
arrive in the loop.
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
    """Runs `job` and then, with its result, `then`; False when too many wait."""

    def __call__(self, job: Callable[[], T], then: Callable[[T], None]) -> bool:
        """Queue or run a job."""


def at_once(job: Callable[[], T], then: Callable[[T], None]) -> bool:
    """Run a job inline, for programs without a link to keep alive."""
    then(job())
    return True


class DiskThread:
    """Runs jobs for an asyncio loop; start it in the loop.

    A daemon thread: a disk that hangs does not keep the process from ending.

    `most`: jobs that may wait. `early`: run jobs inline until the thread is started.
    """

    def __init__(self, most: int = MOST_JOBS, *, early: bool = False) -> None:
        self._most, self._early = most, early
        self._loop: asyncio.AbstractEventLoop | None = None
        self._jobs: deque[tuple[Callable[[], Any], Callable[[Any], None]]] = deque()
        self._there = threading.Semaphore(0)
        self._since_s: float | None = None
        self.failure: BaseException | None = None
        """The internal error that ended the thread."""

    def start(self) -> None:
        """Begin to work for the running loop, once."""
        if self._loop is not None:
            return
        self._loop = asyncio.get_running_loop()
        threading.Thread(target=self._work, name="disk", daemon=True).start()

    def __call__(self, job: Callable[[], T], then: Callable[[T], None]) -> bool:
        """Do `job` in the thread, then `then` with its result in the loop; False if full."""
        if self._early and self._loop is None:
            return at_once(job, then)
        if len(self._jobs) >= self._most:
            return False
        self._jobs.append((job, then))
        self._there.release()
        return True

    async def run(self, function: Callable[..., T], *given: Any) -> T:
        """Await a function run in the thread; raises `RecordingError` if too many jobs wait."""
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
        """Let it finish the waiting jobs, unless the disk stalls."""
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

    `write`: writes a batch, in the thread. `then`: gets each batch and what `write` returned,
    in the loop.
    """

    def __init__(
        self,
        disk: Disk,
        write: Callable[[list[T]], R],
        then: Callable[[list[T], R], None] = lambda _batch, _result: None,
    ) -> None:
        self._disk, self._write, self._done = disk, write, then
        self.waiting: list[T] = []
        """Items not handed over yet."""
        self.handed_s: float | None = None
        """When the batch being written was handed over [s, monotonic]."""
        self.took_s = 0.0
        """Duration of the previous batch [s]."""
        self._again = False

    def add(self, item: T) -> None:
        """Collect an item and write it as soon as the disk is free."""
        self.waiting.append(item)
        self.write()

    def write(self) -> None:
        """Hand over the waiting items, even none, after the batch that is being written."""
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
