"""An asyncio loop whose clock stands still while there is something to do.

Programs that exchange datagrams on this computer run in it unchanged. A wait costs no time: the
loop moves its clock forward to the next timer, so results depend on what the programs made
each other wait for and not on how busy the machine is.
"""

import asyncio
import selectors
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from typing import Any, TypeVar

import pytest

from uavrt.core import clock
from uavrt.core.runtime.disk_thread import DiskThread
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.simulation.vehicle.datagrams import DatagramPort

T = TypeVar("T")
START_S = 100_000.0
"""The monotonic clock at the start of a test [s]."""
WALL_OFFSET_S = 1_700_000_000
"""Wall clock minus monotonic clock at the start of a test [s].

The wall clock then shows 2023, so the kernel's time stamps of datagrams lie in the future and
are not used.
"""
THREAD_PAUSE_S = 0.0005
"""How long the loop really waits for other threads before it moves its clock [s]."""


class VirtualClock:
    """Stands in for the module `time` in `uavrt.core.clock`; one for each test."""

    process_time = staticmethod(time.process_time)

    def __init__(self) -> None:
        self.now_s = START_S
        self.wall_offset_s: float = WALL_OFFSET_S
        self.source: Callable[[], float] | None = None
        """Function that counts the seconds in place of the clock."""

    def monotonic(self) -> float:
        """Virtual seconds of the monotonic clock."""
        return self.now_s if self.source is None else self.source()

    def monotonic_ns(self) -> int:
        """Virtual nanoseconds of the monotonic clock."""
        return round(self.monotonic() * NANOSECONDS_PER_SECOND)

    def set_wall_ns(self, time_ns: int) -> None:
        """Let the wall clock show a time now."""
        self.wall_offset_s = time_ns / NANOSECONDS_PER_SECOND - self.monotonic()

    def time_ns(self) -> int:
        """Virtual nanoseconds of the wall clock."""
        return self.monotonic_ns() + round(self.wall_offset_s * NANOSECONDS_PER_SECOND)


def follow(source: Callable[[], float]) -> None:
    """Let the running test's clock show the seconds that a simulated vehicle or link counts."""
    running = vars(clock)["time"]
    assert isinstance(running, VirtualClock)
    running.source = source


class _Jumping(selectors.DefaultSelector):
    """Waits for a timer by moving the clock to it."""

    def __init__(self, virtual: VirtualClock) -> None:
        super().__init__()
        self._virtual = virtual
        self._threads = threading.active_count()

    def select(self, timeout: float | None = None) -> Any:
        found = super().select(0)
        if found or timeout == 0:
            return found
        if timeout is None:
            return super().select(None)
        if threading.active_count() > self._threads:
            found = super().select(THREAD_PAUSE_S)
            if found:
                return found
        self._virtual.now_s += max(timeout, 1e-6)
        return super().select(0)


class VirtualLoop(asyncio.SelectorEventLoop):
    """A loop on a virtual clock; work for other threads is done at once in this one."""

    def __init__(self, virtual: VirtualClock) -> None:
        self._virtual = virtual
        super().__init__(_Jumping(virtual))

    def time(self) -> float:
        return self._virtual.now_s

    def run_in_executor(  # type: ignore[override]  # names of arguments; a future, as of a loop that waits
        self, _: Executor | None, func: Callable[..., Any], *args: Any
    ) -> asyncio.Future[Any]:
        future = self.create_future()
        try:
            future.set_result(func(*args))
        except Exception as error:  # noqa: BLE001 - raised where the future is awaited
            future.set_exception(error)
        return future


class _Policy(asyncio.DefaultEventLoopPolicy):
    """Makes every new loop a virtual one."""

    def __init__(self, virtual: VirtualClock) -> None:
        super().__init__()
        self._virtual = virtual

    def new_event_loop(self) -> asyncio.AbstractEventLoop:
        return VirtualLoop(self._virtual)


def _at_once(disk: DiskThread, job: Callable[[], Any], then: Callable[[Any], None]) -> bool:
    """Do a disk job in the loop: a thread needs real time, while seconds pass here."""
    try:
        result = job()
    except Exception as error:  # noqa: BLE001 - raised where `failure` is read
        disk.failure = error
        return True
    try:
        asyncio.get_running_loop().call_soon(then, result)
    except RuntimeError:  # a test without a loop
        then(result)
    return True


@contextmanager
def virtual_time() -> Iterator[VirtualClock]:
    """Put every clock of the package and every new asyncio loop on one virtual clock."""
    virtual = VirtualClock()
    before = asyncio.get_event_loop_policy()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(clock, "time", virtual)
        patch.setattr(DatagramPort, "_arrival_ns", lambda self, _: self._clock.now_ns())
        patch.setattr(DiskThread, "start", lambda self: None)
        patch.setattr(DiskThread, "__call__", _at_once)
        asyncio.set_event_loop_policy(_Policy(virtual))
        try:
            yield virtual
        finally:
            asyncio.set_event_loop_policy(before)
