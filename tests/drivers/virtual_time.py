"""An asyncio loop whose clock stands still while there is something to do.

Programs that talk through sockets on this computer run in it unchanged and in no time; what
they wait for is what they made each other wait for, not what a busy machine did.
"""

import asyncio
import selectors
import time
from collections.abc import Callable, Coroutine
from types import SimpleNamespace
from typing import Any, TypeVar

import pytest

from uavrt import clock
from uavrt.processes.disk_thread import DiskThread
from uavrt.simulation.datagrams import DatagramPort
from uavrt.units import NANOSECONDS_PER_SECOND

START_S = 100_000.0
"""In 1970: an arrival that the kernel stamps is far in the future and not believed."""


T = TypeVar("T")


class _Jumping(selectors.DefaultSelector):
    """Waits by setting the clock forward."""

    now_s = START_S

    def select(self, timeout: float | None = None) -> Any:
        found = super().select(0)
        if found or timeout == 0:
            return found
        if timeout is None:
            return super().select(None)
        self.now_s += max(timeout, 1e-6)
        return super().select(0)


def run_in_virtual_time(main: Coroutine[Any, Any, T], patch: pytest.MonkeyPatch) -> T:
    """Run `main` in a loop of virtual time, with every clock of the package."""
    selector = _Jumping()
    loop = asyncio.SelectorEventLoop(selector)

    def now_ns() -> int:
        return round(selector.now_s * NANOSECONDS_PER_SECOND)

    loop.time = lambda: selector.now_s  # type: ignore[method-assign]
    patch.setattr(
        clock,
        "time",
        SimpleNamespace(
            monotonic_ns=now_ns,
            time_ns=now_ns,
            monotonic=lambda: selector.now_s,
            process_time=time.process_time,
        ),
    )
    patch.setattr(DatagramPort, "_arrival_ns", lambda self, ancillary: now_ns())

    def at_once(_: DiskThread, job: Callable[[], T], then: Callable[[T], None]) -> bool:
        """A thread would work in real time, while seconds pass here."""
        loop.call_soon(then, job())
        return True

    patch.setattr(DiskThread, "start", lambda self: None)
    patch.setattr(DiskThread, "__call__", at_once)
    try:
        return loop.run_until_complete(main)
    finally:
        loop.close()
