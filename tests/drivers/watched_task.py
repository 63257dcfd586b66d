"""A batch's task whose worker tells, too, what it loaded and how much memory it took."""

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True, slots=True)
class Seen:
    """What a worker did, and what it was then."""

    result: Any
    modules: frozenset[str]
    """Packages that it had loaded."""
    most_mb: float
    """Most memory that it ever had, with what it shares with others."""


@dataclass(frozen=True, slots=True)
class WatchedTask:
    """A task, watched from inside its worker."""

    task: Any

    def packed(self) -> "WatchedTask":
        """Take along what the worker is to have."""
        return WatchedTask(self.task.packed())

    def failed(self, fault: str) -> Seen:
        """Give a result when nothing could be done."""
        raise AssertionError(fault)

    def work(self, should_stop: Callable[[], bool], on_done: Callable[[int], None]) -> Seen:
        """Do it, and look."""
        result = self.task.work(should_stop, on_done)
        status = Path("/proc/self/status").read_text()
        (peak_kb,) = re.findall(r"VmHWM:\s+(\d+) kB", status)
        modules = frozenset(name.partition(".")[0] for name in sys.modules)
        return Seen(result, modules, float(peak_kb) / 1024.0)
