"""CPU time and memory of a process and all its descendants, from ``/proc``."""

import math
import os
import re
from dataclasses import dataclass
from pathlib import Path

_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
MOST_BYTES = 16_384


@dataclass(frozen=True, slots=True)
class Usage:
    """What a process tree has used."""

    cpu_s: float
    """User and system time of the living, and of the dead that were waited for."""
    memory_mb: float
    """Resident memory (RSS); shared pages are counted in each process."""


def _read(path: str) -> str:
    """Read a file of ``/proc`` of less than 16 kB.

    Without a file object, which makes three more system calls and takes five times as long:
    this is done twice a second for each process.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        return os.read(descriptor, MOST_BYTES).decode("utf-8", "replace")
    finally:
        os.close(descriptor)


def children_of(pid: int) -> tuple[int, ...]:
    """Get the living children of a process; none if it is gone."""
    try:
        text = _read(f"/proc/{pid}/task/{pid}/children")
    except OSError:
        return ()
    return tuple(int(child) for child in text.split())


def is_alive(pid: int) -> bool:
    """Whether a process runs; one that only waits to be reaped does not."""
    try:
        return _read(f"/proc/{pid}/stat").rpartition(") ")[2][:1] not in ("Z", "")
    except OSError:
        return False


def own_usage(pid: int) -> Usage:
    """Measure a process without its children; zeros if it is gone."""
    return _usages(pid)[0]


def descendants_of(pid: int) -> tuple[int, ...]:
    """Get all living descendants of a process."""
    found: list[int] = []
    waiting = [pid]
    while waiting:
        new = children_of(waiting.pop())
        found += new
        waiting += new
    return tuple(found)


def usage_of(pid: int) -> Usage:
    """Measure a process and its living descendants; zeros if it is gone."""
    return measure(pid)[1]


def measure(pid: int) -> tuple[Usage, Usage]:
    """Measure a process, first alone, then with its descendants; zeros if it is gone."""
    own, family = _usages(pid)
    cpu_s, memory_mb = family.cpu_s, family.memory_mb
    for current in descendants_of(pid):
        _, usage = _usages(current)
        cpu_s += usage.cpu_s
        memory_mb += usage.memory_mb
    return own, Usage(cpu_s, memory_mb)


def _usages(pid: int) -> tuple[Usage, Usage]:
    """Read ``/proc/PID/stat``: the process alone, and with its dead children.

    After the name, state is field 0; utime, stime and those of the dead children are 11 to 14,
    rss is 21 (proc(5)).
    """
    try:
        fields = _read(f"/proc/{pid}/stat").rpartition(") ")[2].split()
    except OSError:
        return Usage(0.0, 0.0), Usage(0.0, 0.0)
    if len(fields) < 22:
        return Usage(0.0, 0.0), Usage(0.0, 0.0)
    own, dead = (sum(map(int, fields[start : start + 2])) for start in (11, 13))
    memory_mb = int(fields[21]) * _PAGE_BYTES / 1e6
    return (
        Usage(own / _TICKS_PER_S, memory_mb),
        Usage((own + dead) / _TICKS_PER_S, memory_mb),
    )


def own_cpu_s(pid: int) -> float:
    """Get a process's CPU time to the scheduler's nanosecond [s]; 0 if it is gone."""
    total_ns = 0
    for task in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        try:
            total_ns += int(task.read_text().split()[0])
        except (OSError, IndexError):
            continue
    return total_ns * 1e-9


def written_mb(pid: int) -> float:
    """Get what a process has had written to disks since its start [MB]; 0 if it is gone.

    Whole pages of files that it made dirty, each time after they had been written back
    (``write_bytes`` of proc(5), less what was cut off before); NaN where the kernel does not
    count it.
    """
    try:
        lines = _read(f"/proc/{pid}/io").split("\n")
    except OSError:
        return math.nan if not os.path.exists("/proc/self/io") else 0.0
    counts = {
        name: int(count) for name, _, count in (line.partition(": ") for line in lines[:7])
    }
    return (counts["write_bytes"] - counts["cancelled_write_bytes"]) / 1e6


def pss_mb(pid: int) -> float:
    """Get the proportional set size [MB]: a page shared by n processes counts 1/n in each.

    The sum over processes is the memory they take together. 0 when the process has gone.
    """
    try:
        rollup = _read(f"/proc/{pid}/smaps_rollup")
    except OSError:
        return 0.0
    found = re.search(r"^Pss:\s+(\d+) kB", rollup, re.MULTILINE)
    return int(found.group(1)) * 1024 / 1e6 if found else 0.0
