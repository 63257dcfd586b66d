"""Run tasks on a Dask cluster, whose workers on several computers share the same files.

A marker file in the output identifies the current run, and workers read it regularly. If it is
missing or identifies another run, they abandon their task.
"""

import logging
import math
import os
import pickle
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, Future
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import uavrt
from uavrt.analysis.archive.steps.workers import Task, run_in_pool, run_safely
from uavrt.core.atomic_file import write_atomically
from uavrt.core.errors import LinkError, UsageError, needs_extra
from uavrt.core.runtime.heap import heap_as_it_grows

R = TypeVar("R")
CONNECT_S = 15.0
NO_WORKER_S = 3.0
"""Time without any worker of the cluster after which a message is shown [s]."""
_CLOSE_S = 0.5
_POLL_S = 0.5
_QUEUED_LEAST = 64
"""Minimum number of queued tasks, because an adaptive cluster grows with its queue."""


class RunMarker:
    """Marker file that identifies the current run to workers."""

    def __init__(self, path: Path, run: str) -> None:
        self._path, self._run = path, run
        self._read_s, self._stop = 0.0, False

    def write(self) -> None:
        """Write the run's identifier to the marker file."""
        write_atomically(self._path, self._run, sync=False)

    def should_stop(self) -> bool:
        """True if the marker file is missing or another run's; the worker must then stop."""
        now_s = time.monotonic()
        if now_s - self._read_s >= _POLL_S and not self._stop:
            self._read_s = now_s
            self._stop = not self._path.is_file() or self._path.read_text() != self._run
        return self._stop


def run_on_cluster(
    tasks: Sequence[Task[R]],
    scheduler: str,
    folder: Path,
    *,
    should_stop: Callable[[], bool],
    on_done: Callable[[int], None],
    on_wait: Callable[[str], None],
) -> Iterator[tuple[int, R]]:
    """Run tasks on a cluster; yield the number and the result of each finished task.

    All workers must see `folder` under the same name. `on_done` is called with the amount of
    work done since its last call, and `on_wait` with a message while there is no worker.
    """
    if not tasks:
        return
    with closing(_Cluster(scheduler, folder, on_wait)) as pool:
        yield from run_in_pool(tasks, range(len(tasks)), pool, should_stop, on_done)


class _Cluster:
    def __init__(self, scheduler: str, folder: Path, on_wait: Callable[[str], None]) -> None:
        with needs_extra("batch", "--scheduler"):
            import distributed
        try:
            self._client = distributed.Client(
                scheduler, timeout=CONNECT_S, set_as_default=False, name="uavrt batch"
            )
        except (OSError, ValueError) as error:
            raise UsageError(
                f"no Dask scheduler answers at {scheduler}",
                remedy="Start one (dask scheduler), and give its address as tcp://HOST:PORT",
            ) from error
        self._scheduler, self._on_wait = scheduler, on_wait
        # One sentence says that a scheduler has gone; Dask writes its whole stack.
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        logging.getLogger("tornado.application").setLevel(logging.CRITICAL)
        self._killed = distributed.KilledWorker
        self._run = uuid.uuid4().hex
        self._file = folder / "run"
        self._sign = RunMarker(self._file, self._run)
        self._sign.write()
        self._done = 0
        self._client.subscribe_topic(self._run, self._count)
        self._executor: Executor = self._client.get_executor(pure=False)
        self._threads, self._looked_s, self._alone_s = 0, 0.0, time.monotonic()

    def close(self) -> None:
        self._file.unlink(missing_ok=True)
        with suppress(OSError, TimeoutError):
            self._executor.shutdown(wait=False)
            self._client.close(timeout=_CLOSE_S)

    def at_once(self) -> int:
        """Number of submitted tasks that keeps workers busy and lets a cluster grow."""
        now_s = time.monotonic()
        if now_s - self._looked_s > 1.0 and self._client.status == "running":
            self._looked_s = now_s
            with _scheduler_there():
                self._threads = sum(self._client.nthreads().values())
            if self._threads:
                self._alone_s = now_s
            elif now_s - self._alone_s > NO_WORKER_S:
                self._alone_s = math.inf  # it is said once, until one has come
                self._on_wait(
                    f"no worker is connected to the scheduler. Start one on each machine: "
                    f"dask worker {self._scheduler} --nthreads 1"
                )
        return max(_QUEUED_LEAST, 2 * self._threads)

    def submit(self, task: Task[R]) -> "Future[R | None]":
        packed = pickle.dumps(task)
        with _scheduler_there():
            return self._executor.submit(
                _work, packed, self._file, self._run, uavrt.__version__
            )

    def result(self, future: "Future[R | None]", task: Task[R]) -> R | None:
        """Result of a task. Raises `LinkError` if the connection to the scheduler is lost."""
        with _scheduler_there():
            try:
                return future.result()
            except self._killed:
                return task.failed("workers crashed repeatedly during this task")

    def done(self) -> int:
        return self._done

    def _count(self, event: Any) -> None:
        self._done += int(event[1])


@contextmanager
def _scheduler_there() -> Iterator[None]:
    """Context manager that converts Dask's errors about a lost scheduler to `LinkError`."""
    try:
        yield
    except (CancelledError, OSError) as error:
        raise LinkError(
            "the connection to the Dask scheduler is lost",
            remedy="Start the scheduler again, and repeat the command; it continues "
            "where it stopped",
        ) from error


class _ProgressSender:
    """Sends a worker's progress to the run, no more often than it is displayed."""

    def __init__(self, run: str) -> None:
        from distributed import get_worker

        self._worker, self._run = get_worker(), run
        self._amount, self._reported_s = 0, time.monotonic()

    def add(self, amount: int) -> None:
        self._amount += amount
        if time.monotonic() - self._reported_s >= _POLL_S:
            self.flush()

    def flush(self) -> None:
        self._worker.log_event(self._run, self._amount)
        self._amount, self._reported_s = 0, time.monotonic()


def _work(packed: bytes, file: Path, run: str, version: str) -> Any:
    heap_as_it_grows()
    task: Task[Any] = pickle.loads(packed)
    if version != uavrt.__version__:
        return task.failed(
            f"the worker on {os.uname().nodename} has uavrt {uavrt.__version__}, not {version}"
        )
    teller = _ProgressSender(run)
    try:
        return run_safely(task, RunMarker(file, run).should_stop, teller.add)
    finally:
        teller.flush()
