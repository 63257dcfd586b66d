"""Run tasks in parallel in separate processes, so that a crash affects only one task."""

import multiprocessing
import signal
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from uavrt.core.errors import UavrtError
from uavrt.drone.ipc.parent import die_with_parent

MOST_DEATHS = 3
"""Number of worker crashes during the same task after which it is skipped."""
_POLL_S = 0.3


R_co = TypeVar("R_co", covariant=True)
R = TypeVar("R")


class Task(Protocol[R_co]):
    """Interface of a task that is pickled and sent to a worker."""

    def packed(self) -> "Task[R_co]":
        """Return a copy of the task that contains the data which a worker needs."""

    def work(
        self, should_stop: Callable[[], bool], on_done: Callable[[int], None]
    ) -> R_co | None:
        """Run the task and report progress; None if stopped before the end."""

    def failed(self, fault: str) -> R_co:
        """Result with the reason why the task could not be done."""


def run_tasks(
    tasks: Sequence[Task[R]],
    workers: int,
    *,
    should_stop: Callable[[], bool] = lambda: False,
    on_done: Callable[[int], None] = lambda _count: None,
) -> Iterator[tuple[int, R]]:
    """Run tasks in `workers` processes; yield the number and the result of each finished task.

    If `workers` is 1, the tasks run in this process.
    """
    if workers <= 1:
        for number, task in enumerate(tasks):
            result = run_here(task, should_stop, on_done)
            if result is None:
                return
            yield number, result
        return
    waiting, deaths = list(range(len(tasks))), Counter[int]()
    while waiting and not should_stop():
        with _Pool(min(workers, len(waiting))) as pool:
            left = yield from run_in_pool(tasks, waiting, pool, should_stop, on_done)
        deaths.update(left.interrupted)
        waiting = [number for number in left.undone if deaths[number] < MOST_DEATHS]
        if should_stop():
            return
        for number in left.undone:
            if deaths[number] >= MOST_DEATHS:
                fault = f"the worker crashed {MOST_DEATHS} times during this task"
                yield number, tasks[number].failed(fault)


@dataclass(frozen=True, slots=True)
class Unfinished:
    """Indices of the tasks not started, and of those running when a worker crashed."""

    undone: list[int]
    interrupted: list[int]


class Workers(Protocol):
    """Interface of a pool of workers."""

    def at_once(self) -> int:
        """Number of tasks that may be submitted before others are finished."""

    def submit(self, task: Task[R]) -> "Future[R | None]":
        """Submit a task to a worker."""

    def result(self, future: "Future[R | None]", task: Task[R]) -> R | None:
        """Result of a finished task; raises BrokenProcessPool if a worker crashed."""

    def done(self) -> int:
        """Sum of the amounts that all workers' tasks have passed to `on_done`."""


def run_in_pool(
    tasks: Sequence[Task[R]],
    numbers: Sequence[int],
    pool: Workers,
    should_stop: Callable[[], bool],
    on_done: Callable[[int], None],
) -> Generator[tuple[int, R], None, Unfinished]:
    """Run tasks in a pool; yield the number and result of each finished task, and return the
    unfinished tasks.

    When the run is to stop, running tasks are abandoned; the next run repeats them.
    """
    undone, queue = dict.fromkeys(numbers), iter(numbers)
    running: dict[Future[R | None], int] = {}
    broken, reported = False, 0
    while not broken:
        # Submit no more than can run: the others can still be skipped at a stop.
        while len(running) < pool.at_once() and not should_stop():
            number = next(queue, None)
            if number is None:
                break
            try:
                running[submitted(tasks[number], pool)] = number
            except BrokenProcessPool:
                broken = True
                break
        if not running:
            break
        ended, _ = wait(running, timeout=_POLL_S, return_when=FIRST_COMPLETED)
        now = pool.done()
        on_done(now - reported)
        reported = now
        if should_stop():
            break
        interrupted = list(running.values())
        for future in ended:
            number = running.pop(future)
            try:
                result = pool.result(future, tasks[number])
            except BrokenProcessPool:
                broken = True
                continue
            if result is not None:
                del undone[number]
                yield number, result
    on_done(pool.done() - reported)
    return Unfinished(list(undone), interrupted if broken else [])


def submitted(task: Task[R], pool: Workers) -> "Future[R | None]":
    """Submit a task with its data; if the data cannot be loaded, its result is a failure."""
    try:
        return pool.submit(task.packed())
    except UavrtError as error:
        failed: Future[R | None] = Future()
        failed.set_result(task.failed(str(error)))
        return failed


class _Pool:
    """Pool of worker processes on this computer, used until one of them crashes."""

    def __init__(self, workers: int) -> None:
        # A fresh interpreter each: a fork would copy the threads' locks as they are.
        context = multiprocessing.get_context("spawn")
        self._done = context.Value("q", 0)
        self._workers, self._in_hand = workers, 0
        self._others = set(multiprocessing.active_children())
        self._executor = ProcessPoolExecutor(
            workers, context, initializer=_begin, initargs=(self._done,)
        )

    def __enter__(self) -> "_Pool":
        return self

    def __exit__(self, *_error: object) -> None:
        if self._in_hand:  # the run is to stop, and nothing that they do can be damaged by it
            for process in set(multiprocessing.active_children()) - self._others:
                process.kill()
        self._executor.shutdown(wait=True, cancel_futures=True)

    def at_once(self) -> int:
        return self._workers

    def submit(self, task: Task[R]) -> "Future[R | None]":
        self._in_hand += 1
        # Workers start with the signals of this thread: Ctrl-C is not for them.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            return self._executor.submit(_work, task)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def result(self, future: "Future[R | None]", task: Task[R]) -> R | None:
        del task
        self._in_hand -= 1
        return future.result()

    def done(self) -> int:
        return int(self._done.value)


_shared: list[Any] = []


def _begin(done: Any) -> None:
    """Prepare a worker process: ignore Ctrl-C, and exit when the parent process ends."""
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _shared[:] = [done]


def _work(task: Task[R]) -> R | None:
    (done,) = _shared

    def count(now: int) -> None:
        with done.get_lock():
            done.value += now

    return run_safely(task, lambda: False, count)


def run_here(
    task: Task[R], should_stop: Callable[[], bool], on_done: Callable[[int], None]
) -> R | None:
    """Load a task's data and run it in this process; None if stopped before the end."""
    try:
        packed = task.packed()
    except UavrtError as error:
        return task.failed(str(error))
    return run_safely(packed, should_stop, on_done)


def run_safely(
    task: Task[R], should_stop: Callable[[], bool], on_done: Callable[[int], None]
) -> R | None:
    """Run a task; an unexpected error becomes a failure, so that the run continues."""
    try:
        return task.work(should_stop, on_done)
    except (MemoryError, ArithmeticError, LookupError, TypeError, ValueError) as error:
        return task.failed(f"{type(error).__name__}: {error}")
