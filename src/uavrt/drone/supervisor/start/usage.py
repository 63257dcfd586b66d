"""CPU time and memory of a process and all its descendants, read from ``/proc``."""

import os
from dataclasses import dataclass

_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
MOST_BYTES = 16_384


@dataclass(frozen=True, slots=True)
class Usage:
    """CPU time and memory of a process, or of several together."""

    cpu_s: float
    """CPU time (user and system), including that of ended children [s]."""
    memory_mb: float
    """Resident memory [MB]; a page shared by processes counts in each of them."""


def read_proc(path: str) -> str:
    """Read up to 16 kB of a file in ``/proc``, five times faster than by a file object."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        return os.read(descriptor, MOST_BYTES).decode("utf-8", "replace")
    finally:
        os.close(descriptor)


def children_of(pid: int) -> tuple[int, ...]:
    """Return the ids of a process's living children; empty if the process has ended."""
    try:
        text = read_proc(f"/proc/{pid}/task/{pid}/children")
    except OSError:
        return ()
    return tuple(int(child) for child in text.split())


def own_usage(pid: int) -> Usage:
    """Measure a process without its living children; zeros if it has ended."""
    return _usages(pid)[0]


def descendants_of(pid: int) -> tuple[int, ...]:
    """Return the ids of a process's living descendants."""
    found: list[int] = []
    waiting = [pid]
    while waiting:
        new = children_of(waiting.pop())
        found += new
        waiting += new
    return tuple(found)


def usage_of(pid: int) -> Usage:
    """Measure a process with its living descendants; zeros if it has ended."""
    return measure(pid)[1]


def measure(pid: int) -> tuple[Usage, Usage]:
    """Measure a process without and with its living descendants; zeros if it has ended."""
    own, family = _usages(pid)
    cpu_s, memory_mb = family.cpu_s, family.memory_mb
    for current in descendants_of(pid):
        _, usage = _usages(current)
        cpu_s += usage.cpu_s
        memory_mb += usage.memory_mb
    return own, Usage(cpu_s, memory_mb)


def _usages(pid: int) -> tuple[Usage, Usage]:
    """Return the usage of a process without and with its ended children; zeros if it has ended.

    In ``/proc/PID/stat``, counted from the state after the name (0), fields 11 to 14 are utime
    and stime of the process and of its reaped children, and field 21 is rss (proc(5)).
    """
    try:
        fields = read_proc(f"/proc/{pid}/stat").rpartition(") ")[2].split()
    except OSError:
        return Usage(0.0, 0.0), Usage(0.0, 0.0)
    if len(fields) < 22:
        return Usage(0.0, 0.0), Usage(0.0, 0.0)
    own, dead = (sum(map(int, fields[start : start + 2])) for start in (11, 13))
    memory_mb = int(fields[21]) * _PAGE_BYTES / 1e6
    return (Usage(own / _TICKS_PER_S, memory_mb), Usage((own + dead) / _TICKS_PER_S, memory_mb))
