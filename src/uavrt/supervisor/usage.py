"""CPU time and memory of a process and all its descendants, from ``/proc``."""

import os
from dataclasses import dataclass
from pathlib import Path

_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True, slots=True)
class Usage:
    """What a process tree has used."""

    cpu_s: float
    """User and system time of the living, and of the dead that were waited for."""
    memory_mb: float
    """Resident memory (RSS); shared pages are counted in each process."""


def children_of(pid: int) -> tuple[int, ...]:
    """Get the living children of a process; none when it has gone."""
    try:
        text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    except OSError:
        return ()
    return tuple(int(child) for child in text.split())


def usage_of(pid: int) -> Usage:
    """Measure a process and its living descendants; zeros when it has gone."""
    cpu_s = memory_mb = 0.0
    waiting = [pid]
    while waiting:
        current = waiting.pop()
        try:
            fields = Path(f"/proc/{current}/stat").read_text().rpartition(") ")[2].split()
        except (OSError, IndexError):
            continue
        # After the name: state is field 0, utime..cstime 11..14, rss 21 (man 5 proc).
        cpu_s += sum(int(field) for field in fields[11:15]) / _TICKS_PER_S
        memory_mb += int(fields[21]) * os.sysconf("SC_PAGE_SIZE") / 1e6
        waiting += children_of(current)
    return Usage(cpu_s, memory_mb)
